"""Critical clearing times: what the answer means, the paper's Table 4, other events, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from stabctl import io
from stabctl._util.errors import StudyError
from stabctl.clearing import Search, Trial, clearing_time, screen
from stabctl.controllers import BangBang, Controller, Gate
from stabctl.dynamics.operating_point import initialize
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.pmu import Pmu
from stabctl.model import fleet, powerflow
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.schedule import Schedule
from stabctl.simulation.simulation import run

AT_7 = Contingency("7", trip="7-8")


@pytest.fixture(scope="module")
def two_area():
    return initialize(io.load("two_area"))


@pytest.fixture(scope="module")
def stored():
    return initialize(io.load("two_area"), "50MW")


def test_two_area_fault_at_bus_7(two_area, stored):
    without = clearing_time(two_area, AT_7)
    held = clearing_time(stored, AT_7, control=BangBang())
    assert (without.cycles, without.seconds, without.machine) == (9.0, 9 / 60, 4)
    assert held.cycles == 12.25
    assert clearing_time(two_area, AT_7, storage="50MW", control=BangBang()).cycles == 12.25
    assert without.monotone
    assert "critical clearing time 9 cycles (0.1500 s)" in str(without)
    assert "observed 5 s" in str(without)


@pytest.mark.parametrize(("fault", "cycles"), [("7-8@0.3", 0.5), ("8-9@0.9", 2)])
def test_every_shorter_time_is_stable_and_the_next_is_not(two_area, fault, cycles):
    found = clearing_time(two_area, fault, resolution=f"{cycles}cyc")
    trial = Trial(two_area, Contingency(fault), None, found.search)
    critical = round(found.cycles / cycles)
    assert [trial.simulate(k).outcome.stable for k in range(critical + 2)] == [True] * (critical + 1) + [False]


def test_longer_observation_never_helps(two_area):
    assert clearing_time(two_area, AT_7, observe="1s").cycles >= clearing_time(two_area, AT_7).cycles


def test_without_the_judgement_of_swings_runs_end_with_the_window(two_area):
    found = clearing_time(two_area, AT_7, criterion=Criterion(decay=0), resolution="1cyc", observe="6s", scan=0)
    assert found.swings is None
    assert found.observed_s == pytest.approx(6.0)


@pytest.mark.parametrize("other", [{"after": "8-9@1s"}, {"events": "8-9@2s"}, {"after": "8-9@0s"}, {}])
def test_the_window_counts_from_the_last_event(two_area, other):
    found = clearing_time(two_area, replace(AT_7, **other), observe="1s", longest=0, limit="1cyc", resolution="1cyc")
    later = {"after": "8-9@1s"} == other or "events" in other
    assert f"observed 1 s after {'the last event' if later else 'clearing'}," in str(found)
    assert found.runs[-1].time_s - found.runs[-1].cycles / 60 == pytest.approx(2.0 if later else 1.0, abs=0.02)


def test_what_the_switching_cuts_off_is_said():
    point = initialize(io.load("wscc9").with_loads("impedance"))
    cut = Contingency("5", clear="6cyc", trip=["4-5", "5-7"])
    whole = replace(cut, trip=["5-7"])
    said = "The switching cut off bus 5 without a machine or grid-forming converter: blacked out, its load lost."
    search = {"resolution": "1cyc", "scan": 0}
    end = run(point, cut, 3.0).outcome
    assert end.stable
    assert end.cut_off == said
    assert str(clearing_time(point, cut, **search)).endswith(f" {said}")
    assert "cut off" not in str(clearing_time(point, whole, **search))
    assert str(screen(point, faults=[cut, whole], **search)).endswith(
        "The switching cuts off a part of the system, whose load may be lost: 5 trip 4-5, 5-7."
    )


def test_its_own_clearing_time_and_instant_are_ignored(two_area):
    other = Contingency("7", clear="40cyc", trip="7-8", at="3s")
    assert clearing_time(two_area, other).cycles == 9.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "control",
    [
        EstimatorControl(pmu=Pmu(outage=("1s", "1.3s"))),
        Controller("deviation", "order", [], [], [], 200 * np.eye(4), gate=Gate(start=1.02, end=1.4)),
        Controller.from_function(
            lambda seen: 200 * seen["deviation"] * (seen.time < 1.2), "deviation", "order", rate=60
        ),
        Schedule(np.tile([-1.0, -1.0, 1.0, 1.0], (60, 1)), rate=60, start=1.0),
    ],
    ids=["outage of PMUs", "gate", "function", "schedule"],
)
def test_instants_of_the_control_are_those_of_single_runs(stored, control):
    found = clearing_time(stored, AT_7, control=control, resolution="0.5cyc", scan=0)
    longest = round(2 * found.cycles)
    stable = [
        stored.simulate(AT_7.with_clear(k / 120), "6s", control=control).outcome.stable for k in (longest, longest + 1)
    ]
    assert stable == [True, False]


def test_clearing_does_not_depend_on_what_was_searched_before(stored):
    first = clearing_time(stored, "7-8@0.4", control=BangBang())
    clearing_time(stored, "8-9@0.5", control=BangBang(0.0, 0.0))
    again = clearing_time(stored, "7-8@0.4", control=BangBang())
    assert [r[:4] for r in first.runs] == [r[:4] for r in again.runs]


def test_times_are_text_or_seconds(two_area):
    coarse = clearing_time(two_area, AT_7, resolution="2cyc", limit="20cyc", observe="3s")
    assert (coarse.cycles, coarse.status) == (8.0, "found")
    assert clearing_time(two_area, AT_7, resolution=2 / 60, limit=1 / 3, observe=3.0).cycles == pytest.approx(8)


def test_unstable_at_zero_and_stable_at_the_limit_are_answers(two_area):
    at_limit = clearing_time(two_area, AT_7, limit="6cyc")
    assert (at_limit.cycles, at_limit.seconds, at_limit.status) == (None, None, "stable_at_limit")
    never = clearing_time(two_area, Contingency("7", trip="7-8", events="9:+300MW@1s"))
    assert (never.cycles, never.status, never.machine) == (None, "unstable_at_zero", 4)
    assert "even if cleared immediately" in str(never)


def test_other_events_keep_their_time_from_the_fault(two_area):
    late = Contingency("7", trip="7-8", at="2s", events="1@2s")
    early = Contingency("7", trip="7-8", at="1s", events="1@1s")
    before = Contingency("7", trip="7-8", at="1s", events="7:+1MW@0.2s")
    cycles = [clearing_time(two_area, one, longest=0).cycles for one in (late, early, before)]
    assert cycles[0] == cycles[1] == 4.375  # without machine 1, machine 2 is lost after 5 s even without a fault
    assert clearing_time(two_area, late).status == "unstable_at_zero"
    assert cycles[2] == 9
    assert Trial(two_area, before).at == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("one", "begins", "ends"),
    [
        (AT_7, 0.0, 0.1 + 0.3),
        (replace(AT_7, at="2s"), 0.0, 0.1 + 0.3),  # its own instant is ignored
        (Contingency("7", trip="7-8", at="1s", events="7:+1MW@1.5s"), 0.0, 0.5 + 0.3),
        (Contingency("7", trip="7-8", at="1s", events="7:+1MW@0.8s"), 0.2, 0.2 + 0.1 + 0.3),
        (Contingency("7", trip="7-8", at="1s", events=["7:+1MW@0.8s", "7:+1MW@1.5s"]), 0.2, 0.2 + 0.5 + 0.3),
    ],
)
def test_a_run_ends_when_fault_clearing_and_observation_are_over(two_area, one, begins, ends):
    trial = Trial(two_area, one, None, Search(0.5, 20.0, observed_s=0.3))
    run = trial.simulate(12, record=True)  # cleared after 6 cycles
    assert (trial.at, trial.cleared(12)) == pytest.approx((begins, begins + 0.1))
    assert run.time[-1] == pytest.approx(ends, abs=1e-9) == run.outcome.time_s
    assert trial.attempt(12).time_s == pytest.approx(ends - begins, abs=1e-9)
    faulted = np.abs(run.arrays.V[:, 6]) < 1e-3
    assert run.time[faulted].min() == pytest.approx(begins, abs=1e-9)
    assert run.time[faulted].max() == pytest.approx(begins + 0.1, abs=1e-2)


def test_an_estimator_sees_the_system_at_rest_first(stored):
    trial = Trial(stored, AT_7, EstimatorControl(), Search(0.5, 20.0, observed_s=0.3))
    assert (trial.at, trial.cleared(12)) == pytest.approx((0.5, 0.6))
    assert trial.simulate(12).outcome.time_s == pytest.approx(0.9)


def test_a_law_written_in_python_has_a_clearing_time(two_area):
    def steep(seen):
        return 1000 * seen["deviation"] * (seen.actual("voltage") > 0.8)

    reads = "deviation, voltage:5, voltage:6, voltage:11, voltage:10"
    law = Controller.from_function(steep, reads, "order")
    found = clearing_time(two_area, AT_7, storage="50MW", control=law, resolution="0.5cyc")
    assert found.cycles == 12.5


def test_the_result_shows_its_runs(two_area):
    found = clearing_time(two_area, AT_7)
    assert list(found.df.columns) == ["clearing_cycles", "stable", "outcome", "machine", "end_s"]
    assert found.df.set_index("clearing_cycles").stable[9.0]
    assert not found.df.set_index("clearing_cycles").stable[9.125]
    assert len(found.runs) <= 70  # 67   32 of them above the answer and 32 below
    assert found._repr_html_().startswith("<p>two_area, fault 7")


def test_table_4_of_the_paper_in_whole_cycles():
    case = io.load("wnaps_paper")
    flow = powerflow.solve(case)
    cycles = []
    for percent in (0, 5, 15, 20, 25, 30):
        devices = fleet.everywhere(case, f"{percent}%dispatch", flow, characteristic="conductance", lag=0.05)
        one = Contingency("83", trip="83-33")
        found = clearing_time(case, one, storage=devices, control=BangBang(), resolution="1cyc")
        assert found.machine == 14
        cycles.append(found.cycles)
    assert cycles == [5, 6, 7, 8, 8, 8]


@pytest.mark.parametrize("grid", [(0.0, 60), (-1, 60), (2, 1), (float("nan"), 60), (1, float("inf"))])
def test_impossible_grids_are_refused(grid):
    with pytest.raises(StudyError, match="resolution"):
        Search(*grid)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"resolution": "0.125"}, "is not a time"),
        ({"resolution": "0cyc"}, "resolution of 0 cycles"),
        ({"observe": "0s"}, "observation window of 0 s"),
        ({"observe": -1}, "observation window of -1 s"),
        ({"criterion": 3}, "is not a stability criterion"),
        ({"control": BangBang}, "is a class"),
        ({"control": BangBang()}, "needs storage devices to control"),
    ],
)
def test_what_makes_no_sense_is_refused(two_area, options, says):
    with pytest.raises(StudyError, match=says):
        clearing_time(two_area, AT_7, **options)


@pytest.mark.parametrize(
    ("what", "says"),
    [
        (Contingency(trip="7-8"), "has no fault, so it has no clearing time"),
        (Contingency("99"), "There is no bus 99"),
        ("7-9", "There is no branch 7-9"),
        (7, "is not a contingency"),
        ([AT_7], "is not a contingency"),
        (replace(AT_7, trip="7"), "is not a circuit"),
    ],
)
def test_impossible_contingencies_are_refused(two_area, what, says):
    with pytest.raises(StudyError, match=says):
        clearing_time(two_area, what)


def test_a_voltage_that_limits_has_a_bus():
    """That of the lowest unstable run, as a run of its own says."""
    point = initialize(io.load("wscc9").with_motors("30%", at=5, H=0.8))
    found = clearing_time(point, AT_7, resolution="0.5cyc")
    lowest = next(run for run in found.runs if not run.stable)
    alone = point.simulate(replace(AT_7, clear=f"{lowest.cycles}cyc"), until="4s").outcome
    assert (found.limited_by, found.machine, alone.bus) == ("voltage", None, lowest.bus)
    assert lowest.bus is not None
    assert found.limit == f"voltage at bus {lowest.bus}"
    assert f"limited by voltage at bus {lowest.bus}, not by loss of synchronism" in str(found)


def test_a_stable_run_is_observed_after_its_last_event(two_area):
    """Also where that is after clearing."""
    later = Contingency("7", trip="7-8", events="7:+1MW@1.5s")
    run = Trial(two_area, later, search=Search(observed_s=0.8)).attempt(24)
    assert run.stable
    assert run.observed_s == pytest.approx(0.8, abs=0.01)
    assert run.time_s == pytest.approx(0.5 + 0.8, abs=0.01)  # the fault begins at 1 s
