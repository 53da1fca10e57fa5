"""Cuts that a fleet contradicts are moved back to it, and `cuts_cost` is that of the cheapest fleet that is left."""

from types import SimpleNamespace

import cvxpy as cp
import numpy as np
import pytest

from stabctl.placement import _cutting_planes, _scaling
from stabctl.placement._cutting_planes import Cut, CuttingPlanes, Master, Unsolved
from stabctl.placement.contingencies import Scenario
from stabctl.placement.site_options import Prices
from stabctl.simulation.contingency import Contingency

AT_LEAST_20 = Cut(0, np.array([1 / 20, 0.0]), 1.0, np.array([20.0, 0.0]))  # MW at the first site
PRICES = Prices(np.array([1.0, 2.0]), np.zeros(2), np.zeros(2))


def planes(best, survivors=(), boundary=(), cuts=(AT_LEAST_20,)):
    """One cut at the first site; the second costs nothing that matters here."""
    master = Master(np.array([50.0, 50.0]), PRICES.mw, PRICES.site)
    trials = SimpleNamespace(scenarios=("one", "other"))
    best, fleets = np.array(best), [np.array(fleet) for fleet in survivors]
    known = [(k, np.array(fleet)) for k, fleet in boundary]
    made = CuttingPlanes(trials, master, (np.zeros((1, 2)),), PRICES, np.zeros(2), list(cuts), known, [*fleets, best])
    made.best, made.cost = best, master.cost(best)
    return made


@pytest.mark.parametrize(
    ("best", "survivors", "bound"),
    [
        ((30.0, 5.0), (), 20.0),  # in agreement with the cut
        ((10.0, 15.0), (), 10.0),  # survives with less at the first site
        ((30.0, 5.0), [(12.0, 49.0)], 12.0),  # another fleet that survives everything, with less there
        ((10.0, 15.0), [(12.0, 49.0)], 10.0),
    ],
)
def test_the_bound_is_below_every_fleet_that_is_known_to_survive(best, survivors, bound):
    found = planes(best, survivors)
    assert found.bound == pytest.approx(bound, abs=1e-4)
    assert found.bound < found.cost


def test_a_fleet_that_survives_one_contingency_alone_does_not_weaken_the_bound():
    assert planes((30.0, 5.0), boundary=[(0, (12.0, 9.0))]).bound == pytest.approx(20.0, abs=1e-4)


@pytest.mark.parametrize(
    ("boundary", "radius", "bound"),
    [
        ([], np.inf, 1.0),
        ([(0, (12.0, 9.0))], np.inf, 0.6),  # a boundary fleet of the same contingency
        ([(1, (12.0, 9.0))], np.inf, 1.0),  # of another one
        ([(0, (12.0, 9.0))], 6.0, 1.0),  # within twice the radius of the best fleet the cut stays
        ([(0, (12.0, 9.0))], 4.0, 0.6),  # beyond it is moved
    ],
)
def test_the_search_moves_cuts_found_far_from_the_best_fleet(boundary, radius, bound):
    (cut,) = planes((30.0, 5.0), boundary=boundary)._trusted(radius)
    assert cut.bound == pytest.approx(bound)


def test_the_bound_is_never_above_the_cost_of_a_fleet():
    assert planes((0.0, 4.0)).bound == pytest.approx(0.0, abs=1e-4)
    found = planes((30.0, 0.0))
    found.cost = 15.0
    assert found.bound == 15.0


class Curved:
    """Fleets survive if s1 s2 >= 100: a convex set, whose cheapest fleet at prices 1 and 2 is (14.14, 7.07)."""

    scenarios = (Scenario(Contingency("1")),)
    cap = np.array([50.0, 50.0])

    def alone(self):
        return self

    def fleet(self, mw):
        return np.minimum(mw, self.cap)

    def survives(self, mw, k):
        return bool(np.prod(self.fleet(mw)) >= 100 * (1 - 1e-12))

    def each(self, ask, which=None):
        return [ask(k) for k in ((0,) if which is None else which)]

    def all_survived(self, mw):
        return self.survives(mw, 0)

    def lost(self, mw):
        return [] if self.survives(mw, 0) else [0]


