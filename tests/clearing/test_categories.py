"""Categories of TPL-001-5, contingencies with clearing times of their own, and machines tripped at clearing."""

from collections import Counter

import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.clearing.screen_result import lines
from stabctl.clearing.templates import contingencies
from stabctl.simulation.events import Open, TripMachine


def degrees(case, wanted):
    found = Counter(end for k in wanted for end in (k.a, k.b))
    return found.values()


@pytest.mark.parametrize("name", ["two_area", "ieee39"])
def test_counts_are_those_of_the_network(cases, name):
    case = cases(name)
    known = lines(case)
    ends = Counter(end for k in case.branches for end in k[:2])
    one = {p: contingencies(case, p) for p in ("P1", "P2", "P4", "P5", "P6", "P7")}
    shunts = sum(bool(b.g or b.b) for b in case.buses)
    assert len(one["P1"]) == len(case.machines) + 2 * (len(case.branches) - len(known.twins)) + shunts
    assert len(one["P2"]) == len(case.buses)
    assert len(one["P4"]) == sum(count > 1 for count in ends.values())
    assert len(one["P5"]) == len(one["P1"]) + len(one["P2"])
    assert len(one["P6"]) == sum(d * (d - 1) for d in degrees(case, (*known.screened, *known.twins)))
    parallel = Counter(frozenset((k.a, k.b)) for k in (*known.screened, *known.twins, *known.bridges)).values()
    assert len(one["P7"]) == 2 * sum(n * (n - 1) // 2 for n in parallel)
    every = [c for several in one.values() for c in several]
    assert len({c.name for c in every}) == len(every)
    for c in every:
        c.with_clear("6cyc").check(case)
        assert bool(c.impedance) == (c.name[:2] in ("P2", "P4", "P5", "P7")), c.name


def test_names_and_what_happens(cases):
    case = cases("two_area")
    found = {c.name: c for p in ("P1", "P4@12cyc", "P6", "P7") for c in contingencies(case, p)}
    one = found["P1.2 line 7-8, fault at bus 7"]
    assert (one.fault, [*map(str, one.trip)], one.clear) == ("7", ["7-8"], None)
    assert found["P1.1 machine 2"].after == (TripMachine(2, 0.0),)
    stuck = found["P4 bus 8"]
    assert (len(stuck.trip), stuck.clear) == (4, "12cyc")
    Z = case.short_circuit().impedance[case.row_of_bus[8]]
    assert stuck.impedance == pytest.approx(2 * Z)
    later = found["P6.1 line 8-9 after line 7-8, fault at bus 8"]
    assert [(type(e), str(e.branch)) for e in later.events] == [(Open, "7-8")]
    assert later.starts(case) - later.events[0].at == 5.0
    assert {len(c.trip) for name, c in found.items() if name[:2] == "P7"} == {2}


@pytest.mark.parametrize(
    ("faults", "words"),
    [
        ("P3", "another dispatch follows the loss of a machine"),
        ("P8", "no category of contingencies; did you mean"),
        ("P4@soon", "'soon' is not a time"),
        ("P4@0cyc", "is not above 0"),
        ("P1 P2", "no category"),
    ],
)
def test_what_is_no_category(cases, faults, words):
    with pytest.raises(StudyError, match=words):
        cases("two_area").screen(faults=faults)


def test_no_contingencies_of_a_category(cases):
    with pytest.raises(StudyError, match="wscc9 has no contingencies P7"):
        cases("wscc9").screen(faults="P7")


def test_a_screen_of_a_category_finds_the_clearing_times_of_its_contingencies(points):
    base = points("two_area")
    found = base.screen(faults="P7@9cyc", resolution="1cyc", scan=0, longest=0)
    assert len(found.pairs) == 4
    assert {p.contingency.clear for p in found.pairs} == {"9cyc"}
    for pair in found.pairs[:2]:
        alone = base.clearing_time(pair.contingency, resolution="1cyc", scan=0, longest=0)
        assert (alone.cycles, alone.status) == (pair.cycles, pair.status)


@pytest.mark.slow
def test_a_margin_is_to_the_own_clearing_time(points):
    given = [st.Contingency("7", "10cyc", "7-8", name="own"), st.Contingency("7", trip="7-8", name="usual")]
    study = points("two_area").study(clear="6cyc", faults=given, worst=2, scan=0)
    critical = study.margins[0].found.cycles
    assert [(m.found.contingency.name, m.required, m.cycles) for m in study.margins] == [
        ("own", pytest.approx(10.0), pytest.approx(critical - 10)),
        ("usual", 6.0, pytest.approx(critical - 6)),
    ]
    assert list(study.df["required_cycles"]) == pytest.approx([10.0, 6.0])
    assert [run.outcome.stable for run in study.worst] == [False, True]
    assert "with a clearing time of at most 6 cycles, or their own" in str(study)


@pytest.mark.parametrize("after", ["8@0s", ["8@0s", "16-17@3cyc"]])
def test_a_machine_tripped_at_clearing_moves_with_it(cases, after):
    """The clearing time of the search is that of runs made one by one."""
    base = cases("ieee39").classical().initialize()
    fault = st.Contingency("29", trip="28-29", after=after)
    found = base.clearing_time(fault, resolution="0.5cyc", limit="20cyc", scan=0, longest=0, observe="3s")
    assert found.status == "found"
    assert {run.stable for run in found.runs} == {True, False}
    for run in found.runs:
        one = fault.with_clear(run.cycles / 60)
        until = max(e.at for e in one.timed(base.case)) + 3.0
        assert base.simulate(one, until=until).outcome.stable == run.stable, run.cycles
