"""Limits and score of a storage law."""

import pytest

from stabctl._util.errors import StudyError
from stabctl.controllers import StorageLaw
from stabctl.design.law import AXES, _neighbors
from stabctl.design.law_measurement import Duty, Later, Measured
from stabctl.design.law_result import MEAN, SHORT, LawLimits


def reached(cycles, *, energy=0.0, switchings=0, coi=0.0, voltage=1.0, later=None):
    return Measured(cycles, "found", 1, 7, Duty(energy, switchings, coi, voltage), later)


def test_the_score_is_the_median_gain_and_a_tenth_of_the_mean():
    reference = [reached(10.0), reached(20.0), reached(30.0)]
    found = [reached(11.0), reached(22.0), reached(36.0)]
    assert LawLimits().score(found, reference) == pytest.approx(2.0 + MEAN * 3.0)


def test_a_contingency_below_the_reference_costs_more_than_it_gains_elsewhere():
    reference = [reached(10.0)] * 3
    level = LawLimits().score([reached(11.0)] * 3, reference)
    assert LawLimits().score([reached(14.0), reached(12.0), reached(9.0)], reference) < level - SHORT / 2


def test_of_equal_laws_the_one_with_less_energy_is_better():
    reference = [reached(10.0, energy=5.0)]
    scores = [LawLimits().score([reached(11.0, energy=e)], reference) for e in (5.0, 9.0)]
    assert scores[0] > scores[1]


@pytest.mark.parametrize(
    ("limits", "found", "by"),
    [
        ({"energy": "10kWh"}, {"energy": 15.0}, 0.5),
        ({"switchings": 2}, {"switchings": 4}, 1.0),
        ({"coi": "300mHz"}, {"coi": 0.36}, 0.2),
        ({"voltage": 0.9}, {"voltage": 0.81}, 0.1),
        ({}, {"energy": 10.0, "later": Later(True, 10.0, 1.0)}, 1.0),
        ({}, {"energy": 10.0, "later": Later(False, 10.0, 0.0)}, 1.0),
        ({}, {"energy": 10.0, "later": Later(True, 10.0, 0.4)}, 0.0),
        ({"energy": "10kWh"}, {"energy": 9.0, "later": Later(True, 12.0, 0.0)}, 0.2),
    ],
)
def test_what_is_exceeded_is_relative_to_the_limit(limits, found, by):
    limits, found = LawLimits(**limits), reached(10.0, **found)
    assert limits.exceeded(found) == pytest.approx(by)
    assert limits.kept([found]) is (by == 0)
    if by:
        assert limits.score([found], [reached(5.0, energy=10.0)]) < 0


@pytest.mark.parametrize("wrong", [{"energy": -1.0}, {"switchings": 2.5}, {"coi": "3MW"}, {"deadband": float("nan")}])
def test_wrong_limits(wrong):
    with pytest.raises(StudyError, match=next(iter(wrong))):
        LawLimits(**wrong)


@pytest.mark.parametrize("deadband", [0.15, 0.17])
def test_a_smallest_deadband_between_the_levels_has_neighbors(deadband):
    start = StorageLaw(deadband=deadband, arm_at=deadband)
    levels = [one.arm_at for one in _neighbors(start, "arm_at", AXES["arm_at"], 1)]
    assert levels == [0.2]  # the next one above; that below would be smaller than the deadband
