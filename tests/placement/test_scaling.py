"""Least multiples, on survival that is known, monotone or not."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stabctl.placement._scaling import FINE, SCAN, bisect, critical_scaling, largest_scaling, least_scaling


def _between(*gaps):
    """Survival on some intervals of multiples."""
    return lambda a: any(low <= a < high for low, high in gaps)


@given(st.floats(0.01, 3.0), st.floats(1e-6, 1e-2))
def test_bisection_ends_on_the_survived_side(edge, fine):
    found = bisect(lambda a: a >= edge, 0.0, 4.0, fine)
    assert edge <= found <= edge * (1 + 2 * fine)


@given(st.floats(0.001, 3.9))
def test_the_critical_scaling_of_a_monotone_survival_is_its_edge(edge):
    found = critical_scaling(lambda a: a >= edge, 4.0)
    assert edge <= found <= edge * (1 + 2 * FINE)


def test_the_first_of_several_edges_is_found():
    """An interval as wide as the ratio of the scan is never stepped over."""
    for low in np.geomspace(0.3, 2.5, 23):
        survived = _between((low, SCAN * low * (1 + 1e-9)), (3.5, 4.0))
        assert critical_scaling(survived, 4.0) == pytest.approx(low, rel=2 * FINE)


def test_a_larger_fleet_that_is_lost_does_not_hide_a_smaller_one_that_survives():
    assert critical_scaling(_between((0.5, 0.9)), 4.0) == pytest.approx(0.5, rel=2 * FINE)


def test_none_survives_up_to_the_most():
    asked = []
    assert critical_scaling(lambda a: asked.append(a), 4.0) is None
    assert max(asked) == 4.0
    assert critical_scaling(lambda a: a >= 4.0, 4.0) == pytest.approx(4.0)


def test_what_survives_at_the_lowest_needs_no_more():
    assert critical_scaling(lambda a: True, 4.0) == 0.0


class Planes:
    """Trials that a contingency k is survived in when the fleet has enough: needs[k] . s >= 1."""

    def __init__(self, needs, cap, gaps=()):
        self.needs, self.cap, self.gaps, self.asked = np.array(needs, float), np.array(cap, float), gaps, 0

    def fleet(self, mw):
        return np.minimum(mw, self.cap)

    def survives(self, mw, k):
        self.asked += 1
        have = self.needs[k] @ self.fleet(mw)
        return have >= 1 - 1e-12 and not any(j == k and low <= have < high for j, low, high in self.gaps)

    def each(self, ask, which=None):
        return [ask(k) for k in (range(len(self.needs)) if which is None else which)]

    def lost(self, mw):
        return [k for k in range(len(self.needs)) if not self.survives(mw, k)]


def test_a_fleet_reaches_as_far_as_its_last_cap():
    trials = Planes([[1, 1]], [30.0, 40.0])
    assert largest_scaling(trials, np.array([10.0, 4.0])) == 10.0
    assert largest_scaling(trials, np.array([10.0, 0.0])) == 3.0
    assert largest_scaling(trials, np.zeros(2)) == 0.0


@pytest.mark.parametrize("start", [0.01, 0.3, 1.0, 2.0, 9.0])
def test_the_least_multiple_is_that_of_the_hardest_contingency(start):
    trials = Planes([[1, 0], [0.5, 0.5], [0, 0.8]], [100, 100])
    found = least_scaling(trials, start * np.ones(2))
    assert found.scaling * start == pytest.approx(1 / 0.8, rel=2 * FINE)
    assert 2 in found.near
    for k, scaling in found.near.items():
        assert scaling * start == pytest.approx(1 / trials.needs[k].sum(), rel=2 * FINE)
    assert not trials.lost(found.scaling * start * np.ones(2))
    assert trials.lost((1 - 3 * FINE) * found.scaling * start * np.ones(2)) == [2]


def test_what_is_lost_a_little_below_is_near():
    trials = Planes([[1, 0], [0.99, 0], [1.1, 0], [5, 0]], [100, 100])
    found = least_scaling(trials, np.array([1.0, 0.0]))
    assert found.scaling == pytest.approx(1 / 0.99, rel=2 * FINE)
    assert set(found.near) == {0, 1, 2}
    for k, need in enumerate((1, 0.99, 1.1)):
        assert found.near[k] == pytest.approx(1 / need, rel=0.012)


def test_caps_hold_a_multiple_back():
    trials = Planes([[0.5, 0.5]], [1.0, 100.0])
    found = least_scaling(trials, np.array([1.0, 0.1]))
    assert trials.fleet(found.scaling * np.array([1.0, 0.1])) == pytest.approx([1.0, 1.0], rel=2 * FINE)
    assert least_scaling(Planes([[0.5, 0.5]], [1.0, 0.9]), np.array([1.0, 0.1])) is None


def test_nothing_to_survive_with_nothing():
    trials = Planes([[1, 1]], [5, 5])
    assert least_scaling(trials, np.zeros(2)) is None
    free = Planes([[1e9, 1e9]], [5, 5])
    assert least_scaling(free, np.ones(2)).scaling < 1e-8
    assert least_scaling(Planes(np.zeros((0, 2)), [5, 5]), np.ones(2)).scaling == 0.0


def test_a_small_part_of_a_large_fleet_is_not_taken_for_nothing():
    found = least_scaling(Planes([[1.0]], [1e6]), np.array([1e6]))
    assert found.scaling == pytest.approx(1e-6, rel=2 * FINE)


def test_a_contingency_lost_again_with_more_is_survived_beyond():
    """The first needs 2; the second survives 1 to 1.5 and from 3 on."""
    trials = Planes([[0.5], [1.0]], [100.0], gaps=[(1, 1.5, 3.0)])
    found = least_scaling(trials, np.array([1.0]))
    assert not trials.lost(np.array([found.scaling]))
    assert found.scaling == pytest.approx(3.0, rel=2 * FINE)


def test_it_is_the_same_for_the_same_question():
    trials = Planes([[float(Fraction(1, 3)), 0.2]], [50, 50])
    assert least_scaling(trials, np.ones(2)) == least_scaling(trials, np.ones(2))


def test_the_least_multiple_near_one_is_not_that_of_an_island_far_below():
    """The only contingency is survived from 0.15 to 0.25 times the fleet, and from 0.3 times on."""
    trials = Planes([[1 / 0.15]], [100.0], gaps=[(0, 0.25 / 0.15, 0.3 / 0.15)])
    assert least_scaling(trials, np.ones(1)).scaling == pytest.approx(0.3, rel=2 * FINE)
