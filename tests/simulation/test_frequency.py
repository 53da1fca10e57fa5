"""Frequency is judged: an island whose frequency stays outside the range of the criterion is unstable."""

from dataclasses import replace

import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import LoadStep, Open
from stabctl.simulation.simulate import simulate
from stabctl.simulation.simulation import run

SPLIT = [Open(f"7-8#{k}", 0.5) for k in (1, 2)]  # area 1 of two_area has 413 MW too many


@pytest.fixture(scope="module")
def ungoverned(cases):
    """two_area with a governor in area 2 only: after a loss of balance in area 1 its frequency moves on."""
    case = cases("two_area")
    return operating_point.solve(replace(case, devices=dict(case.devices) | {"tgov": {4: case.devices["tgov"][4]}}))


def test_without_any_governor_frequency_is_judged_only_if_asked_for(cases):
    point = operating_point.solve(cases("two_area").classical())
    shed = [LoadStep(9, 0.5, -800.0)]
    told = "until 8.000 s, outside 57 to 62 Hz, which is not checked without a governor; frequency 60.00 "
    assert told in run(point, shed, 8.0, criterion=Criterion(decay=0)).outcome.message
    for other in ({"max_frequency": "61.9Hz"}, {"min_frequency": "56.9Hz"}, {"frequency_delay_s": "0.9s"}):
        assert simulate(point, shed, 8.0, criterion=Criterion(**other)).outcome.kind == "frequency_instability", other


@pytest.mark.parametrize("high", [62, 61])
def test_an_island_out_of_range_is_unstable_and_the_verdict_says_limits_and_island(ungoverned, high):
    low = 57
    traced = simulate(ungoverned, SPLIT, 20.0, criterion=Criterion(max_frequency=f"{high}Hz"))
    end, hz = traced.outcome, 60 * traced.arrays.speed
    assert (end.kind, end.stable, end.machine) == ("frequency_instability", False, None)
    assert f"was outside {low} to {high} Hz for 1 s at {end.time_s:.3f} s" in end.message
    H = ungoverned.inertia
    of_area = hz[:, :2] @ H[:2] / H[:2].sum(), hz[:, 2:] @ H[2:] / H[2:].sum()
    left = [np.argmax((f < low) | (f > high)) for f in of_area if ((f < low) | (f > high)).any()]
    assert end.time_s - traced.time[min(left)] == pytest.approx(1.0, abs=2 * traced.step)
    machines = "1, 2" if of_area[0][-1] > high else "3, 4"
    assert f"island of machines {machines}" in end.message


def test_the_range_and_its_delay_are_settable_and_0_turns_the_judgement_off(ungoverned):
    ends = {
        delay: simulate(ungoverned, SPLIT, 12.0, criterion=Criterion(frequency_delay_s=delay)).outcome
        for delay in ("500ms", "1s", 0)
    }
    assert ends["1s"].time_s - ends["500ms"].time_s == pytest.approx(0.5, abs=1.5 / 120)  # ends with a step
    assert ends[0].stable
    assert "Every island stayed in synchronism until 12.000 s; frequency " in ends[0].message
    assert "; final frequencies " in ends[0].message


def test_a_run_that_left_the_range_briefly_says_how_long_and_one_that_did_not_says_nothing_of_it(ungoverned):
    back = [LoadStep(9, 0.5, -800.0), LoadStep(9, 1.5, 1600.0), LoadStep(9, 2.3, -800.0)]
    narrow = Criterion(max_frequency="60.5Hz")
    assert "57 to 62 Hz" not in run(ungoverned, back, 4.0).outcome.message
    traced = simulate(ungoverned, back, 4.0, criterion=narrow)
    H = ungoverned.inertia
    above = 60 * traced.arrays.speed @ H / H.sum() > 60.5
    longest = max(len(stretch) for stretch in "".join("x" if one else " " for one in above).split())
    assert traced.outcome.stable
    assert f"outside 57 to 60.5 Hz for {longest * traced.step:.2g} s at most" in traced.outcome.message


def test_the_system_of_50_hz_has_the_range_of_50_hz(cases):
    case = replace(cases("two_area"), frequency_hz=50.0)
    narrow = Criterion(max_frequency="50.5Hz", frequency_delay_s=9.0)
    assert "outside 47.5 to 50.5 Hz for " in simulate(case, SPLIT, 3.0, criterion=narrow).outcome.message


def test_a_machine_alone_in_its_island_is_tripped_and_the_rest_is_judged(points):
    end = run(points("two_area"), [Open("1-5", 0.5)], 3.0).outcome
    assert "Machine 1, alone in its island, was outside 57 to 62 Hz for 1 s at " in end.message
    assert (end.kind, end.stable) == ("islanded", True)


@pytest.mark.parametrize(
    "wrong",
    [{"min_frequency": 57}, {"max_frequency": 0.9}, {"frequency_delay_s": -1}, {"slowest": 1.1}, {"fastest": 0.9}],
)
def test_a_range_without_the_rated_frequency_is_refused(points, wrong):
    with pytest.raises(StudyError):
        simulate(points("two_area"), None, 1.0, criterion=Criterion(**wrong))


def test_the_clearing_times_of_the_paper_do_not_depend_on_it(cases):
    """Section 5, case 1: 20.375 cycles without storage and 26 with 50 MW at every machine."""
    base = operating_point.solve(cases("two_area"))
    stored = base.case.with_storage("50MW")
    fault = Contingency("7-8@0.4")
    assert base.clearing_time(fault).cycles == 20.375
    assert stored.clearing_time(fault, control=BangBang()).cycles == 26.0
