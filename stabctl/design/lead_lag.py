"""Phase compensation with lead-lag stages and a washout."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import control

MOST = np.deg2rad(60)  # phase of one stage
SHORTEST, LONGEST = 0.01, 10.0  # s   time constants of a fitted stage


def compensator(phase: float, w: float, washout: float, filter_s: float = 0.0) -> "control.TransferFunction":
    """Washout, filter, and equal lead-lag stages with a phase (rad) and unit magnitude at w (rad/s).

    K(s) = c sTw/(1+sTw) 1/(1+sTf) ((1+sT1)/(1+sT2))^n,  T1 = 1/(w sqrt(a)),  T2 = a T1,  a = (1-sin f)/(1+sin f),

    where f is the phase that washout and filter leave to each stage. Source: P. Kundur, Power System Stability and
    Control, 1994, section 12.5; J. Sadikovic, PhD thesis, ETH Zurich, 2006 (residue method).
    """
    import control

    s = control.tf("s")
    fixed = washout * s / (1 + washout * s) / (1 + filter_s * s)
    left = phase - float(np.angle(fixed(1j * w)))
    left = (left + np.pi) % (2 * np.pi) - np.pi
    sign = 1.0
    if abs(left) > np.pi / 2:  # a change of sign is half a turn
        sign, left = -1.0, left - np.sign(left) * np.pi
    stages = int(np.ceil(abs(left) / MOST - 1e-9))
    whole = sign * fixed
    if stages:
        a = (1 - np.sin(left / stages)) / (1 + np.sin(left / stages))
        T = 1 / (w * np.sqrt(a))
        for _ in range(stages):
            whole = whole * (1 + T * s) / (1 + a * T * s)
    return whole / abs(complex(whole(1j * w)))


def fitted(hz: np.ndarray, phase: np.ndarray, washout: float, filter_s: float = 0.0) -> "control.TransferFunction":
    """Washout, filter and equal lead-lag stages whose phase is as near as possible to a phase over a band.

    The stages and the filter have gain 1 at rest.

    Parameters
    ----------
    hz
        Frequencies, Hz.
    phase
        Phase wanted at each, rad.
    washout
        Time constant of the washout, s.
    filter_s
        Time constant of the noise filter 1/(1+sTf), s, whose lag is compensated too; 0: none.
    """
    import control
    from scipy.optimize import least_squares

    w = 2 * np.pi * hz
    left = phase - np.angle(1j * w * washout / (1 + 1j * w * washout)) + np.arctan(w * filter_s)
    stages = max(1, int(np.ceil(np.abs(left).max() / MOST - 1e-9)))

    def miss(logs: np.ndarray) -> np.ndarray:
        T1, T2 = np.exp(logs)
        return stages * (np.arctan(w * T1) - np.arctan(w * T2)) - left

    T1, T2 = np.exp(least_squares(miss, np.log([0.2, 0.05]), bounds=(np.log(SHORTEST), np.log(LONGEST))).x)
    s = control.tf("s")
    whole = washout * s / (1 + washout * s) / (1 + filter_s * s)
    for _ in range(stages):
        whole = whole * (1 + T1 * s) / (1 + T2 * s)
    return whole
