"""Speed relative to the center of inertia (COI) of the other machines, from estimates of different ages.

    w_i = s_i(own age) - sum_{j != i} H_j s_j(remote age) / sum_{j != i} H_j,   over the valid machines of its island

Every speed is extrapolated to the present with its acceleration, s + a t, t its age but at most `REACH`. A machine
without a report is extrapolated for `COAST` and is then left out of both sums.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from .estimators import Estimate

REACH = 0.1  # s   longest extrapolation
COAST = 0.5  # s   time without a report after which a machine is left out
ENOUGH = 0.7  # -   share of the island's inertia that must be valid, otherwise the storage stays idle


class Deviations(NamedTuple):
    """Machines relative to the COI of the others, arrays (seeds, machines)."""

    speed: np.ndarray  # pu
    acceleration: np.ndarray  # pu/s
    sigma: np.ndarray  # pu   standard deviation of the speed
    usable: np.ndarray  # bool   the own estimate is valid, and those of enough of the island


class CoiReference:
    """The COI of the other machines, from estimates that arrive late.

    Parameters
    ----------
    inertia : (machines,) array, s
        H on one base.
    rate : int, 1/s
        Frames per second.
    own, remote : int, frames
        Ages of a machine's own estimate and of those of the others.
    """

    def __init__(self, inertia: np.ndarray, rate: int, own: int, remote: int) -> None:
        self.H, self.T, self.own, self.remote = inertia, 1 / rate, own, remote
        self._past: deque[tuple[Estimate, np.ndarray]] = deque(maxlen=remote - own + 1)
        self._silent: np.ndarray | None = None

    def step(self, now: Estimate, island: np.ndarray) -> Deviations:
        """The deviations at the instant of the frame; island numbers (seeds, machines), -1 for tripped machines."""
        silent = np.zeros(now.slip.shape) if self._silent is None else self._silent
        self._silent = np.where(now.received, 0.0, silent + self.T)
        valid = self._silent <= COAST + 1e-9
        self._past.append((now, valid))
        remote, remote_valid = self._past[0]
        s, a, var = _extrapolated(now, self.own * self.T)
        rs, ra, rvar = _extrapolated(remote, self.remote * self.T)
        whole = island.max(initial=0) == 0 and island.min(initial=0) == 0
        H = self.H * remote_valid if whole else self.H * remote_valid * (island >= 0)
        sums = [_others(w, island, whole) for w in (H, H * rs, H * ra, H * H * rvar)]
        everyone = self.H.sum() if whole else self.H + _others(self.H * (island >= 0), island, whole)
        weight = np.where(sums[0] > 0, sums[0], 1.0)
        usable = valid & (island >= 0) & (sums[0] > 0) & (sums[0] + self.H >= ENOUGH * everyone)
        sigma = np.sqrt(var + sums[3] / weight**2)
        return Deviations(s - sums[1] / weight, a - sums[2] / weight, sigma, usable)


def _extrapolated(e: Estimate, age: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slip, acceleration and variance of the slip, `age` seconds later."""
    t = min(age, REACH)
    return (e.slip + t * e.acceleration if t else e.slip), e.acceleration, e.variance + t * t * e.drift


def _others(weight: np.ndarray, island: np.ndarray, whole: bool) -> np.ndarray:
    """Sum (seeds, machines) of the weights of the other machines in every machine's island."""
    if whole:
        return weight.sum(-1, keepdims=True) - weight
    same = (island[:, :, None] == island[:, None, :]) & (island >= 0)[:, None, :]
    return (same @ weight[..., None])[..., 0] - weight