@pytest.fixture
def curved(monkeypatch):
    """Cutting planes with exact gradients, at a fleet that costs little more than the cheapest one."""
    monkeypatch.setattr(_scaling, "by_peak", lambda trials, mw, k: 0.5 / mw)  # of s1 s2, scaled to d . s = 1
    monkeypatch.setattr(_cutting_planes, "energies", lambda trials, mw: 0 * mw)
    made = planes((14.5, 100 / 14.5), cuts=())
    made.trials = Curved()
    made.cut(np.array([30.0, 100 / 30]), 0)
    made.cut(np.array([5.0, 20.0]), 0)
    return made


def test_visits_of_its_own_plan_raise_the_bound(curved):
    """Two cuts far away allow 3/4 of the cost; those at the plans without a trust region leave 0.2 %."""
    least = 2 * np.sqrt(200)
    before = curved.bound
    assert before < 0.85 * least
    curved._tighten()
    assert 0.99 * least <= curved.bound <= least * (1 + 1e-6)
    assert curved.bound < curved.cost
    planned = [row.planned for row in curved.history]
    assert planned == sorted(planned)
    assert planned[0] == pytest.approx(before)


def test_the_search_and_the_bound_meet(curved):
    curved.best, curved.cost = np.array([40.0, 2.5]), 45.0
    curved.survivors = [curved.best]
    curved.run()
    assert curved.cost == pytest.approx(2 * np.sqrt(200), rel=3e-3)
    assert curved.bound == pytest.approx(curved.cost, rel=5e-3)
    assert curved.bound < curved.cost
    assert (np.round(curved.best, 2) == curved.best).all()
    assert not curved.trials.lost(curved.best)


def test_a_solver_that_fails_ends_the_search_with_the_best_fleet(curved, monkeypatch):
    def fail(*_):
        raise Unsolved("InsufficientProgress")

    monkeypatch.setattr(curved.master, "solve", fail)
    curved.run()
    assert curved.best == pytest.approx([14.5, 6.9], abs=0.2)
    assert curved.bound is None
    assert {row.status for row in curved.history} == {"InsufficientProgress"}
    assert all(row.failed for row in curved.history)


@pytest.mark.parametrize("sites", [None, 1])
def test_what_the_solver_says_is_in_the_plan(monkeypatch, sites):
    master = Master(np.array([50.0, 50.0]), np.ones(2), np.zeros(2), sites)
    solve = cp.Problem.solve

    def hasty(problem, **options):
        solve(problem, **options)
        problem._status = cp.OPTIMAL_INACCURATE

    monkeypatch.setattr(cp.Problem, "solve", hasty)
    plan = master.solve([AT_LEAST_20])
    assert plan.status == "optimal_inaccurate"
    assert plan.mw[0] == pytest.approx(20.0, abs=1e-4)

    def stuck(problem, **options):
        raise cp.SolverError("Solver 'CLARABEL' failed.")

    monkeypatch.setattr(cp.Problem, "solve", stuck)
    with pytest.raises(Unsolved, match="failed"):
        master.solve([AT_LEAST_20])


def test_a_fleet_that_survives_is_kept_once():
    found = planes((30.0, 5.0))
    found.trials.fleet = lambda mw: mw
    for mw, best in (((20.0, 5.0), (20.0, 5.0)), ((40.0, 5.0), (20.0, 5.0)), ((10.0, 6.0), (10.0, 6.0))):
        count = len(found.survivors)
        found.accept(np.array(mw))
        assert len(found.survivors) == count + 1
        assert found.best.tolist() == list(best)


@pytest.mark.parametrize("mw", [(10.0, 20.0), (10.0, 0.0)])
def test_a_multiple_that_is_affordable_costs_all_there_is(mw):
    prices, mw = Prices(np.array([1.0, 2.0]), np.zeros(2), np.array([7.0, 11.0])), np.array(mw)
    for cost in (40.0, 90.0):
        assert prices.cost(prices.affordable(mw, cost) * mw, np.zeros(2)) == pytest.approx(cost)
    assert prices.affordable(mw, 5.0) == 0  # less than the sites alone
