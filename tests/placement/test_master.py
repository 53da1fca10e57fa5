"""The master program against programs solved by hand and by going through every choice of sites."""

from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import linprog

from stabctl._util.errors import StudyError
from stabctl.placement._cutting_planes import Cut, Master

CAP = np.array([30.0, 40.0, 50.0, 60.0])


def _cut(*gradient, bound=1.0, k=0):
    return Cut(k, np.array(gradient, float), bound, np.zeros(len(gradient)))


def _random_cuts(rng, n=4, count=5):
    return [_cut(*(rng.random(n) / 30), k=k) for k in range(count)]


def _by_enumeration(cuts, cap, cost_mw, cost_site, sites):
    """The least cost over every set of sites."""
    best = np.inf
    D, b = np.array([c.gradient for c in cuts]), np.array([c.bound for c in cuts])
    for count in range(min(sites or len(cap), len(cap)) + 1):
        for chosen in combinations(range(len(cap)), count):
            high = np.where(np.isin(np.arange(len(cap)), chosen), cap, 0.0)
            found = linprog(cost_mw, -D, -b, bounds=list(zip(0 * high, high, strict=True)))
            if found.status == 0:
                best = min(best, found.fun + cost_site[list(chosen)].sum())
    return best


def test_two_sizes_by_hand():
    """s1 + 2 s2 >= 20 and 3 s1 + s2 >= 30 meet in (8, 6)."""
    cuts = [_cut(1, 2, bound=20), _cut(3, 1, bound=30)]
    master = Master(np.array([50.0, 50.0]), np.ones(2), np.zeros(2))
    plan = master.solve(cuts)
    assert plan.mw == pytest.approx([8, 6], abs=1e-5)
    assert plan.cost == pytest.approx(14, abs=1e-5)
    assert plan.slack < 1e-7
    dear = Master(np.array([50.0, 50.0]), np.array([1.0, 10.0]), np.zeros(2)).solve(cuts)
    assert dear.mw == pytest.approx([20, 0], abs=1e-4)
    capped = Master(np.array([7.0, 50.0]), np.ones(2), np.zeros(2)).solve(cuts)
    assert capped.mw == pytest.approx([7, 9], abs=1e-4)


def test_it_is_disciplined_and_built_once():
    for sites in (None, 2):
        master = Master(CAP, np.ones(4), np.zeros(4), sites)
        problem = master.problem
        assert problem.is_dcp(dpp=True)
        rng = np.random.default_rng(1)
        first = master.solve(_random_cuts(rng))
        master.solve(_random_cuts(rng))
        assert master.problem is problem
        assert master.solve(_random_cuts(np.random.default_rng(1))).cost == pytest.approx(first.cost, rel=1e-6)


def test_the_solver_says_nothing(capfd):
    """HiGHS called by its own package prints a notice at its first solution, into what --json prints."""
    Master(np.array([10.0]), np.ones(1), np.ones(1), 1).solve([])
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("sites", [None, 1, 2, 3, 4, 9])
def test_at_most_so_many_sites(sites):
    rng = np.random.default_rng(5)
    for _ in range(4):
        cuts, price = _random_cuts(rng), 0.5 + rng.random(4)
        expected = _by_enumeration(cuts, CAP, price, np.zeros(4), sites)
        plan = Master(CAP, price, np.zeros(4), sites).solve(cuts)
        assert (plan.mw > 0).sum() <= (sites or 4)
        if np.isfinite(expected):
            assert plan.cost == pytest.approx(expected, rel=1e-6)
            assert plan.slack < 1e-6
        else:
            assert plan.slack > 1e-3


@pytest.mark.parametrize("site", [0.1, 5.0, 30.0])
def test_a_site_costs_what_it_costs_as_soon_as_it_is_there(site):
    rng = np.random.default_rng(7)
    for _ in range(4):
        cuts, f = _random_cuts(rng), site * (0.5 + rng.random(4))
        master = Master(CAP, np.ones(4), f)
        plan = master.solve(cuts)
        assert plan.cost == pytest.approx(_by_enumeration(cuts, CAP, np.ones(4), f, None), rel=1e-5)
        assert plan.cost == pytest.approx(master.cost(plan.mw))


