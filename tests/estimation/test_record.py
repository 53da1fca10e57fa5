"""The measures, on records made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from stabctl.errors import StudyError
from stabctl.estimation.loop import Driven, watch


@pytest.fixture(scope="module")
def blank(study):
    found = watch(study("two_area classical")[0], (), 5, Driven(engine="batched"))
    t = found.time[:, None, None]
    wave = 0.005 * np.sin(2 * np.pi * (t + np.arange(4) / 7))
    return replace(found, deviation=wave, deviation_estimated=wave.copy()), t


@pytest.mark.parametrize("late", [-30.0, 0.0, 7.0, 25.0])
def test_delay_is_found(blank, late):
    found, t = blank
    shifted = 0.005 * np.sin(2 * np.pi * (t - late / 1e3 + np.arange(4) / 7))
    assert replace(found, deviation_estimated=shifted).score(0.5, 4.5).delay_ms == pytest.approx(late, abs=0.2)


def test_errors_are_those_of_a_known_offset(blank):
    found, _ = blank
    score = replace(found, deviation_estimated=found.deviation + 0.02 / 60).score(0, 5)
    assert score.rmse_mhz == pytest.approx(20)
    assert score.p99_mhz == pytest.approx(20)


def test_wrong_and_opposite_commands_are_counted(blank):
    found, _ = blank
    seen = found.deviation.copy()
    band = 0.1 / 60
    strong = np.argwhere(np.abs(found.deviation) > 1.5 * band)
    for k in strong[:6]:
        seen[tuple(k)] = 0.0
    for k in strong[6:10]:
        seen[tuple(k)] *= -1
    score = replace(found, deviation_estimated=seen).score(0, 6)
    assert score.wrong_command_share == pytest.approx(10 / seen.size)
    assert score.opposite_command_share == pytest.approx(4 / seen.size)


def test_machines_that_are_off_do_not_count(blank):
    found, _ = blank
    seen, on = found.deviation.copy(), found.on.copy()
    seen[:, :, 2], on[:, :, 2] = 1.0, False
    assert replace(found, deviation_estimated=seen, on=on).score(0, 5).rmse_mhz == 0


def test_nothing_to_judge_is_a_sentence(blank):
    with pytest.raises(StudyError, match="No frame lies between"):
        blank[0].score(90, 95)


def test_records_do_not_change(study):
    found = watch(study("two_area classical")[0], (), 0.2, Driven(engine="batched"))
    with pytest.raises(ValueError, match="read-only"):
        found.slip[0] = 0
    assert "kalman estimator" in str(found)
