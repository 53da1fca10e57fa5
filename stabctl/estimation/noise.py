"""Covariances of measurement and process noise, derived from the noise of the phasors.

State of a machine: x = [delta (rad), s = omega - 1 (pu), Pm (pu machine), b (rad)]; input is the air-gap power P:

    d delta/dt = wb s,   2H ds/dt = Pm - P - D s,   dPm/dt = white noise of density q,
    b -> r b + k (delta - its estimate) per frame.
b is the error of the rotor angle due to the unknown part of the q-axis flux (`flux.py`); 0 for a classical machine.

Measurement: z = delta + b = arg E - asin(psi/|E|), E = V + Z I. An error of E moves z by Im(dE/E) + t Re(dE/E),
t = tan asin(psi/|E|). With errors of standard deviation sa (rad) and sm (relative) in V and I,
    var z = sum over a = V/E, a = Z I/E of  sa^2 (Re a - t Im a)^2 + sm^2 (Im a + t Re a)^2,        (R)
and with S = E conj(I) = P + jQ the variance of the measured power is
    var P = 2 sm^2 P^2 + 2 sa^2 Q^2.                                                                (P)

Process noise over a frame T has three sources:
    walk   q * integral of g g', g(t) = [wb t^2/4H, t/2H, 1];
    power  (var P + (share (Pm - P))^2) * g g', g = [c, d, 0, 0], c = wb T^2/4H, d = T/2H; share is the model error;
    jump   P jumped from P0 to P1 at an unknown instant since the last report. u = (T - instant)/T is uniform, delta has
           moved by -c u^2 dP, s by -d u dP, and b by f (u - 1/2), f the flux's response to the jump of the current.
           Means -dP c/3 and -dP d/2 (the same as of a ramp), covariance r r' times that of (u^2, u, 0, u),
           r = [-c dP, -d dP, 0, f]: var u^2 = 4/45, var u = cov(u, u^2) = 1/12.
"""

from typing import NamedTuple

import numpy as np

REJECTED = 2  # reports in a row that the gate rejects before it accepts one


class Tuning(NamedTuple):
    """Assumptions beyond the noise of the phasors."""

    walk: float = 0.05  # pu/s^0.5   of the mechanical power
    share: float = 0.05  # -          error of the model, as a share of the accelerating power
    jerk: float = 0.05  # pu/s/s^0.5 of the acceleration, kinematic model


TUNING = Tuning()


class SwingModel(NamedTuple):
    """The swing equation over a frame: x' = F x + B u, u = [P0, m dP, m^2 dP, -k delta], m frames since P0."""

    F: np.ndarray  # (machines, 4, 4)   without k, which changes
    B: np.ndarray  # (machines, 4, 4)
    walk: np.ndarray  # (machines, 4, 4)   covariance of the random walk
    power: np.ndarray  # (machines, 4, 4)   covariance per variance of a power held over the frame
    c: np.ndarray  # (machines) rad/pu   change of the angle per unit of power in a frame
    d: np.ndarray  # (machines)          change of the speed
    reset: np.ndarray  # (machines, 4, 4)   added per square of the innovation that the gate accepts at last


JUMP = np.array([[4 / 45, 1 / 12, 0, 1 / 12], [1 / 12, 1 / 12, 0, 1 / 12], [0, 0, 0, 0], [1 / 12, 1 / 12, 0, 1 / 12]])


def swing_model(
    H: np.ndarray, D: np.ndarray, memory: np.ndarray, *, hz: float, T: float, walk: float, with_power: bool = True
) -> SwingModel:
    """The swing equation over a frame; exact except for D T/2H in B.

    When the gate accepts an innovation y after `REJECTED` rejections, y may come from an error of the angle, of the
    flux, or of the speed (without measured power, of the acceleration): each gets the variance that explains y alone.

    Parameters
    ----------
    H, D : (machines,) array, s and pu
        Inertia constant and damping.
    memory : (machines,) array
        r above, 0 without flux dynamics.
    hz, T : float
        Frequency (Hz) and length of a frame (s).
    walk : float
        Density of the random walk, pu/s^0.5.
    with_power : bool
        The measured power is an input; without it the model is that of a constant acceleration.
    """
    from scipy.linalg import expm

    wb, n = 2 * np.pi * hz, len(H)
    a, b, one, none = wb / (2 * H), 1 / (2 * H), np.ones(n), np.zeros(n)
    A, F, B = np.zeros((n, 3, 3)), np.zeros((n, 4, 4)), np.zeros((n, 4, 4))
    A[:, 0, 1], A[:, 1, 1], A[:, 1, 2] = wb, -D * b, b
    F[:, :3, :3], F[:, 3, 3] = expm(A * T), memory
    c, d = a * T**2 / 2, b * T
    B[:, 0, 0], B[:, 0, 2], B[:, 1, 0], B[:, 1, 1], B[:, 3, 3] = -c, -c / 3, -d, -d / 2, 1
    Q = _symmetric(a * a * T**5 / 20, a * b * T**4 / 8, a * T**3 / 6, b * b * T**3 / 3, b * T**2 / 2, one * T)
    since = (REJECTED + 1) * T
    acceleration = 0 * one if with_power else one / (a * since**2)
    alone = np.stack([one, one / (wb * since), acceleration, one * (memory > 0)], -1)
    reset = alone[:, :, None] ** 2 * np.eye(4)
    return SwingModel(F, B, walk**2 * Q, _symmetric(c * c, c * d, none, d * d, none, none), c, d, reset)


def process_covariance(
    model: SwingModel, *, power: np.ndarray, jump: np.ndarray, frames: np.ndarray, flux: np.ndarray
) -> np.ndarray:
    """Process covariance (seeds, machines, 4, 4).

    Parameters
    ----------
    model : SwingModel
        The model.
    power : (seeds, machines) array
        Variance of the power held over the frame.
    jump, frames : (seeds, machines) array
        Jump of the power, and frames since it was last known.
    flux : (seeds, machines) array, rad
        f above.
    """
    r = np.zeros((*flux.shape, 4))
    late = frames * jump
    r[..., 0], r[..., 1], r[..., 3] = -model.c * late * frames, -model.d * late, flux
    Q = r[..., :, None] * r[..., None, :]
    Q *= JUMP
    Q += model.walk
    Q += power[..., None, None] * model.power
    return Q


def angle_variance(
    V: np.ndarray, ZI: np.ndarray, E: np.ndarray, turn: np.ndarray, *, angle: float, magnitude: float
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
    for i, j, values in zip(*np.triu_indices(3), upper, strict=True):
        out[:, i, j] = out[:, j, i] = values
    return out
