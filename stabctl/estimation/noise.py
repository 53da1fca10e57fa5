"""Covariances of measurement and process, derived from the noise of the phasors.

State of a machine: x = [delta (rad), s = omega - 1 (pu), Pm (pu machine), b (rad)]; input the air-gap power P:

    d delta/dt = wb s,   2H ds/dt = Pm - P - D s,   dPm/dt = white noise of density q,
    b -> r b + k (delta - its estimate) in a frame.
b is what the q-axis flux is not known to (`flux.py`); it is 0 in a classical machine.

Measurement: z = delta + b = arg E - asin(psi/|E|), E = V + Z I. An error of E moves z by Im(dE/E) + t Re(dE/E),
t = tan asin(psi/|E|), so that with errors of standard deviation sa (rad) and sm (relative) in V and I
    var z = sum over a = V/E, a = Z I/E of  sa^2 (Re a - t Im a)^2 + sm^2 (Im a + t Re a)^2,        (R)
and, with S = E conj(I) = P + jQ, from the power's own errors
    var P = 2 sm^2 P^2 + 2 sa^2 Q^2.                                                                (P)

Process over a frame T, three sources added:
    walk   q * integral of g g', g(t) = [wb t^2/4H, t/2H, 1];
    push   (var P + (share (Pm - P))^2) * g g', g = [c, d, 0, 0], c = wb T^2/4H, d = T/2H; share: the model's own error
    jump   P went from P0 to P1 at an unknown instant of the time T since the last report: u = (T - instant)/T being
           uniform, delta has moved by -c u^2 dP, s by -d u dP, b by f (u - 1/2), f the flux's answer to the current's
           own jump. Means -dP c/3 and -dP d/2 (the same as of a ramp), covariance r r' times that of (u^2, u, 0, u),
           r = [-c dP, -d dP, 0, f]: var u^2 = 4/45, var u = cov(u, u^2) = 1/12.
"""

from typing import NamedTuple

import numpy as np

TURNED_DOWN = 2  # reports in a row that the gate leaves out before it opens


class Tuning(NamedTuple):
    """What is assumed of the machines beyond the noise of the phasors."""

    walk: float = 0.05  # pu/s^0.5   of the mechanical power
    share: float = 0.05  # -          of the accelerating power that the model may be wrong by
    jerk: float = 0.05  # pu/s/s^0.5 of the acceleration, kinematic model


TUNING = Tuning()


class Model(NamedTuple):
    """Model of every machine over a frame: x' = F x + B u, u = [P0, m dP, m^2 dP, -k delta], m frames since P0."""

    F: np.ndarray  # (machines, 4, 4)   without k, which changes
    B: np.ndarray  # (machines, 4, 4)
    walk: np.ndarray  # (machines, 4, 4)   covariance of the random walk
    push: np.ndarray  # (machines, 4, 4)   covariance per variance of a power held over the frame
    c: np.ndarray  # (machines) rad/pu   what a unit of power does to the angle in a frame
    d: np.ndarray  # (machines)          and to the speed
    opened: np.ndarray  # (machines, 4, 4)   added on re-opening, per square of the innovation


JUMP = np.array([[4 / 45, 1 / 12, 0, 1 / 12], [1 / 12, 1 / 12, 0, 1 / 12], [0, 0, 0, 0], [1 / 12, 1 / 12, 0, 1 / 12]])


def model(H: np.ndarray, D: np.ndarray, hz: float, T: float, walk: float, memory: np.ndarray, swing: bool) -> Model:
    """The swing model of machines (H in s, D in pu) over a frame of T seconds; exact but for D T/2H in B.

    `memory` is r, 0 without flux. On re-opening an innovation y may come from an error of the angle, of the flux, or of
    the speed (and, where no power is measured, of the acceleration) within `TURNED_DOWN` + 1 frames: each gets as much
    variance as would explain y alone.
    """
    from scipy.linalg import expm

    wb, n = 2 * np.pi * hz, len(H)
    a, b, one, none = wb / (2 * H), 1 / (2 * H), np.ones(n), np.zeros(n)
    A, F, B = np.zeros((n, 3, 3)), np.zeros((n, 4, 4)), np.zeros((n, 4, 4))
    A[:, 0, 1], A[:, 1, 1], A[:, 1, 2] = wb, -D * b, b
    F[:, :3, :3], F[:, 3, 3] = np.array([expm(k * T) for k in A]), memory
    c, d = a * T**2 / 2, b * T
    B[:, 0, 0], B[:, 0, 2], B[:, 1, 0], B[:, 1, 1], B[:, 3, 3] = -c, -c / 3, -d, -d / 2, 1
    Q = _symmetric(a * a * T**5 / 20, a * b * T**4 / 8, a * T**3 / 6, b * b * T**3 / 3, b * T**2 / 2, one * T)
    since = (TURNED_DOWN + 1) * T
    alone = np.stack([one, one / (wb * since), 0 * one if swing else one / (a * since**2), one * (memory > 0)], -1)
    opened = alone[:, :, None] ** 2 * np.eye(4)
    return Model(F, B, walk**2 * Q, _symmetric(c * c, c * d, none, d * d, none, none), c, d, opened)


def process(model: Model, pushed: np.ndarray, jumped: np.ndarray, frames: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """Process covariance (seeds, machines, 4, 4): variance held, jump of P, frames since P was last known, f."""
    r = np.zeros((*turned.shape, 4))
    late = frames * jumped
    r[..., 0], r[..., 1], r[..., 3] = -model.c * late * frames, -model.d * late, turned
    Q = r[..., :, None] * r[..., None, :]
    Q *= JUMP
    Q += model.walk
    Q += pushed[..., None, None] * model.push
    return Q


def angle_variance(
    V: np.ndarray, ZI: np.ndarray, E: np.ndarray, turn: np.ndarray, angle: float, magnitude: float
) -> np.ndarray:
    """(R): variance (rad^2) of arg E - turn; standard deviations of angle (rad) and magnitude (-)."""
    tilt = (1 + 1j * np.tan(turn)) / E  # Re a - t Im a and Im a + t Re a are the parts of a (1 + j t)
    v, i = V * tilt, ZI * tilt
    return angle**2 * (v.real**2 + i.real**2) + magnitude**2 * (v.imag**2 + i.imag**2)


def power_variance(S: np.ndarray, angle: float, magnitude: float) -> np.ndarray:
    """(P): variance of the power Re S = Re(E conj I), in its units squared."""
    return 2 * magnitude**2 * S.real**2 + 2 * angle**2 * S.imag**2


def _symmetric(*upper: np.ndarray) -> np.ndarray:
    """(machines, 4, 4) from the upper triangle of its first three rows and columns, row by row."""
    out = np.zeros((len(upper[0]), 4, 4))
    for (i, j), values in zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)], upper, strict=True):
        out[:, i, j] = out[:, j, i] = values
    return out
