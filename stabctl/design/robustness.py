"""Robustness of a state or output feedback: guaranteed margins of a loop with several inputs.

With the return difference 1 + L at the inputs of the plant and T = L (1 + L)^-1, the loop stays stable with

    gains from 1/(1 + a) to 1/(1 - a),   a = least singular value of 1 + L(jw), at most 1,
    delays t with |exp(-jwt) - 1| s(T(jw)) < 1 at all w,   s the largest singular value,

also with different gains, or delays up to t, in every input. A regulator on all states with equal efforts has a = 1.
Source: N. Lehtomaki, N. Sandell, M. Athans, Robustness results in linear-quadratic Gaussian based multivariable control
designs, IEEE Trans. Automatic Control 26, 1981.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stabctl.smallsignal.modes import Modes

HZ = (0.01, 100.0)
POINTS = 300
ROUND = 1e-3  # below 1 by which the return difference of an optimal loop may fall by rounding


@dataclass(frozen=True)
class Robustness:
    """Margins of a loop; gains and delays may differ from input to input.

    Attributes
    ----------
    damping
        Smallest damping ratio of 0.1 to 3 Hz.
    gain_down, gain_up
        Factors of the gains that the loop withstands; inf if any.
    delay_s
        Delay that the loop withstands, s.
    """

    damping: float
    gain_down: float
    gain_up: float
    delay_s: float

    def __str__(self) -> str:
        up = "any" if np.isinf(self.gain_up) else f"{self.gain_up:.3g}"
        return (
            f"damping ratio {self.damping:.4f}, gain margin {self.gain_down:.3g} to {up}, delay margin "
            f"{1e3 * self.delay_s:.3g} ms"
        )


def robustness(loop: Callable[[float], np.ndarray], damping: float, fastest: float = HZ[1]) -> Robustness:
    """Margins of a stable loop.

    Parameters
    ----------
    loop : callable
        The loop gain L (inputs, inputs), with the sign of a negative feedback, at a frequency in rad/s.
    damping : float
        Smallest damping ratio of the loop.
    fastest : float, Hz
        Highest frequency; half of the rate of a sampled loop.
    """
    least, delay = 1.0, np.inf
    for hz in np.geomspace(HZ[0], fastest, POINTS):
        w = 2 * np.pi * hz
        L = loop(w)
        back = np.eye(len(L)) + L
        least = min(least, float(np.linalg.svd(back, compute_uv=False)[-1]))
        size = float(np.linalg.norm(L @ np.linalg.inv(back), 2))
        if size > 0.5:
            delay = min(delay, 2 * np.arcsin(1 / (2 * size)) / w)
    up = np.inf if least > 1 - ROUND else 1 / (1 - least)
    return Robustness(damping, 1 / (1 + least), up, delay)


def plant(modes: Modes, C: np.ndarray, D: np.ndarray, rate: int | None = None) -> Callable[[float], np.ndarray]:
    """Response (signals, inputs) of y = C x + D u at a frequency in rad/s.

    Parameters
    ----------
    modes : Modes
        All modes of the plant, whose inputs are u.
    C, D : (signals, states) and (signals, inputs) arrays
        The outputs.
    rate : int, 1/s, optional
        Frames per second at which u is held and y read, with the u before.
    """
    s = modes.eigenvalues
    moving = s != 0  # but for the rotation of all angles, which no feedback reads
    s = s[moving]
    left, right = (modes.left.conj().T @ modes.linear.B)[moving], (C @ modes.right)[:, moving]
    if rate is None:
        return lambda w: (right / (1j * w - s)) @ left + D
    step = np.exp(s / rate)
    left = left * ((step - 1) / s)[:, None]
    return lambda w: (right / (np.exp(1j * w / rate) - step)) @ left + D * np.exp(-1j * w / rate)
