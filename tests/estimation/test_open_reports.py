"""What reports leave open that are lost or computed from others, beside the same said machine by machine."""

import numpy as np
import pytest

from stabctl.estimation._report_errors import MissingReports

MACHINES, T, WB = 3, 1 / 40, 2 * np.pi * 50
C, D = np.array([0.11, -0.07, 0.05]), np.array([-0.004, -0.0025, -0.007])


class Plain:
    """One machine of one simulation: errors of angle and speed grow as its power may have changed unseen."""

    def __init__(self, i, P):
        self.i, self.angle, self.speed, self.power, self.lost, self.switched = i, 0.0, 0.0, 0.0, 0, False
        self.before, self.hidden, self.blind = P.copy(), np.zeros(3), False

    def step(self, here, missing, switched, computed, whole, before, now, variance):
        i = self.i
        self.switched |= switched
        self.blind = here[i] and computed[i] and self.lost == 1
        self.lost = max(self.lost - 1, 0)
        first, gap = missing[i] == 0, (missing[i] + 1) * T
        if first:
            self.before = before.copy()
        seen = [(now[j] - self.before[j]) ** 2 - 2 * variance[j] for j in range(MACHINES) if here[j]]
        sigma = max([0.0, *seen]) ** 0.5
        if self.switched:
            sigma = max(sigma, whole[i])
        angle = self.angle + WB * T * self.speed + C[i] * sigma
        speed = self.speed + D[i] * sigma
        if not here[i]:
            self.angle, self.speed, self.power, self.hidden = angle, speed, sigma, np.zeros(3)
            return
        long = self.switched and gap > 0.05 - 1e-9  # the network may have been switched twice
        share = 1.0 if long else 0.0 if first else min(gap / 0.1, 1.0)
        self.hidden = share * np.array([angle, speed, sigma])
        found = computed[i] and long and not first
        self.blind |= found
        if found or self.hidden[0] > 0.3:
            self.lost = round(2.0 / T)
        self.angle = self.speed = self.power = 0.0
        self.switched = False


@pytest.mark.parametrize("seed", range(6))
def test_errors_between_reports_are_those_of_power_that_changed_unseen(seed):
    rng = np.random.default_rng(seed)
    P = rng.uniform(0.3, 0.9, (2, MACHINES))
    found = MissingReports(P, C, D, wb=WB, T=T)
    plain = [[Plain(i, P[k]) for i in range(MACHINES)] for k in range(2)]
    missing, before = np.zeros((2, MACHINES), int), P.copy()
    lasting = np.zeros(3)
    for _ in range(120):
        here, switched = rng.random((2, MACHINES)) < 0.55, rng.random((2, 1)) < 0.08
        here |= rng.random((2, 1)) < 0.2  # sometimes every report arrives
        computed, whole = rng.random((2, MACHINES)) < 0.2, rng.uniform(0.4, 2.0, (2, MACHINES))
        now, variance = P + rng.normal(0, 0.2, P.shape), rng.uniform(0, 0.03, P.shape)
        found.step(here, missing, switched, computed, whole=whole, before=before, now=now, variance=variance)
        for k in range(2):
            for i, one in enumerate(plain[k]):
                one.step(here[k], missing[k], switched[k, 0], computed[k], whole[k], before[k], now[k], variance[k])
                assert found.hidden[k, i] == pytest.approx(one.hidden, rel=1e-9, abs=1e-12)
                assert found.moved[k, i] == pytest.approx([one.angle, one.speed], rel=1e-9, abs=1e-12)
                assert (found.power[k, i], found.blind[k, i]) == (pytest.approx(one.power), one.blind)
                assert found.lost[k, i] == one.lost
                lasting += one.blind, one.lost > 0, np.any(one.hidden)
        before, missing = np.where(here, now, before), np.where(here, 0, missing + 1)
    assert (lasting > 0).all()


def test_nothing_is_open_while_every_report_arrives():
    """At 40 frames per second no fault is cleared between two frames."""
    P, all_of = np.full((1, MACHINES), 0.5), np.ones((1, MACHINES), bool)
    found = MissingReports(P, C, D, wb=WB, T=T)
    more = {"whole": P, "before": P, "now": P + 1, "variance": 0 * P}
    for _ in range(3):
        found.step(all_of, np.zeros((1, MACHINES), int), np.ones((1, 1), bool), ~all_of, **more)
        assert not found.hidden.any()
        assert not found.moved.any()
        assert not found.power.any()
