"""Cuts that a fleet contradicts are moved back to it, and the bound is the cost of the cheapest fleet that is left."""

from types import SimpleNamespace

import numpy as np
import pytest

from stabctl.placement.cutting_planes import CuttingPlanes
from stabctl.placement.master import Cut, Master

AT_LEAST_20 = Cut(0, np.array([1 / 20, 0.0]), 1.0, np.array([20.0, 0.0]))  # MW at the first site


def planes(best, boundary=()):
    """One cut at the first site; the second costs nothing that matters here."""
    master = Master(np.array([50.0, 50.0]), np.array([1.0, 2.0]), np.zeros(2))
    trials = SimpleNamespace(contingencies=("one", "other"))
    best = np.array(best)
    known = [(k, np.array(fleet)) for k, fleet in boundary]
    return CuttingPlanes(trials, master, np.zeros((1, 2)), [AT_LEAST_20], known, best, master.cost(best))


@pytest.mark.parametrize(
    ("best", "boundary", "bound"),
    [
        ((30.0, 5.0), (), 20.0),  # in agreement with the cut
        ((10.0, 15.0), (), 10.0),  # survives with less at the first site
        ((30.0, 5.0), [(0, (12.0, 9.0))], 12.0),  # on the boundary of the same contingency
        ((30.0, 5.0), [(1, (12.0, 9.0))], 20.0),  # of another one
        ((10.0, 15.0), [(0, (12.0, 9.0))], 10.0),
    ],
)
def test_the_bound_is_below_every_fleet_that_is_known_to_survive(best, boundary, bound):
    found = planes(best, boundary)
    assert found.bound == pytest.approx(bound, abs=1e-4)
    assert found.bound < found.cost


def test_the_bound_is_never_above_the_cost_of_a_fleet():
    assert planes((0.0, 4.0)).bound == pytest.approx(0.0, abs=1e-4)
    found = planes((30.0, 0.0))
    found.cost = 15.0
    assert found.bound == 15.0
