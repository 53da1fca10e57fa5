"""Speed relative to the center of inertia (COI) of the other machines, from estimates of different ages.

    w_i = s_i(own age) - sum_{j != i} H_j s_j(remote age) / sum_{j != i} H_j,   over the valid machines of its island

Every speed is extrapolated to the present with its acceleration, s + a t, t its age but at most `REACH`. A machine
without a report stays in both sums, with a growing variance. A speed that differs from most others by more than a swing
does counts as unknown.

Where the network was switched after the time stamp of an estimate, the acceleration has changed since then by an
unknown share of |P|/2H, and the speed by this times the time since the switching: the whole of it for the own estimate
and for machines without a PMU, `SHARED` of it for those of the others, which change together.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from .estimators import Estimate

REACH = 0.1  # s   longest extrapolation
COAST = 0.5  # s   time without a report after which the storage of a machine stays idle
ENOUGH = 0.7  # -   share of the island's inertia that must have reported by then, otherwise the storage stays idle
SHARED = 0.4  # -   of a change of a machine's acceleration that others make too, before it is reported
LIMIT = 3e-3  # pu   standard deviation of a deviation, beyond which it is not usable (180 mHz at 60 Hz)
PLAUSIBLE = 0.05  # pu   difference of a speed from most others, beyond which its filter has lost the rotor
LOST = 1.0  # pu^2   variance of such a speed
LEAST = 3e-4  # pu   standard deviation of the speeds of machines about that of the COI, at least


class Deviations(NamedTuple):
    """Machines relative to the COI of the others, arrays (seeds, machines)."""

    speed: np.ndarray  # pu
    acceleration: np.ndarray  # pu/s
    sigma: np.ndarray  # pu   standard deviation of the speed
    usable: (
        np.ndarray
    )  # bool   the own estimate is valid, those of enough of the island too, and sigma is below `LIMIT`
    own: Estimate  # as the machines know it, with slips and their variance extrapolated to the present
    remote: Estimate  # as others know it, the same


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

    def step(
        self, now: Estimate, island: np.ndarray, without: np.ndarray | None = None, since: np.ndarray | None = None
    ) -> Deviations:
        """The deviations at the instant of the frame.

        Parameters
        ----------
        now : Estimate
            The estimates of this frame.
        island : (seeds, machines) array
            Numbers of islands, -1 for tripped machines.
        without : (seeds, machines) array of bool, optional
            Machines without a PMU: what they know of themselves comes from the others, and as late as that.
        since : (seeds, 1) array, optional
            Frames since the network was switched.
        """
        silent = np.zeros(now.slip.shape) if self._silent is None else self._silent
        self._silent = silent = np.where(now.received, 0.0, silent + self.T)
        if np.ptp(now.slip) > PLAUSIBLE:
            lost = (island >= 0) & (np.abs(now.slip - np.median(now.slip, axis=1, keepdims=True)) > PLAUSIBLE)
            now = now._replace(variance=np.where(lost, LOST, now.variance))
            silent = np.where(lost, np.maximum(silent, 2 * self.T), silent)
        whole, sure = island.max(initial=0) == 0 and island.min(initial=0) == 0, now.variance < LIMIT**2
        if (silent > 1.5 * self.T).any():
            now = self._together(now, silent, island)
        valid = silent <= COAST + 1e-9
        self._past.append((now, valid))
        remote, remote_valid = self._past[0]
        jumped = (now.acceleration - remote.acceleration) ** 2  # of a machine, which the others may have done too
        own, far = self._extrapolated(now, self.own), self._extrapolated(remote, self.remote)
        unseen, together = self._unseen(now, self.own, since), self._unseen(remote, self.remote, since) * SHARED
        (s, a, var), (rs, ra, rvar) = own[:3], far[:3]
        if without is not None and without.any():
            s, a, var = np.where(without, (rs, ra, rvar), (s, a, var))
            unseen = np.where(without, together / SHARED, unseen)
            together = np.where(without, unseen, together)
        H = self.H if whole else self.H * (island >= 0)
        shares = np.empty((6, *rs.shape))
        shares[0], shares[1], shares[2], shares[3] = H * remote_valid, H, H * rs, H * ra
        shares[4], shares[5] = H * H * rvar, H * together
        reporting, *sums = _others(shares, island, whole)
        weight = np.where(sums[0] > 0, sums[0], 1.0)
        usable = valid & (island >= 0) & (reporting > 0) & (reporting + self.H >= ENOUGH * (sums[0] + self.H))
        jumped *= (SHARED * min((self.remote - self.own) * self.T, REACH)) ** 2
        sigma = np.sqrt(var + unseen**2 + (sums[3] + sums[4] ** 2) / weight**2 + jumped)
        return Deviations(s - sums[1] / weight, a - sums[2] / weight, sigma, usable & sure & (sigma < LIMIT), own, far)

    def _together(self, e: Estimate, silent: np.ndarray, island: np.ndarray) -> Estimate:
        """A silent machine stays in synchronism: its speed is near that of the COI, as near as those of the others are.

        This prior and the estimate are weighted by their inverse variances.
        """
        H = self.H * (silent < self.T) * (island >= 0)
        total, first, second = (_others(w, island, False) for w in (H, H * e.slip, H * e.slip**2))
        weight = np.where(total > 0, total, 1.0)
        mean = first / weight
        spread = np.maximum(second / weight - mean**2, LEAST**2)
        gain = np.where((silent > 1.5 * self.T) & (total > 0), e.variance / (e.variance + spread), 0.0)
        slip = e.slip + gain * (mean - e.slip)
        return e._replace(slip=slip, acceleration=(1 - gain) * e.acceleration, variance=(1 - gain) * e.variance)

    def _extrapolated(self, e: Estimate, age: int) -> Estimate:
        """Slip and its variance `age` frames later."""
        t = min(age * self.T, REACH)
        return e._replace(slip=e.slip + t * e.acceleration, variance=e.variance + t * t * e.drift) if t else e

    def _unseen(self, e: Estimate, age: int, since: np.ndarray | None) -> np.ndarray:
        """Change of the speed if the power is lost with the switching, `since` (seeds, 1) frames ago, unseen so far."""
        if since is None or since.min() >= age:
            return np.zeros(e.slip.shape)
        return np.where(since < age, (since + 1) * self.T, 0.0) * e.whole + np.zeros(e.slip.shape)


def _others(weight: np.ndarray, island: np.ndarray, whole: bool) -> np.ndarray:
    """Sum (..., seeds, machines) of the weights of the other machines in every machine's island."""
    if whole:
        return weight.sum(-1, keepdims=True) - weight
    same = (island[:, :, None] == island[:, None, :]) & (island >= 0)[:, None, :]
    return (same @ weight[..., None])[..., 0] - weight
