"""Effect of the window of a P or M class filter on the estimates, and its remaining uncertainty.

A report is the weighted mean of the phasors in a window. The swing equation is linear: its solution with the mean power
is the mean of angle and speed in the window, from which the values in its middle differ by

    -(v/2) d2delta/dt2   and   -(v/2) d2s/dt2 = (v/2) dP/dt / 2H,   v = variance of the window (s^2).

Both are taken into account. A jump of the power reaches the end of the window in parts, all at the same unknown
instant, so that its variance is not the sum of that of the parts but 1/sum of weights^2 times as much. Voltage and
current change together in the window, and rotors turn: the mean of a product is not the product of the means.

A current that jumps and decays may pass the window with hardly a change between two reports, while its jump is still
entering: the share of the window that comes next counts for as much as it could hold of the changes before.
"""

from collections import deque

import numpy as np

from .instrument import window

ANGLE, SLIP = 2.0, 2.0  # standard deviations of the values in the middle, in units of the differences above


class PmuWindow:
    """The window of the PMUs: `half` frames of length T to each side."""

    def __init__(self, half: int, T: float, hz: float) -> None:
        weights = window(half)
        self.wide, self._half, self.T, self.wb = half > 0, half, T, 2 * np.pi * hz
        self._width = max(half / 3, 1) * T
        self._variance = float(weights @ np.arange(-half, half + 1) ** 2) * T**2
        self._turns: deque[np.ndarray] = deque(maxlen=2 * half + 1)
        self._changes: deque[np.ndarray] = deque(maxlen=half + 1)
        self.together = 1 / float(weights @ weights)

    def turned(self, slip: np.ndarray) -> np.ndarray:
        """Root mean square of the turn (rad) of a rotor within the window."""
        return self.wb * np.sqrt(self._variance) * np.abs(slip)

    def flux_noise(self, slip: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Standard deviation (pu) of the current that drives the fluxes, from the turn of the rotor in the window."""
        self._turns.append(np.abs(change))
        return self.turned(slip) * np.max(self._turns, 0)

    def entering(self, change: np.ndarray) -> np.ndarray:
        """Change (pu) of a part of the current, at least as much as may be entering with the last jump.

        Weights fall as half + 1, half, ... 1 from the middle of the window: with the largest one k frames ago, the
        share that enters now is 1/(k + 1) of it.
        """
        self._changes.appendleft(np.abs(change))
        most = np.max([size / (k + 1) for k, size in enumerate(self._changes)], 0)
        return np.where(change < 0, -most, most)

    def power_noise(self, voltage: np.ndarray, current: np.ndarray) -> np.ndarray:
        """Variance of the mean power where voltage and current change by so much over a frame.

        If a share a of a jump is within the window, the product of the means lacks a (1 - a), 1/6 on average.
        """
        return self.together**3 / 6 * np.abs(voltage * current) ** 2

    def middle(
        self, y: np.ndarray, P: np.ndarray, *, acceleration: np.ndarray, jerk: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Angle and speed (seeds, machines, 2) in the middle of the window, and their covariance.

        Parameters
        ----------
        y, P : (seeds, machines, 2) and (seeds, machines, 2, 2) array
            Mean angle and speed, and their covariance.
        acceleration, jerk : (seeds, machines) array, pu/s and pu/s^2
            Of the mean speed.
        """
        half, y, P = self._variance / 2, y.copy(), P.copy()
        y[..., 0] -= half * self.wb * acceleration
        y[..., 1] -= half * jerk
        P[..., 0, 0] += (ANGLE * half * self.wb * self._width * jerk) ** 2
        P[..., 1, 1] += (SLIP * half * jerk) ** 2
        return y, P
