"""Stability need not be monotone: what is said of stable clearing times above an unstable one."""

from types import SimpleNamespace

import pytest

from stabctl import io
from stabctl.clearing import ClearingTime, Run, Search, clearing_time
from stabctl.clearing.critical_time import _multiple, critical
from stabctl.dynamics.operating_point import initialize
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.outcome import Kind
from stabctl.simulation.swings import Swings


def trial(stable, resolution, guess=10.0, limit=60.0, scan=4.0):
    """A system of which it is known whether a fault of so many cycles is stable."""
    search = Search(resolution, limit, scan_cycles=scan, above_cycles=scan)

    def attempt(k):
        cycles = k * resolution
        found = (True, Kind.STABLE, None, 5.0) if stable(cycles) else (False, Kind.LOST_SYNCHRONISM, 7, 1.0)
        return Run(cycles, *found)

    case = SimpleNamespace(name="known", frequency_hz=60.0)
    return SimpleNamespace(
        search=search,
        attempt=attempt,
        guess=lambda: int(guess / resolution),
        point=SimpleNamespace(case=case),
        contingency=Contingency("7"),
    )


def window(cycles):
    return cycles < 8.3 or 9.2 < cycles < 10.3


def second_swing(cycles):
    """A later swing is lost between 6.6 and 8.2 cycles."""
    return cycles < 6.6 or 8.2 < cycles < 11.1


@pytest.mark.parametrize("resolution", [0.125, 0.06, 0.01])
@pytest.mark.parametrize("guess", [2.0, 8.0, 20.0])
def test_a_stable_window_above_the_answer_is_found_and_said(resolution, guess):
    found = critical(trial(window, resolution, guess))
    assert found.cycles == pytest.approx(8.3, abs=resolution)
    assert found.lowest_unstable == pytest.approx(found.cycles + resolution)
    assert found.monotone is False
    assert all(9.2 < cycles < 10.3 for cycles in found.stable_above)
    assert len(found.stable_above) >= 2
    assert f"unstable at {found.lowest_unstable:g} cycles" in str(found)
    assert f"stable again at {found.stable_above[0]:g}" in str(found)


@pytest.mark.parametrize("resolution", [0.125, 0.06, 0.01])
def test_an_answer_above_a_lost_later_swing_is_not_given_on_any_grid(resolution):
    found = critical(trial(second_swing, resolution, 10.0))
    assert found.cycles == pytest.approx(6.6, abs=resolution)
    assert found.stable_above


def test_what_was_not_tried_is_unknown():
    assert critical(trial(lambda cycles: cycles < 8.3, 0.125, scan=0.0)).monotone is None
    assert critical(trial(lambda cycles: cycles < 8.3, 0.125)).monotone is True
    assert critical(trial(lambda cycles: True, 0.125)).lowest_unstable is None


def test_a_system_that_is_never_stable_takes_few_runs():
    found = critical(trial(lambda cycles: False, 0.125, 30.0))
    assert (found.status, found.lowest_unstable) == ("unstable_at_zero", 0.0)
    assert len(found.runs) <= 6


@pytest.mark.parametrize("fault", [Contingency("7", trip="7-8"), Contingency("7-8@0.4")])
def test_grids_in_seconds_and_in_cycles_agree_within_their_resolution(fault):
    base = initialize(io.load("two_area"))
    fine = clearing_time(base, fault, resolution="0.01cyc").cycles
    for resolution, cycles in (("0.001s", 0.06), ("0.125cyc", 0.125)):
        assert 0 <= fine + 0.01 - clearing_time(base, fault, resolution=resolution).cycles <= cycles + 0.01


def answer(*runs):
    return ClearingTime("x", Contingency("1"), "found", 2.0, 2 / 60, None, Search(), runs, 0.0)


def test_the_longest_stable_run_is_below_every_unstable_one():
    """A longer fault that is stable again says nothing about the answer."""
    runs = tuple(
        Run(k, stable, Kind.STABLE if stable else Kind.LOST_SYNCHRONISM, None, 5.0, stalled=(k,))
        for k, stable in ((1, True), (2, True), (3, False), (4, True), (5, False))
    )
    found = answer(*runs)
    assert (found.longest_stable.cycles, found.stalled) == (2, (2,))
    assert (found.lowest_unstable, found.stable_above) == (3, (4,))


def test_the_longest_observation_of_a_stable_run_is_said():
    stable = [Run(k, True, Kind.STABLE, None, k, observed_s=seconds) for k, seconds in ((0, 5.0), (1, 12.5), (2, 9.0))]
    found = answer(*stable, Run(3, False, Kind.LOST_SYNCHRONISM, 1, 1.0, observed_s=19.0))
    assert found.observed_s == 12.5
    assert "(observed 5 to 12.5 s after clearing, 4 runs)" in str(found)
    assert answer(stable[0]).observed_s == 5.0
    assert answer().observed_s == Search().observed_s


@pytest.mark.parametrize(("last", "before", "how"), [(0.3, 0.3, ""), (2.0, 2.0, "do not decay"), (2.0, 0.5, "grow")])
def test_large_swings_that_last_are_said_and_small_ones_are_not(last, before, how):
    swings = Swings(1, last, before, 1, last, before, 2.5, 0.9)
    found = answer(Run(2, True, Kind.STABLE, None, 5.0, swings=swings, observed_s=5.0))
    assert swings.settled == (not how)
    assert swings.lasting or swings.growing
    assert found.remark().partition(" within")[0] == (f"Its swings {how}" if how else "")


def test_a_limit_between_two_points_of_the_grid_is_the_last_of_them():
    """Of 0 and 7 cycles, 7 is the longest that was tried."""
    found = clearing_time(
        io.load("two_area"), "7-8@0.4", limit="10cyc", resolution="7cyc", scan=0, longest=0, observe="1s"
    )
    assert (found.status, found.reach_cycles) == ("stable_at_limit", 7.0)
    assert "search limit of 7 cycles" in str(found)
    assert found.window() == ""


def test_points_of_a_coarse_grid_are_tried_first_and_the_nearest_of_them():
    for low, high in ((-1, 9), (3, 17), (4, 6), (0, 40), (7, 8)):
        for spacing in (1, 2, 3, 8):
            inside = [m for m in range(-spacing, high + spacing) if m % spacing == 0 and low < m < high]
            for k in range(low + 1, high):
                found = _multiple(k, low, high, spacing)
                least = min((abs(m - k) for m in inside), default=0)
                assert (found in inside and abs(found - k) == least) if inside else found == k
