"""Describing functions of what acts on the outputs of a controller: deadband, limits, relay.

For the input A sin(wt), N(A) is the fundamental of the output over A. With the limiter of slope 1 and limit d,

    S(d, A) = 2/pi (asin(d/A) + d/A sqrt(1 - (d/A)^2)) for A > d, 1 below,

they are N = S(d + M, A) - S(d, A) for a deadband d with limits +-M, and N = 4 M/(pi A) sqrt(1 - (d/A)^2) for a relay
with the levels -M, 0, M that switches at +-d.

Source: A. Gelb, W. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968, chapter 2.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from stabctl.dynamics.named import Named
from stabctl.errors import StudyError

DEEP = 1e-10  # least distance of an amplitude above the deadband, relative to it
REACH = 1e5  # largest amplitude, relative to the deadband and limit together
POINTS = 1500


@dataclass(frozen=True)
class Nonlinearity:
    """Deadband and limits, or a relay, in the unit of the output."""

    deadband: float
    limit: float  # inf: none
    relay: bool

    @property
    def gentle(self) -> bool:
        """Whether it acts linearly whatever the amplitude."""
        return not self.relay and not self.deadband and np.isinf(self.limit)

    def gain(self, A: np.ndarray | float) -> np.ndarray:
        """N(A) for amplitudes A of its input."""
        A, d, M = np.asarray(A, float), self.deadband, self.limit
        if self.relay:
            return 4 * M / (np.pi * A) * np.sqrt(np.maximum(1 - (d / A) ** 2, 0.0))
        whole = np.ones_like(A) if np.isinf(M) else _limiter(d + M, A)
        return whole - _limiter(d, A)

    def slope(self, A: float) -> float:
        """Sign of dN/dA at an amplitude."""
        d, M = self.deadband, self.limit
        if self.relay:
            return float(np.sign(2 * d**2 - A**2))
        fall = 0.0 if np.isinf(M) or d + M >= A else (d + M) * np.sqrt(1 - ((d + M) / A) ** 2)
        rise = 0.0 if d >= A else d * np.sqrt(1 - (d / A) ** 2)
        return float(np.sign(rise - fall))

    def output(self, u: np.ndarray) -> np.ndarray:
        """What it gives for an input."""
        d, M = self.deadband, self.limit
        if self.relay:
            return M * np.sign(u) * (np.abs(u) > d)
        return np.clip(u - np.clip(u, -d, d), -M, M)

    def third(self, A: float) -> float:
        """Third harmonic of the output over its fundamental, for the amplitude A of the input."""
        harmonics = np.abs(np.fft.rfft(self.output(A * np.sin(2 * np.pi * (np.arange(4096) + 0.5) / 4096))))
        return float(harmonics[3] / harmonics[1])

    def grid(self) -> np.ndarray:
        """Amplitudes from the smallest with an effect to far beyond the limits, dense above the deadband."""
        d, M = self.deadband, self.limit
        size = d + (M if np.isfinite(M) else 0.0)
        if not d:
            return size * np.geomspace(1e-8 if self.relay else 1.0, REACH, POINTS)
        return d * (1 + np.geomspace(DEEP, REACH * size / d, POINTS))

    def amplitudes(self, gain: float) -> list[float]:
        """Amplitudes at which N(A) is a gain: none, one, or two if N rises and falls."""
        A = self.grid()
        over = self.gain(A) - gain
        return [
            float(brentq(lambda a: float(self.gain(a)) - gain, A[k], A[k + 1], xtol=1e-300, rtol=1e-12))
            for k in np.flatnonzero(over[:-1] * over[1:] < 0)
        ]


def _limiter(d: float, A: np.ndarray) -> np.ndarray:
    """S(d, A) above."""
    r = np.minimum(d / A, 1.0)
    return 2 / np.pi * (np.arcsin(r) + r * np.sqrt(1 - r**2))


LINEAR = Nonlinearity(0.0, np.inf, relay=False)


def nonlinearity(c: Named) -> Nonlinearity:
    """What acts on the outputs of a controller. Raises `StudyError` if it has no describing function of one input."""
    what, (low, high) = c.controller, c.limits
    if what.ramp:
        raise StudyError(
            f"{what.name} has a ramp limit, for which there is no describing function here; simulate it, or set ramp "
            "to 0."
        )
    if -low != high and not (np.isinf(low) and np.isinf(high)):
        raise StudyError(
            f"{what.name} has the limits {low:g} and {high:g}; limit cycles are found for limits that are equal in "
            "both directions, such as 0.1."
        )
    return Nonlinearity(what.deadband, high, what.relay)
