"""Which rows of a run are kept."""

import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.simulation import recording, swings
from stabctl.simulation.contingency import Contingency

FAULT = Contingency("7", "6cyc", ["7-8"])


def test_fewer_rows_are_some_of_all_rows(points):
    whole, some = (points("two_area").simulate(FAULT, 5, every=every) for every in (0.0, "50ms"))
    kept = np.searchsorted(whole.time, some.time)
    assert np.array_equal(whole.time[kept], some.time)
    assert np.array_equal(whole.rows[kept], some.rows)
    assert some.time[-1] == 5
    assert {1.0, 1.1} <= set(np.round(some.time, 9))  # the fault begins and ends
    apart = np.diff(some.time)
    assert (apart > 0.05 - 1e-9).sum() >= len(apart) - 3  # but before the two events and the end
    assert apart.max() < 0.05 + 1 / 120 + 1e-9
    assert some.outcome == whole.outcome


def test_the_number_of_steps_per_call_changes_nothing_that_is_kept(points, monkeypatch):
    """The prediction of the voltages begins anew in every call, so results differ by the tolerance of the voltages."""
    whole = points("wnaps").simulate(Contingency("83", "4cyc", ["83-33"]), 5)
    width = points("wnaps").layout.first_memory
    monkeypatch.setattr(recording, "BUFFER", 8.0 * width * 7)
    pieces = points("wnaps").simulate(Contingency("83", "4cyc", ["83-33"]), 5)
    assert np.array_equal(whole.time, pieces.time)
    assert np.abs(whole.arrays.speed - pieces.arrays.speed).max() < 1e-7  # 1e-9
    assert pieces.outcome.kind == whole.outcome.kind
    assert pieces.outcome.swings.last == pytest.approx(whole.outcome.swings.last, rel=1e-6)


def test_without_a_record_only_the_last_angles_are_held(points):
    point = points("two_area")
    record = recording.Recording(point, False, 10**6, every=0.0, span=swings.SPAN)
    for start in range(100):
        record.add(start + np.arange(10) / 10, np.zeros((10, record.width)))
    angles, middle = record.angles(0.0, 98.0)
    assert len(angles) <= 10 * (swings.SPAN + 2)
    assert len(angles) - middle == 20  # rows from 98.0 to 99.9 s
    assert record.kept(3)[1].shape == (0, 3)


@pytest.mark.parametrize("rows", [1, 7, 30, 400, 2000])
def test_all_angles_of_the_last_seconds_are_held_however_many_rows_come_at_once(points, rows):
    point = points("two_area")
    record = recording.Recording(point, False, 10**6, every=0.0, span=swings.SPAN)
    times = np.arange(1200) / 100
    signals = np.random.default_rng(0).normal(size=(len(times), record.width))
    for start in range(0, len(times), rows):
        record.add(times[start : start + rows], signals[start : start + rows])
    begin = times[-1] - swings.SPAN
    angles, middle = record.angles(begin, times[-1] - 1.0)
    assert np.array_equal(angles, signals[times > begin - 1e-9][:, point.rotors.angle])
    assert len(angles) - middle == 101


def test_an_interval_that_is_not_one_is_refused(points):
    with pytest.raises(StudyError, match="every = -1 s is not allowed"):
        points("two_area").simulate(FAULT, 5, every=-1)


def test_an_interval_far_below_a_step_keeps_every_row(points):
    """It once never ended."""
    every, all_rows = (points("two_area").simulate(until=0.1, every=interval) for interval in (1e-9, 0))
    assert np.array_equal(every.time, all_rows.time)
