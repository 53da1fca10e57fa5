"""The measures, on records made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.dynamics.operating_point import initialize
from stabctl.estimation.estimate import estimate
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.pmu import Pmu
from stabctl.simulation.contingency import Contingency


@pytest.fixture(scope="module")
def blank(study):
    found = estimate(study("two_area classical")[0], (), 5)
    t = found.time[:, None, None]
    wave = 0.005 * np.sin(2 * np.pi * (t + np.arange(4) / 7))
    return replace(found, deviation=wave, deviation_estimated=wave.copy()), t


@pytest.mark.parametrize("late", [-30.0, 0.0, 7.0, 25.0])
def test_delay_is_found(blank, late):
    found, t = blank
    shifted = 0.005 * np.sin(2 * np.pi * (t - late / 1e3 + np.arange(4) / 7))
    assert replace(found, deviation_estimated=shifted).accuracy_between(0.5, 4.5).delay_ms == pytest.approx(
        late, abs=0.2
    )


@pytest.mark.parametrize("still", [True, False])
def test_a_delay_beyond_the_search_is_unknown(blank, still):
    found, t = blank
    late = np.zeros(found.deviation.shape) if still else 0.005 * np.sin(2 * np.pi * (t - 0.2 + np.arange(4) / 7))
    true = late if still else found.deviation
    accuracy = replace(found, deviation=true, deviation_estimated=late).accuracy_between(0.5, 4.5)
    assert np.isnan(accuracy.delay_ms)
    assert "delay unknown, " in str(accuracy)


def test_errors_are_those_of_a_known_offset(blank):
    found, _ = blank
    accuracy = replace(found, deviation_estimated=found.deviation + 0.02 / 60).accuracy_between(0, 5)
    assert accuracy.rmse_mhz == pytest.approx(20)
    assert accuracy.p99_mhz == pytest.approx(20)


def test_wrong_and_opposite_commands_are_counted(blank):
    found, _ = blank
    seen = found.deviation.copy()
    band = 0.1 / 60
    strong = np.argwhere(np.abs(found.deviation) > 1.5 * band)
    for k in strong[:6]:
        seen[tuple(k)] = 0.0
    for k in strong[6:10]:
        seen[tuple(k)] *= -1
    accuracy = replace(found, deviation_estimated=seen).accuracy_between(0, 6)
    assert accuracy.wrong_command_share == pytest.approx(10 / seen.size)
    assert accuracy.opposite_command_share == pytest.approx(4 / seen.size)


def test_the_commands_of_estimates_are_those_that_the_storage_gets(study):
    """Also after an outage, when the devices idle: for 2 s, where reports were lost across the switching."""
    point, events, cleared, _ = study("two_area")
    control = EstimatorControl(pmu=Pmu(outage=("1s", "1.5s")))
    found = estimate(point, Contingency("7", "6cyc", "7-8"), 4.5, control=control)
    assert np.array_equal(np.sign(found.orders), found.estimated_commands)
    silent = (found.time > 1.02) & (found.time < 3.48)
    assert not found.usable[silent & (found.time > 1.52)].any()
    assert found.usable[found.time > 3.6].any()
    wrong = found.accuracy_between(1.52, 3.48).wrong_command_share
    assert wrong == np.mean(found.true_commands[(found.time >= 1.52) & (found.time <= 3.48)] != 0)


def test_machines_that_are_off_do_not_count(blank):
    found, _ = blank
    seen, on = found.deviation.copy(), found.on.copy()
    seen[:, :, 2], on[:, :, 2] = 1.0, False
    assert replace(found, deviation_estimated=seen, on=on).accuracy_between(0, 5).rmse_mhz == 0


def test_true_and_estimated_speeds_are_of_the_same_instant(study):
    """Also with a filter of M class, whose reports are three frames old."""
    point, events, cleared, _ = study("two_area classical")
    found = estimate(point, events, 4, control=EstimatorControl(pmu=Pmu.exact(filter_class="M")))
    later = found.time > cleared + 0.3
    error = (found.estimated - found.slip)[later]
    assert np.mean(error**2) < 6 * np.mean(found.slip_sigma[later] ** 2)


def test_nothing_to_judge_is_a_sentence(blank):
    with pytest.raises(StudyError, match="in synchronism between"):
        replace(blank[0], on=np.zeros_like(blank[0].on)).accuracy_between(2, 3)


def test_times_in_the_wrong_order_are_a_sentence(blank):
    with pytest.raises(StudyError, match=r"between 1\.5 and 1\.1 s; give the earlier time first"):
        blank[0].accuracy_between("1.5s", "1.1s")


def test_a_run_without_any_usable_speed_says_so(study):
    """Machines 1 and 2 are more than 30 % of the inertia, and cannot both be computed."""
    point, few = study("two_area")[0], Pmu(missing=(1, 2))
    found = estimate(point, None, 0.2, pmu=few)
    assert not found.usable.any()
    more = "; give more PMUs, or better ones."
    assert str(found).endswith(f"No speed was usable in the whole run, so that all storage idled{more}")
    alone = initialize(point.case.with_storage("none"))
    assert str(estimate(alone, None, 0.2, pmu=few)).endswith(f"No speed was usable in the whole run{more}")
    assert "usable" not in str(estimate(point, None, 0.2))


def test_records_do_not_change(study):
    found = estimate(study("two_area classical")[0], (), 0.2)
    with pytest.raises(ValueError, match="read-only"):
        found.slip[0] = 0
    assert "kalman estimator" in str(found)


def test_a_run_that_ends_before_clearing_says_when_both_are(blank):
    """Such as a clearing time of 6, in seconds, that was meant in cycles."""
    late = replace(blank[0], cleared_s=7.0)
    with pytest.raises(StudyError, match=r"end at 4.983 s, .* last event, at 7 s \(420 cycles\)"):
        _ = late.accuracy
    assert replace(blank[0], cleared_s=4.0).accuracy.rmse_mhz == 0


def test_a_time_after_the_end_has_no_frame(blank):
    with pytest.raises(StudyError, match=r"no frame between 7 and 8 s; the estimates are from 0 to 4.98"):
        blank[0].accuracy_between(7, 8)
