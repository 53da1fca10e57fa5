"""Uncertainty of a machine while it sends no reports."""

import numpy as np


class MissingReports:
    """Standard deviations of power and speed of machines without reports, from the changes at those that report.

    The power of a machine without reports is assumed to change as much as the root mean square of the changes at the
    others since its last report, and its speed by the integral of this.

    Parameters
    ----------
    P : (seeds, machines) array, pu machine
        Powers at the start.
    per_frame : (machines,) array
        Change of the speed per unit of power in a frame.
    """

    def __init__(self, P: np.ndarray, per_frame: np.ndarray) -> None:
        self._before, self._per_frame = np.repeat(P[:, None, :], P.shape[1], 1), per_frame
        self.power, self.slip = np.zeros((2, *P.shape))

    def step(
        self, here: np.ndarray, missing: np.ndarray, *, before: np.ndarray, now: np.ndarray, variance: np.ndarray
    ) -> None:
        """Advance a frame.

        Parameters
        ----------
        here : (seeds, machines) array of bool
            Machines with a report.
        missing : (seeds, machines) array
            Frames without a report up to the last one.
        before, now, variance : (seeds, machines) array
            Powers as last reported and in this frame, and their variance.
        """
        if here.all() and not missing.any():
            return
        first = ~here & (missing == 0)
        self._before = np.where(first[..., None], before[:, None, :], self._before)
        moved = ((now[:, None, :] - self._before) ** 2 - 2 * variance[:, None, :]) * here[:, None, :]
        mean = moved.sum(-1) / np.maximum(here.sum(-1, keepdims=True), 1)
        self.power = np.where(here, 0.0, np.sqrt(np.maximum(mean, 0.0)))
        self.slip = np.where(here, 0.0, self.slip + self._per_frame * self.power)
