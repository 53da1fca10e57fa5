"""Speed against the center of inertia of the rest, from estimates of different ages.

    w_i = s_i(own age) - sum_{j != i} H_j s_j(remote age) / sum_{j != i} H_j,   over the valid machines of its island

Every speed is carried to the present with its acceleration, s + a t, t its age but at most `REACH`. A machine without a
report coasts for `COAST` and then leaves both sums.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from .estimators import Estimate

REACH = 0.1  # s   longest prediction
COAST = 0.5  # s   without a report until a machine is left out
ENOUGH = 0.7  # -   share of the island's inertia that must be valid, or the storage is off


class Deviation(NamedTuple):
    """Machines against the rest, arrays (seeds, machines)."""

    speed: np.ndarray  # pu
    acceleration: np.ndarray  # pu/s
    sigma: np.ndarray  # pu   standard deviation of the speed
    usable: np.ndarray  # bool   own estimate valid, and enough of the island


class Center:
    """Keeps the estimates that are on their way; H (machines) in s on one base, ages in frames."""

    def __init__(self, inertia: np.ndarray, rate: int, own: int, remote: int) -> None:
        self.H, self.T, self.own, self.remote = inertia, 1 / rate, own, remote
        self._past: deque[tuple[Estimate, np.ndarray]] = deque(maxlen=remote - own + 1)
        self._silent: np.ndarray | None = None

    def step(self, now: Estimate, island: np.ndarray) -> Deviation:
        """The deviations at the instant of the frame; islands (seeds, machines) by number, -1 where off."""
        silent = np.zeros(now.slip.shape) if self._silent is None else self._silent
        self._silent = np.where(now.received, 0.0, silent + self.T)
        valid = self._silent <= COAST + 1e-9
        self._past.append((now, valid))
        there, heard = self._past[0]
        s, a, var = _carried(now, self.own * self.T)
        rs, ra, rvar = _carried(there, self.remote * self.T)
        whole = island.max(initial=0) == 0 and island.min(initial=0) == 0
        H = self.H * heard if whole else self.H * heard * (island >= 0)
        sums = [_rest(w, island, whole) for w in (H, H * rs, H * ra, H * H * rvar)]
        everyone = self.H.sum() if whole else self.H + _rest(self.H * (island >= 0), island, whole)
        weight = np.where(sums[0] > 0, sums[0], 1.0)
        usable = valid & (island >= 0) & (sums[0] > 0) & (sums[0] + self.H >= ENOUGH * everyone)
        sigma = np.sqrt(var + sums[3] / weight**2)
        return Deviation(s - sums[1] / weight, a - sums[2] / weight, sigma, usable)


def _carried(e: Estimate, age: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slip, acceleration and variance of the slip, `age` seconds later."""
    t = min(age, REACH)
    return (e.slip + t * e.acceleration if t else e.slip), e.acceleration, e.variance + t * t * e.drift


def _rest(weight: np.ndarray, island: np.ndarray, whole: bool) -> np.ndarray:
    """Sum (seeds, machines) of the weights of every machine's island without its own."""
    if whole:
        return weight.sum(-1, keepdims=True) - weight
    same = (island[:, :, None] == island[:, None, :]) & (island >= 0)[:, None, :]
    return (same @ weight[..., None])[..., 0] - weight
