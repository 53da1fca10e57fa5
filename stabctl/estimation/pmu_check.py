"""Finds bad PMUs: compares the angle of every voltage with what the network model says of it from all other reports.

    r = arg(V / V'),   V' from the reports of the others (`network_model`),   C = covariance of r

A turn of the phasors of PMU i by an angle phi adds g_i phi to r. The best estimate of phi, over its standard deviation,

    N_i = g_i' C^-1 r / sqrt(g_i' C^-1 g_i),

is normal with variance 1 if all PMUs are good; the same of the mean of r, exponential over `WINDOW`, with the constant
offsets of the clocks in C. The network model is exact through faults and swings, so that this holds whatever the
machines do. The PMU with the largest N beyond `LIMIT` is bad (the largest normalized residual of state estimation), if
it stands out (`CLEAR`), and so is one that repeats the same phasor.
"""

from typing import NamedTuple

import numpy as np

from stabctl.model.network import Switching

from .instrument import Frame
from .network_model import NetworkModel
from .pmu import Pmu

WINDOW = 0.5  # s   of the mean
LIMIT = 6.0  # standard deviations
CLEAR = 16.0  # difference of N^2 between the worst and the second, below which it is not yet clear which is bad
SAME = 3  # equal reports in a row


class Alarm(NamedTuple):
    """A PMU found to be bad."""

    seed: int
    machine: int
    time_s: float
    why: str

    def __str__(self) -> str:
        return (
            f"seed {self.seed}: the PMU of machine {self.machine} is left out from {self.time_s:.3f} s on; {self.why}"
        )


class PmuCheck:
    """The check of all PMUs; arrays (seeds, machines)."""

    def __init__(self, network: NetworkModel, pmu: Pmu, frequency_hz: float, shape: tuple[int, int]) -> None:
        self.network, self._noise = network, max(pmu.angle, pmu.magnitude)
        self._clock = 2 * np.pi * frequency_hz * pmu.clock
        self._share = 1 - np.exp(-1 / (WINDOW * pmu.rate))
        self._mean, self._weight, self._same = np.zeros(shape), np.zeros(shape[0]), np.zeros(shape, int)
        self._last: np.ndarray | None = None

    def __call__(
        self, frame: Frame, others: np.ndarray, switching: list[Switching], used: np.ndarray
    ) -> list[tuple[int, int, str]]:
        """Seeds and rows of the machines whose PMUs are found bad with this frame, and why.

        Parameters
        ----------
        frame : Frame
            The reports.
        others : (seeds, others) array, pu
            Reported currents of storage devices and loads.
        switching : list of Switching
            What is open, faulted and tripped, for each seed.
        used : (seeds, machines) array of bool
            Machines whose reports are used.
        """
        known, found = frame.received & used, []
        before = np.full(frame.V.shape, np.nan) if self._last is None else self._last
        self._same = np.where(known, np.where(before == frame.V, self._same + 1, 0), self._same)
        self._last = np.where(known, frame.V, before)
        for k, now in enumerate(switching):
            stuck = np.flatnonzero((self._same[k] >= SAME) & (self._noise > 0))
            if stuck.size:
                found += [(k, int(row), "it repeats the same phasors") for row in stuck]
                self._same[k, stuck], self._mean[k], self._weight[k] = 0, 0, 0
                continue
            fresh = known[k] & (self._same[k] == 0)
            worst = self._residuals(k, frame, others[k], switching=now, known=fresh, complete=(fresh == used[k]).all())
            if worst is not None:
                found.append(worst)
        return found

    def _residuals(
        self, k: int, frame: Frame, others: np.ndarray, *, switching: Switching, known: np.ndarray, complete: bool
    ) -> tuple[int, int, str] | None:
        at, L = self.network.each_from_the_rest(switching, known)
        if not len(at):
            return None
        V, I = frame.V[k], frame.I[k]
        reports, n = np.concatenate([V, I, others]), len(V)
        parts = L * reports / V[at, None]
        r = -np.angle(parts.sum(-1))
        errors = np.eye(2 * n + len(others))[at] - parts
        white = self._noise**2 * (errors @ errors.conj().T).real
        turns = (errors[:, at] + errors[:, n + at]).real  # g_i in columns
        clock = self._clock**2 * turns @ turns.T
        N = normalized(r, white + clock, turns)
        largest, angle = np.abs(N), r
        if complete:  # means of all over the same frames, so that their covariance is that of r
            a = self._share
            self._mean[k, at] += a * (r - self._mean[k, at])
            self._weight[k] += a * (1 - self._weight[k])
            weight = self._weight[k]
            frames = weight**2 * (2 - a) / (a * (1 - (1 - weight) ** 2))  # (sum of weights)^2 over that of squares
            mean = self._mean[k, at] / weight
            of_mean = np.abs(normalized(mean, white / frames + clock, turns))
            angle = np.where(of_mean > largest, mean, r)
            largest = np.maximum(largest, of_mean)
        row = int(np.argmax(largest))
        second = np.partition(largest, -2)[-2] if len(largest) > 1 else 0.0
        if largest[row] <= LIMIT or largest[row] ** 2 - second**2 < CLEAR:
            return None
        self._mean[k], self._weight[k] = 0, 0
        turned = np.rad2deg(angle[row])
        return k, int(at[row]), f"its voltage is {turned:.2f} degrees from what the others say"


def normalized(r: np.ndarray, C: np.ndarray, g: np.ndarray) -> np.ndarray:
    """N of every column of g."""
    weighted = np.linalg.solve(C + 1e-12 * np.eye(len(C)), g)
    return weighted.T @ r / np.sqrt((g * weighted).sum(0))
