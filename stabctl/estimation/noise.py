"""Propagation of the noise of the phasors to the measured angle, power and current of a machine.

V and I have independent errors of standard deviation sa (rad) in angle and sm (relative) in magnitude. An error of
E = V + Z I moves the measured rotor angle arg E - theta, sin theta = omega psi''q/|E|, by Im(dE/E) + t Re(dE/E),
t = tan theta. Its variance is

    R = sum over a = V/E, Z I/E of  sa^2 (Re a - t Im a)^2 + sm^2 (Im a + t Re a)^2,                (R)

and with V conj(I) = P + jQ (the losses in Re Z are neglected), and I exp(-j delta) = iq - j id,

    var P = 2 sm^2 P^2 + 2 sa^2 Q^2,   var iq = sm^2 iq^2 + sa^2 id^2.                              (P)
"""

from typing import NamedTuple

import numpy as np

from stabctl._util.jit import inline


class Tuning(NamedTuple):
    """Assumptions beyond the noise of the phasors."""

    walk: float = 0.005  # pu/s^0.5   of the power reference of a machine
    share: float = 0.01  # -          error of the model, as a share of the accelerating power
    jerk: float = 0.05  # pu/s/s^0.5 of the acceleration, kinematic model


TUNING = Tuning()


@inline
def angle_variance(V, ZI, E, turn, angle, magnitude):
    """(R): variance (rad^2) of arg E - turn; standard deviations of angle (rad) and magnitude (-)."""
    tilt = (1 + 1j * np.tan(turn)) / E  # Re a - t Im a and Im a + t Re a are the parts of a (1 + j t)
    v, i = V * tilt, ZI * tilt
    return angle**2 * (v.real**2 + i.real**2) + magnitude**2 * (v.imag**2 + i.imag**2)


def computed_angle_variance(
    V: np.ndarray, I: np.ndarray, Z: np.ndarray, tilt: np.ndarray, *, angle: float, magnitude: float
) -> np.ndarray:
    """(R) where E = V + Z I is a sum of reports, over all parts V, I (..., reports); tilt = (1 + j t)/E."""
    a = (V + Z[..., None] * I) * tilt[..., None]
    return angle**2 * (a.real**2).sum(-1) + magnitude**2 * (a.imag**2).sum(-1)


def computed_power_variance(
    V: np.ndarray, I: np.ndarray, phasors: tuple[np.ndarray, np.ndarray], *, angle: float, magnitude: float
) -> np.ndarray:
    """(P) where V and I, the phasors, are sums of reports with these parts (..., reports)."""
    S = V * phasors[1].conj()[..., None] + phasors[0].conj()[..., None] * I
    return magnitude**2 * (S.real**2).sum(-1) + angle**2 * (S.imag**2).sum(-1)


def computed_current_variance(I: np.ndarray, *, angle: float, magnitude: float) -> np.ndarray:
    """Variance of a part of a current that is a sum of reports (..., reports), whatever the frame."""
    return max(angle, magnitude) ** 2 * (np.abs(I) ** 2).sum(-1)


@inline
def power_variance(S, angle, magnitude):
    """(P): variance of the power at the terminals, S = V conj(I), in its units squared."""
    return 2 * magnitude**2 * S.real**2 + 2 * angle**2 * S.imag**2


@inline
def current_variance(I, angle, magnitude):
    """(P): variance of iq, the real part of a current in the frame of the rotor, in its units squared."""
    return magnitude**2 * I.real**2 + angle**2 * I.imag**2
