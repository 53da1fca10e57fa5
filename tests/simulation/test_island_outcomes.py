"""Islands that a network had from the beginning are no event; each keeps its own center of inertia and frequency."""

import numpy as np
import pytest
from islands import SHIFT, joined

import stabctl as st

FAULT = st.Contingency("7-8@0.4", clear="6cyc")
LAWS = [None, st.BangBang(), st.Feedback(0.05), st.Feedback(0.05, 0.01, min_voltage=0.0)]


@pytest.fixture(scope="module")
def both():
    return joined(st.load("two_area"), st.load("wscc9")).initialize(storage="50MW")


@pytest.fixture(scope="module")
def alone():
    return st.load("two_area").initialize(storage="50MW")


@pytest.mark.parametrize("law", LAWS)
def test_a_run_is_that_of_the_island_with_the_fault(both, alone, law):
    run, one = (point.simulate(FAULT, "3s", control=law, step=1 / 240) for point in (both, alone))
    assert np.abs(run.arrays.angle[:, :4] - one.arrays.angle).max() < 1e-7  # 9e-9
    assert np.abs(run.arrays.speed[:, 4:] - 1).max() < 1e-9
    assert run.outcome.kind == "stable"
    said = str(run.outcome)
    assert "cut off" not in said
    assert "unstable at rest" not in said
    assert " Hz in the island of machine 1, 60.00 Hz in the island of machine 1001" in said


def test_so_is_a_clearing_time(both, alone):
    found, one = (point.clearing_time("7-8@0.4") for point in (both, alone))
    assert str(found).partition(":")[2] == str(one).partition(":")[2]


def test_lost_synchronism_is_judged_in_its_island(both):
    end = both.simulate(st.Contingency("7-8@0.4", clear="30cyc")).outcome
    assert end.kind == "lost_synchronism"
    assert "relative to the center of inertia of its island" in str(end)
    assert "cut off" not in str(end)


def test_what_a_switching_cuts_off_is_said_of_each_island(both):
    opened = [st.Open("1004-1006", 0.5), st.Open("1006-1009", 0.5)]
    end = both.simulate(opened, "2s").outcome
    assert end.kind == "islanded"
    assert str(end).startswith(
        "The switching cut off bus 1006 without a machine or grid-forming converter: blacked out"
    )
    split = both.simulate([*opened, st.Open("7-8", 0.5), st.Open("7-8#2", 0.5)], "2s").outcome
    assert "cut off buses" in str(split)
    assert "with machines" in str(split)


def test_an_island_that_loses_its_machines_is_blacked_out(both):
    tripped = [st.TripMachine(number + SHIFT, 0.5) for number in (1, 2, 3)]
    end = both.simulate(tripped, "2s").outcome
    assert end.kind == "islanded"
    assert "without a machine or grid-forming converter: blacked out, its load lost" in str(end)
    assert f"bus {SHIFT + 1}" in str(end) or f"buses {SHIFT + 1}" in str(end)