def test_dear_sites_are_fewer():
    cuts = [_cut(3, 1, 1, 1, bound=80, k=0), _cut(1, 3, 1, 1, bound=80, k=1)]
    count = [(Master(CAP, np.ones(4), np.full(4, f)).solve(cuts).mw > 0).sum() for f in (0.0, 1e3)]
    assert count == [2, 2]
    cuts = [_cut(3, 1, 1, 1.9, bound=80, k=0), _cut(1, 3, 1, 1.9, bound=80, k=1)]
    count = [(Master(CAP, np.ones(4), np.full(4, f)).solve(cuts).mw > 0).sum() for f in (0.0, 1e3)]
    assert count == [2, 1]


def test_near_the_best_fleet():
    cuts = [_cut(1, 1, 1, 1, bound=70)]
    best = np.array([20.0, 30.0, 0.0, 30.0])
    plan = Master(CAP, np.array([1.0, 2.0, 3.0, 4.0]), np.zeros(4)).solve(cuts, best, 5.0)
    assert plan.mw == pytest.approx([20, 25, 0, 25], abs=1e-4)
    assert (np.abs(plan.mw - best) <= 5 + 1e-6).all()
    at_cap = Master(CAP, np.ones(4), np.zeros(4)).solve([_cut(1, 0, 0, 0, bound=29)], CAP, 3.0)
    assert at_cap.mw == pytest.approx([29, 37, 47, 57], abs=1e-4)


def test_the_room_grows():
    rng = np.random.default_rng(2)
    cuts = _random_cuts(rng, count=40)
    small = Master(CAP, np.ones(4), np.zeros(4), room=3)
    plan = small.solve(cuts)
    assert small.room >= 40
    assert plan.cost == pytest.approx(Master(CAP, np.ones(4), np.zeros(4)).solve(cuts).cost, rel=1e-6)
    assert plan.cost == pytest.approx(_by_enumeration(cuts, CAP, np.ones(4), np.zeros(4), None), rel=1e-5)


def test_without_cuts_nothing_is_needed():
    for sites in (None, 2):
        assert not Master(CAP, np.ones(4), np.zeros(4), sites).solve([]).mw.any()


def test_what_no_fleet_reaches_is_slack():
    plan = Master(CAP, np.ones(4), np.zeros(4)).solve([_cut(1, 0, 0, 0, bound=300)])
    assert plan.mw[0] == pytest.approx(30, rel=1e-5)
    assert plan.slack == pytest.approx((300 - 30) / 30, rel=1e-4)


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("price", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("sites", [None, 2])
def test_units_of_power_and_money_do_not_matter(scale, price, sites):
    rng = np.random.default_rng(11)
    plain = _random_cuts(rng)
    cuts = [_cut(*(c.gradient / scale), k=c.contingency) for c in plain]
    expected = Master(CAP, np.ones(4), np.zeros(4), sites).solve(plain)
    found = Master(scale * CAP, price * np.ones(4), np.zeros(4), sites).solve(cuts)
    assert found.mw / scale == pytest.approx(expected.mw, abs=1e-4)
    assert found.cost == pytest.approx(expected.cost * scale * price, rel=1e-5)


def test_caps_of_every_size_at_once():
    cap = np.array([1e-6, 1.0, 1e3, 1e6])
    cuts = [_cut(1e6, 1, 0, 0, bound=2), _cut(0, 0, 1e-3, 1e-6, bound=1.5)]
    plan = Master(cap, np.ones(4), np.zeros(4)).solve(cuts)
    assert plan.slack < 1e-5
    assert plan.cost == pytest.approx(1e-6 + 1 + 1e3 + 5e5, rel=1e-5)


@pytest.mark.parametrize("sites", [None, 1])
def test_what_is_no_number_is_a_sentence(sites):
    zero = Master(CAP, np.ones(4), np.zeros(4), sites).solve([_cut(0, 0, 0, 0)])
    assert not zero.mw.any()
    assert zero.slack == pytest.approx(1.0, rel=1e-6)
    for normal in ((np.nan, 1, 1, 1), (np.inf, 1, 1, 1)):
        with pytest.raises(StudyError, match="siting program"):
            Master(CAP, np.ones(4), np.zeros(4), sites).solve([_cut(*normal)])
    with pytest.raises(StudyError, match="siting program"):
        Master(CAP, np.ones(4), np.zeros(4), sites).solve([_cut(1, 1, 1, 1, bound=np.nan)])


def test_some_caps_of_nothing():
    cap = np.array([0.0, 40.0, 0.0, 60.0])
    plan = Master(cap, np.ones(4), np.zeros(4), 1).solve([_cut(1, 0.5, 1, 0.1, bound=10)])
    assert plan.mw == pytest.approx([0, 20, 0, 0], abs=1e-4)
