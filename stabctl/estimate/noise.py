"""Covariances of measurement and process, derived from the noise of the phasors.

State of a machine: x = [delta (rad), s = omega - 1 (pu), Pm (pu machine)], known input the air-gap power P:

    d delta/dt = wb s,   2H ds/dt = Pm - P - D s,   dPm/dt = white noise of density q.

Measurement: the angle of E = V + Z I. With relative errors e = m + j a of V and I, a = V/E and b = Z I/E,
    var arg E = sa^2 (Re^2 a + Re^2 b) + sm^2 (Im^2 a + Im^2 b),                                   (R)
and, with S = E conj(I) = P + jQ, from the power's own errors
    var P = 2 sm^2 P^2 + 2 sa^2 Q^2.                                                                (P)

Process over a frame T, four sources added:
    walk   q * integral of g g', g(t) = [wb t^2/4H, t/2H, 1];
    power  (var P + (share (Pm - P))^2) / (2H)^2 * g g', g = [wb T^2/2, T, 0];   share: how wrong the model may be
    jump   P went from P0 to P1 at an unknown instant of the interval T since the last report: with u = (T - instant)/T
           uniform, delta has moved by -c u^2 dP, s by -d u dP, c = wb T^2/4H, d = T/2H; means dP c/3 and dP d/2 (the
           same as of a ramp), covariance dP^2 [[4/45 c^2, cd/12], [cd/12, d^2/12]].
"""

from typing import NamedTuple

import numpy as np


class Tuning(NamedTuple):
    """What is assumed of the machines beyond the noise of the phasors."""

    walk: float = 0.05  # pu/s^0.5   of the mechanical power
    share: float = 0.05  # -          of the accelerating power that the model may be wrong by
    jerk: float = 0.05  # pu/s/s^0.5 of the acceleration, kinematic model
    open_speed: float = 0.01  # pu   standard deviation of the speed after re-opening
    open_power: float = 0.3  # pu   and of the mechanical power (of 2H times the acceleration)


class Model(NamedTuple):
    """Discrete model of every machine over one frame; x' = F x + B u, u = [P0, m dP, m^2 dP], m frames since P0."""

    F: np.ndarray  # (machines, 3, 3)
    B: np.ndarray  # (machines, 3, 3)
    walk: np.ndarray  # (machines, 3, 3)   covariance of the random walk
    push: np.ndarray  # (machines, 3, 3)   covariance per variance of a power held over the frame
    jump: np.ndarray  # (machines, 3, 3)   covariance per square of a jump at an unknown instant of one frame
    opened: np.ndarray  # (3, 3)   added on re-opening


def model(H: np.ndarray, D: np.ndarray, hz: float, T: float, walk: float, opened: tuple[float, float]) -> Model:
    """The swing model of machines (H in s, D in pu) over a frame of T seconds; exact but for D T/2H in B."""
    from scipy.linalg import expm

    wb, n = 2 * np.pi * hz, len(H)
    A, B = np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    A[:, 0, 1], A[:, 1, 1], A[:, 1, 2] = wb, -D / (2 * H), 1 / (2 * H)
    F = np.array([expm(a * T) for a in A])
    c, d = wb * T**2 / (4 * H), T / (2 * H)
    B[:, 0, 0], B[:, 0, 2], B[:, 1, 0], B[:, 1, 1] = -c, -c / 3, -d, -d / 2
    a, b, one = wb / (2 * H), 1 / (2 * H), np.ones(n)
    Q = _symmetric(
        [a * a * T**5 / 20, a * b * T**4 / 8, a * T**3 / 6, b * b * T**3 / 3, b * T**2 / 2, one * T],
    )
    push = _symmetric([c * c, c * d, 0 * c, d * d, 0 * c, 0 * c])
    jump = _symmetric([4 / 45 * c * c, c * d / 12, 0 * c, d * d / 12, 0 * c, 0 * c])
    return Model(F, B, walk**2 * Q, push, jump, np.diag([1.0, opened[0] ** 2, opened[1] ** 2]))


def process(model: Model, pushed: np.ndarray, jumped: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Process covariance (seeds, machines, 3, 3): variance held, size of the jump, frames since P was last known."""
    m = frames * 1.0
    reach = np.stack([jumped * m * m, jumped * m, 0 * m], -1)
    return model.walk + pushed[..., None, None] * model.push + reach[..., :, None] * reach[..., None, :] * model.jump


def angle_variance(V: np.ndarray, ZI: np.ndarray, E: np.ndarray, angle: float, magnitude: float) -> np.ndarray:
    """(R): variance (rad^2) of the angle of E = V + Z I; standard deviations of angle (rad) and magnitude (-)."""
    a, b = V / E, ZI / E
    return angle**2 * (a.real**2 + b.real**2) + magnitude**2 * (a.imag**2 + b.imag**2)


def power_variance(S: np.ndarray, angle: float, magnitude: float) -> np.ndarray:
    """(P): variance of the power Re S = Re(E conj I), in its units squared."""
    return 2 * magnitude**2 * S.real**2 + 2 * angle**2 * S.imag**2


def _symmetric(upper: list[np.ndarray]) -> np.ndarray:
    """(machines, 3, 3) from the upper triangle, row by row."""
    a, b, c, d, e, f = upper
    return np.stack([np.stack([a, b, c], -1), np.stack([b, d, e], -1), np.stack([c, e, f], -1)], -2)
