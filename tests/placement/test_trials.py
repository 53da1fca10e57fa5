"""Trials of fleets: every question is simulated once, and the answers are those of a new simulation."""

from concurrent.futures import CancelledError
from dataclasses import replace
from threading import Event

import numpy as np
import pytest

from stabctl.clearing import Search
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.model.tables import Storage
from stabctl.placement.trials import Trials
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import run

TO_SURVIVE = (
    Contingency("29", 4.75 / 60, "26-29"),
    Contingency("16", 10.625 / 60, "16-21"),
    Contingency("25", 8.25 / 60, "2-25"),
)


@pytest.fixture(scope="module")
def case(cases):
    case = cases("ieee39").classical()
    return case.with_storage(Storage(m.machine, m.storage_bus, 0.3 * m.base) for m in case.machines)


@pytest.fixture(scope="module")
def point(case):
    return operating_point.solve(case)


@pytest.fixture
def trials(point):
    return Trials(point, TO_SURVIVE, np.array([s.rating for s in point.case.storage]), search=Search(observed_s=2.0))


def _sizes(point, share):
    return np.array([share * point.case.machine(s.machine).base for s in point.case.storage])


def test_a_resized_point_is_that_of_a_fresh_start(case, point):
    mw = _sizes(point, 0.06) * np.linspace(0.0, 2.0, 10)
    pairs = zip(case.storage, mw, strict=True)
    fresh = operating_point.solve(case.with_storage(s._replace(rating=float(size)) for s, size in pairs))
    resized = point.resized(mw)
    assert resized.case == fresh.case
    assert np.array_equal(resized.s, fresh.s)
    for one, other in zip(resized.system.families, fresh.system.families, strict=True):
        assert one.name == other.name
        assert np.array_equal(one.w, other.w)
        assert np.array_equal(one.k, other.k)
    one = TO_SURVIVE[0]
    events = replace(one, at=0.0)
    a, b = (run(p, events, 1.0, BangBang()) for p in (resized, fresh))
    assert np.array_equal(a.rows, b.rows)
    assert set(np.unique(a.arrays.order)) == {-1.0, 0.0, 1.0}


def test_a_trial_is_a_simulation_from_scratch(case, point, trials):
    for k, one in enumerate(TO_SURVIVE):
        for share in (0.0, 0.05):
            mw = _sizes(point, share)
            pairs = zip(case.storage, mw, strict=True)
            fresh = operating_point.solve(case.with_storage(s._replace(rating=float(size)) for s, size in pairs))
            events = replace(one, at=0.0)
            ran = run(fresh, events, one.clear + 2.0, BangBang())
            assert trials.survives(mw, k) == ran.outcome.stable == (share > 0)


def test_a_device_without_size_is_none(case, trials):
    """Its order switches, which divides no step: the same steps as those of whoever builds the others only."""
    mw = np.where(np.isin(np.arange(10), [0, 5, 8]), [s.rating for s in case.storage], 0.0) / 2
    one = replace(TO_SURVIVE[2], at=0.0)
    tried = run(trials.point.resized(mw), one, 2.0, BangBang())
    built = case.with_storage(s._replace(rating=s.rating / 2) for s, size in zip(case.storage, mw, strict=True) if size)
    ran = run(operating_point.solve(built), one, 2.0, BangBang())
    differ = np.abs(ran.arrays.speed - tried.arrays.speed).max(axis=1)
    assert np.array_equal(ran.time, tried.time)
    assert differ[-1] < 3e-6  # 6e-7, as instants are found to 1e-6 of a step; 5e-5 if these orders divided steps
    assert np.ptp(tried.arrays.order[:, mw == 0], axis=0).max() == 2


def test_a_question_is_simulated_once(point, trials):
    mw = _sizes(point, 0.05)
    assert trials.lost(mw) == trials.lost(mw) == trials.lost(mw + 1e-8) == []
    assert trials.simulations == 3
    assert trials.lost(0 * mw) == [0, 1, 2]
    assert trials.simulations == 6
    assert [trials.fleets(k) for k in range(3)] == [2, 2, 2]


def test_no_device_is_larger_than_its_cap(point, trials):
    mw = _sizes(point, 0.5)
    assert np.array_equal(trials.fleet(mw), trials.cap)
    trials.survives(mw, 0)
    trials.survives(2 * mw, 0)
    assert trials.simulations == 1


def test_threads_change_nothing(point):
    rng = np.random.default_rng(3)
    fleets = [_sizes(point, 0.1) * rng.random(10) for _ in range(4)]
    answers = []
    for workers in (1, 4):
        cap = _sizes(point, 0.3)
        trials = Trials(point, TO_SURVIVE, cap, search=Search(observed_s=2.0), workers=workers)
        answers.append(([trials.lost(mw) for mw in fleets], trials.simulations))
    assert answers[0] == answers[1]
    assert 0 < sum(map(len, answers[0][0])) < 12


def test_some_of_the_contingencies_keep_what_is_known(point, trials):
    mw = _sizes(point, 0.02)
    lost = trials.lost(mw)
    some = trials.only([2, 0])
    assert some.contingencies == (TO_SURVIVE[2], TO_SURVIVE[0])
    assert some.lost(mw) == [[2, 0].index(k) for k in sorted(lost, key=[2, 0, 1].index) if k != 1]
    assert some.simulations == trials.simulations == 3
    some.survives(2 * mw, 0)
    assert trials.simulations == some.simulations == 4
    assert trials.fleets(2) == 2


def test_finer_and_longer(point, trials):
    finer = trials.refined()
    assert (finer.search.step, finer.search.observed_s) == (1 / 240, 4.0)
    ran = finer.simulate(_sizes(point, 0.05), 0)
    assert ran.step == 1 / 240
    assert ran.time[-1] == pytest.approx(TO_SURVIVE[0].clear + 4.0)
    assert finer.fleets(0) == 0
    longer = trials.longer()
    assert longer.search == replace(trials.search, observed_s=4.0)
    assert longer.fleets(0) == 0


def test_the_count_is_told(point):
    told = []
    search = Search(observed_s=0.5)
    trials = Trials(point, TO_SURVIVE, _sizes(point, 0.3), search=search, progress=told.append, workers=1)
    trials.lost(_sizes(point, 0.05))
    assert told == [1, 2, 3]


def test_what_stops_one_thread_stops_all(point):
    trials = Trials(point, TO_SURVIVE, _sizes(point, 0.3), search=Search(observed_s=0.5), workers=2)
    under_way = Event()

    def ask(k):
        if k == 0:
            under_way.wait(60)
            raise KeyboardInterrupt
        for i in range(100_000):
            trials.survives(_sizes(point, 1e-5 * i), k)
            under_way.set()

    with pytest.raises(KeyboardInterrupt):
        trials.each(ask, [0, 1])
    with pytest.raises(CancelledError):
        trials.survives(_sizes(point, 0.05), 2)
    assert trials.simulations < 1000


def test_proofs_use_half_the_step_and_twice_the_window(trials, point):
    """The rest of the search is the same; trials with a step of their own halve that."""
    once = setup(point).step
    for given, longer, step in ((None, None, once / 2), (0.004, 0.004, 0.002)):
        trials.search = replace(trials.search, step=given)
        search = trials.search
        assert trials.longer().search == replace(search, observed_s=4.0, step=longer)
        assert trials.refined().search == replace(search, observed_s=4.0, step=step)
        assert trials.search == search
    mw = _sizes(point, 0.05)
    assert trials.refined().simulate(mw, 0).step == pytest.approx(0.002)
    assert trials.simulate(mw, 0).step == pytest.approx(0.004)
