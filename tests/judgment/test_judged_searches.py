"""Criteria in the search for clearing times, in screens and in siting: the answers of runs judged one by one."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.clearing import Search
from stabctl.clearing.screen import as_plain, from_plain
from stabctl.jobs.task import Base
from stabctl.placement._simulated import Shared, Simulated, answer, task

HZ = 60.0


@pytest.fixture(scope="module")
def base():
    return st.load("two_area").initialize()


def criteria(tmp_path, text):
    path = tmp_path / "ours.toml"
    path.write_text(f'title = "ours"\n{text}', encoding="utf-8")
    return st.criteria(path)


def drawn(rng):
    """A rule whose limit faults of two_area reach at some clearing time."""
    level, longest = rng.uniform(0.3, 0.85), rng.uniform(0.05, 0.5)
    rules = (
        f'[[voltage]]\nname = "v"\nbelow = {level:.3f}\nlongest = "{longest:.3f}s"\n',
        f'[[voltage]]\nname = "d"\nof = "before"\nbelow = {level:.3f}\nlongest = "0.05s"\nsince = "clearing"\n',
        f'[[frequency]]\nname = "f"\nabove = {60 + rng.uniform(0.3, 1.2):.3f}\n',
        f'[[angle]]\nname = "a"\nseparation = "{rng.uniform(60, 160):.1f}deg"\n',
    )
    return rules[rng.integers(len(rules))]


@pytest.mark.parametrize("seed", range(12))
def test_a_clearing_time_is_the_last_of_the_runs_that_keep_the_criteria(base, tmp_path, seed):
    """Every fault up to the answer, on a grid of half a cycle, keeps them; the next one does not."""
    rng = np.random.default_rng(seed)
    ours = criteria(tmp_path, drawn(rng))
    fault = ["7", "8", "9", "7-8@0.3"][rng.integers(4)]
    trip = () if "@" in fault else ("8-9" if fault == "9" else "7-8")

    def kept(cycles):
        run = base.simulate(st.Contingency(fault, cycles / HZ, trip, at=0.0), until=cycles / HZ + 3.0)
        return run.judge(ours).kept

    found = base.clearing_time(
        st.Contingency(fault, trip=trip), criteria=ours, resolution="0.5cyc", limit="40cyc", observe="3s", longest=0
    )
    until = {"unstable_at_zero": -0.5, "stable_at_limit": 40.0}.get(found.status, found.cycles)
    assert all(kept(c) for c in np.arange(0, until + 0.1, 0.5))
    assert found.status == "stable_at_limit" or not kept(until + 0.5)


def test_criteria_shorten_clearing_times_and_say_why(base):
    """Of the four faults of two_area, PRC-024 limits three (9, 18, 18 cycles instead of 15.875, 47, 47.75)."""
    free, bound = base.screen(), base.screen(criteria="nerc-prc-024")
    times = {p.contingency: p.cycles for p in free.pairs}
    assert all(p.cycles <= times[p.contingency] for p in bound.pairs)
    judged = [p for p in bound.pairs if p.limited_by == "criteria"]
    assert [p.cycles for p in judged] == [9.0, 18.0, 18.0]
    one = judged[0]
    assert one.limit == "PRC-024-3, below 0.45 pu: bus 10"
    assert "beyond, PRC-024-3, below 0.45 pu: bus 10, 0.254 pu at worst, not allowed from 0.150 s on" in str(one)
    assert "criteria NERC PRC-024-3" in str(bound)
    assert [*one.df.columns][-1] == "violated"
    assert "violated" not in free.pairs[0].df.columns


@pytest.mark.slow
def test_a_screen_and_a_single_search_give_the_same(base):
    for pair in base.screen(criteria="nerc-prc-024").pairs:
        alone = base.clearing_time(pair.contingency, criteria="nerc-prc-024")
        assert (alone.cycles, alone.limit, alone.status) == (pair.cycles, pair.limit, pair.status)
        again = from_plain(json.loads(json.dumps(as_plain(pair))), pair.contingency, pair.search)
        assert again == pair


def test_a_store_keeps_screens_with_and_without_criteria_apart(base, tmp_path):
    known = [base.screen(store=tmp_path, criteria=c) for c in (None, "nerc-prc-024")]
    again = [base.screen(store=tmp_path, criteria=c) for c in (None, "nerc-prc-024")]
    assert [p.cycles for p in known[0].pairs] != [p.cycles for p in known[1].pairs]
    for one, other in zip(known, again, strict=True):
        assert [p.runs for p in one.pairs] == [p.runs for p in other.pairs]


def test_a_run_too_short_for_the_criteria_is_repeated_with_the_longest_observation(base, tmp_path):
    """The voltage at bus 7 comes back to 99 % after 0.29 s, which an observation of 0.15 s does not show."""
    for time, kept in (("1s", True), ("0.28s", False)):
        rule = f'[[voltage]]\nname = "slow"\nof = "before"\nbelow = 0.99\nrecover = "{time}"\nbuses = "loads"\n'
        ours = criteria(tmp_path, rule)
        search = {"resolution": "1cyc", "limit": "4cyc", "observe": "0.15s", "criteria": ours}
        long, short = (base.clearing_time("7", **search, longest=longest) for longest in ("3s", 0))
        run = base.simulate(st.Contingency("7", clear="4cyc"), until="4s")
        assert long.runs[-1].stable == run.judge(ours).kept == kept
        assert not long.undecided()
        assert long.observed_s == pytest.approx(3.0) if kept else long.limited_by == "criteria"
        assert short.undecided() == ("slow: bus 7 has not recovered when the run ends at 0.217 s; simulate longer.")
        assert short.undecided() in str(short)


def test_the_instant_of_the_fault_does_not_matter(base, tmp_path):
    """Also a fault at 0, whose first recorded row is not the voltage before it, is judged by the voltage before it."""
    ours = criteria(tmp_path, '[[voltage]]\nname = "v"\nof = "before"\nbelow = 0.85\nlongest = "0.1s"\n')
    runs = [base.simulate(st.Contingency("7", clear="8cyc", at=at), until=at + 3.0) for at in (0.0, 1.0)]
    first, second = (run.judge(ours).violations for run in runs)
    assert len(first) > 5
    assert [(v.where, v.from_s + 1.0, v.extreme) for v in first] == [
        (v.where, pytest.approx(v.from_s, abs=1e-9), pytest.approx(v.extreme, abs=1e-6)) for v in second
    ]


def test_rules_by_area_and_rated_voltage(base, tmp_path):
    """The voltage at every bus falls below 0.9; only buses of 230 kV, or of an area, count."""
    case = st.load("two_area")
    case = replace(case, buses=tuple(b._replace(area=1 if b.bus in (1, 2, 5, 6, 7) else 2) for b in case.buses))
    run = case.simulate(st.Contingency("7", clear="6cyc"), until="3s")

    def places(more, what="voltage", level="below = 0.95"):
        ours = criteria(tmp_path, f'[[{what}]]\nname = "a"\n{level}\n{more}\n')
        return {v.where for v in run.judge(ours).violations}

    every = places("")
    assert {"bus 1", "bus 5", "bus 9"} <= every
    assert places("kv = [100, 500]") == {f"bus {b}" for b in (5, 6, 7, 8, 9, 10, 11)} & every
    assert places("kv = [20, 20]") == {f"bus {b}" for b in (1, 2, 3, 4)} & every
    assert places("areas = [1]") == {f"bus {b}" for b in (1, 2, 5, 6, 7)} & every
    assert places("areas = [1]\nkv = [100, 500]") == {f"bus {b}" for b in (5, 6, 7)} & every
    machines = places("areas = [2]", "frequency", "above = 60.01")
    assert machines == {"machine 3", "machine 4"}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("kv = [500, 100]", "is not a range above 0"),
        ("areas = [7]", "two_area has no bus with area 7; its areas are 0, its rated voltages 20, 230 kV"),
        ("kv = [300, 500]", "has no bus with 300 to 500 kV"),
        ('areas = ["x"]', "areas"),
    ],
)
def test_rules_that_no_bus_of_the_case_meets_are_refused(base, tmp_path, more, said):
    path = tmp_path / "ours.toml"
    path.write_text(f'title = "ours"\n[[voltage]]\nname = "a"\nbelow = 0.8\n{more}\n', encoding="utf-8")
    with pytest.raises(StudyError, match=re.escape(said)):
        base.clearing_time("7", criteria=path)


def test_rated_voltages_that_are_missing_are_told(tmp_path):
    case = st.load("two_area")
    case = replace(case, buses=tuple(b._replace(rated=0.0) for b in case.buses))
    ours = criteria(tmp_path, '[[voltage]]\nname = "a"\nbelow = 0.8\nkv = [100, 500]\n')
    with pytest.raises(StudyError, match="bus 1 of two_area has none"):
        case.screen(criteria=ours)


@pytest.mark.slow
def test_a_fleet_keeps_the_criteria(base, tmp_path):
    """Rotors 150 degrees apart at most: the fleet is larger than one that only keeps synchronism."""
    ours = criteria(tmp_path, '[[angle]]\nname = "apart"\nseparation = "150deg"\n')
    wanted = st.Contingency("7-8@0.4", clear="22cyc")
    how = {"candidates": [(1, 5)], "observe": "2s"}
    free, bound = st.place(base, wanted, **how), st.place(base, wanted, criteria=ours, **how)
    assert bound.cost > free.cost + 5
    assert "judged by ours" in str(bound)
    for found, kept in ((free, False), (bound, True)):
        run = base.case.simulate(wanted, until="3.36s", storage=found.storage(), control=st.BangBang())
        assert run.outcome.stable
        assert run.judge(ours).kept == kept


@pytest.mark.slow
def test_the_commands(stabctl, tmp_path):
    code, out, _ = stabctl("screen", "two_area", "--criteria", "nerc-prc-024", "--json")
    pairs = json.loads(out)["pairs"]
    assert (code, [p["limited_by"] for p in pairs]) == (0, ["synchronism", *["criteria"] * 3])
    code, out, _ = stabctl("clearing-time", "two_area", "--fault", "9", "--trip", "8-9", "--criteria", "nerc-prc-024")
    assert (code, "beyond, PRC-024-3, below 0.45 pu" in " ".join(out.split())) == (0, True)
    code, _, err = stabctl("screen", "two_area", "--criteria", "nerc")
    assert (code, "There are no criteria 'nerc'" in err) == (2, True)


def test_swings_that_must_decay_bound_a_clearing_time(tmp_path):
    """Without damping they do not, however small they are: only without a fault there are none."""
    ours = criteria(tmp_path, '[[swings]]\nname = "damping"\nmust = "decay"\n')
    how = {"criteria": ours, "resolution": "1cyc", "limit": "20cyc"}
    case = st.load("two_area")
    damped, undamped = (one.clearing_time("7", **how) for one in (case, case.classical()))
    for run in (*damped.runs, *undamped.runs):
        assert run.stable == (run.outcome.value == "stable" and run.swings.decaying)
    assert undamped.cycles == 0
    assert undamped.limit == "damping: machine 4"
    assert damped.cycles > 3


def test_the_instant_of_a_violation_counts_from_the_fault(base, tmp_path):
    """As the ends of runs do, wherever the search puts the fault: at 1 s where a gate opens at a given instant."""
    rules = criteria(tmp_path, '[[voltage]]\nname = "v"\nbelow = 0.5\nlongest = "0.05s"\n')
    late = st.Controller("speed", "vs", [], [], [], [[0.0] * 4] * 4, gate=st.Gate(start=30.0))
    how = {"criteria": rules, "resolution": "1cyc", "limit": "8cyc", "scan": 0}
    told = [base.clearing_time("7", control=c, **how).runs[-1].violated for c in (None, late)]
    assert told[0].from_s == pytest.approx(0.05)
    assert told[1].from_s == pytest.approx(0.05)


def test_a_fleet_and_its_critical_time_are_judged_alike(tmp_path):
    """Swings that must decay are judged 5 s after clearing: later runs, where they may last, or a refusal."""
    rules = criteria(tmp_path, '[[swings]]\nname = "damping"\nmust = "decay"\n')
    point = st.load("two_area").classical().initialize(storage="1MW")
    search = Search(observed_s=3.0, longest_s=20.0, limit_cycles=10, criteria=rules)
    ratings = tuple(s.rating for s in point.case.storage)
    asked = [
        Simulated(what, st.Contingency("7", clear="5cyc"), ratings, False, search, "")
        for what in ("outcome", "critical time")
    ]
    found = [answer(task(one, Shared(Base(point), st.BangBang()), False)) for one in asked]
    assert [one.values["stable"] for one in found] == [0, 0]
    with pytest.raises(StudyError, match="judged 5 s after the last event; observe that long at least"):
        st.place(point.case, [st.Contingency("7", clear="5cyc")], criteria=rules, observe="3s")
