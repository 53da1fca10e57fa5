"""Fleets that a siting starts from."""

import numpy as np
import pytest

import stabctl as st
from stabctl.dynamics import operating_point
from stabctl.model import fleet
from stabctl.placement.trials import Trials

ASKED = [("8", "10cyc", "7-8"), ("7", "8cyc", "7-8"), ("8", "12cyc", "8-9")]
SIZES = np.arange(0.0, 151.0, 5.0)  # MW


@pytest.fixture(scope="module")
def point():
    case = st.load("wscc9").classical()
    return operating_point.solve(case.with_storage(fleet.everywhere(case, "150MW")))


@pytest.mark.slow
@pytest.mark.parametrize("most", [None, 1])
@pytest.mark.parametrize("asked", ASKED, ids=lambda asked: f"{asked[0]} trip {asked[2]}")
def test_no_single_device_is_smaller_than_what_is_found(point, asked, most):
    """Also where a uniform fleet survives, and nothing between it and the device alone is smaller than it."""
    bus, clear, trip = asked
    one = st.Contingency(bus, clear=clear, trip=trip)
    trials = Trials(point, [one], np.full(3, 150.0))
    alone = min(mw for mw in SIZES for i in range(3) if trials.survives(mw * np.eye(3)[i], 0))
    found = st.place(st.load("wscc9").classical(), [one], cap="150MW", sites=most)
    assert 0 < found.total_mw <= 1.002 * alone


@pytest.mark.slow
def test_a_linear_allocation_is_scaled_from_any_multiple_that_survives(point):
    """8 trip 7-8: the largest multiple does not, 38 MW do."""
    bus, clear, trip = ASKED[0]
    one = st.Contingency(bus, clear=clear, trip=trip)
    found = st.place(st.load("wscc9").classical(), [one], cap="250MW")
    assert found.linear_mw == pytest.approx(38.1, abs=0.5)
    assert found.total_mw <= found.linear_mw <= found.uniform_mw
