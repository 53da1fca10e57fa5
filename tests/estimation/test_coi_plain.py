"""The COI of the others from estimates that arrive late, beside the same said machine by machine, with everything."""

import numpy as np
import pytest

from stabctl.estimation._signals import COAST, ENOUGH, LEAST, LIMIT, REACH, SHARED, CoiReference
from stabctl.estimation.estimators import Estimate

RATE, SEEDS = 50, 2
T, H = 1 / RATE, np.array([3.0, 2.0, 5.5, 11.0, 0.7])
N = len(H)
ISLANDS = [(0, 0, 0, 0, 0), (0, 0, 1, 1, 1), (0, -1, 0, 0, 0), (0, 1, 0, -1, 0)]


def later(e, k, i, age):
    """Slip, acceleration and variance of a machine when its estimate is that old."""
    seconds = age * T
    slip = e.slip[k, i] + min(seconds, REACH) * e.acceleration[k, i]
    return slip, e.acceleration[k, i], e.variance[k, i] + seconds**2 * e.drift[k, i]


def unseen(e, k, i, age, since):
    return (since[k, 0] + 1) * T * e.whole[k, i] if since[k, 0] < age else 0.0


class Plain:
    def __init__(self, own, remote):
        self.ages, self.past, self.silent = (own, remote), [], np.zeros((SEEDS, N))

    def together(self, e, island):
        """A silent machine is near the others that report, as near as they are to each other."""
        new = [x.copy() for x in (e.slip, e.acceleration, e.variance)]
        for k in range(SEEDS):
            for i in range(N):
                others = [j for j in range(N) if j != i and island[k, j] == island[k, i] >= 0 and not self.silent[k, j]]
                if self.silent[k, i] <= 1.5 * T or not others:
                    continue
                h, s = H[others], e.slip[k, others]
                mean = h @ s / h.sum()
                gain = e.variance[k, i] / (e.variance[k, i] + max(h @ (s - mean) ** 2 / h.sum(), LEAST**2))
                new[0][k, i] += gain * (mean - new[0][k, i])
                new[1][k, i] *= 1 - gain
                new[2][k, i] *= 1 - gain
        return e._replace(slip=new[0], acceleration=new[1], variance=new[2])

    def step(self, now, island, without, since):
        self.silent = np.where(now.received, 0.0, self.silent + T)
        sure, valid = now.variance < LIMIT**2, self.silent <= COAST + 1e-9
        now = self.together(now, island)
        own, remote = self.ages
        self.past = [*self.past, (now, valid)][-(remote - own + 1) :]
        far, reported = self.past[0]
        short, late = (max(age * T - REACH, 0.0) for age in self.ages)
        for k in range(SEEDS):
            for i in range(N):
                s, a, variance = later(far, k, i, remote) if without[k, i] else later(now, k, i, own)
                left = (late if without[k, i] else short) * a
                error = unseen(far, k, i, remote, since) if without[k, i] else unseen(now, k, i, own, since)
                jump = max((e.acceleration[k, i] - far.acceleration[k, i]) ** 2 for e, _ in self.past)
                here = island[k, i] >= 0
                others = [j for j in range(N) if j != i and here and island[k, j] == island[k, i]]
                of_others = np.array([later(far, k, j, remote) for j in others]).reshape(-1, 3).T
                moved = [unseen(far, k, j, remote, since) * (1.0 if without[k, j] else SHARED) for j in others]
                h, total = H[others], H[others].sum()
                weight = total or 1.0
                left -= late * (h @ of_others[1]) / weight
                jump *= (SHARED * (remote - own) * T) ** 2
                of_sum = (h**2 @ of_others[2] + (h @ np.array(moved)) ** 2) / weight**2
                sigma = (variance + error**2 + left**2 + of_sum + jump) ** 0.5
                speed = s - h @ of_others[0] / weight if others else 0.0
                reporting = h @ reported[k, others]
                usable = valid[k, i] and here and reporting > 0 and sure[k, i]
                usable &= reporting + H[i] >= ENOUGH * (total + H[i]) and sigma < max(LIMIT, abs(speed))
                yield (k, i), (speed, a - h @ of_others[1] / weight if others else 0.0, sigma, bool(usable))


@pytest.mark.parametrize(("own", "remote"), [(0, 0), (0, 3), (1, 3), (2, 8), (6, 9)])
@pytest.mark.parametrize("seed", range(2))
def test_everything_that_is_uncertain_takes_part(own, remote, seed):
    rng = np.random.default_rng(seed)
    coi, plain = CoiReference(H, RATE, own, remote), Plain(own, remote)
    used, shape = [], (SEEDS, N)
    for frame in range(60):
        now = Estimate(
            rng.normal(0, 4e-3, shape), rng.normal(0, 0.01, shape), rng.uniform(0, 1e-7, shape),
            rng.uniform(0, 1e-5, shape), rng.random(shape) < (0.97 if frame % 20 < 14 else 0.3),
            np.zeros(shape), None, rng.uniform(0, 0.01, shape),
        )  # fmt: skip
        island = np.array([ISLANDS[rng.integers(len(ISLANDS))] for _ in range(SEEDS)])
        without, since = rng.random(shape) < 0.2, rng.integers(0, 12, (SEEDS, 1))
        found = coi.step(now, island, without, since)
        for (k, i), wanted in plain.step(now, island, without, since):
            got = tuple(x[k, i] for x in (found.speed, found.acceleration, found.sigma, found.usable))
            if island[k, i] >= 0:
                assert got[:3] == pytest.approx(wanted[:3], rel=1e-9, abs=1e-14), (frame, k, i)
            assert got[3] == wanted[3], (frame, k, i)
            used.append(wanted[3])
    assert 0.05 < np.mean(used) < 0.95
