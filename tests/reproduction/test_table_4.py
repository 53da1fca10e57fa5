"""Table 4 of the paper: which of the assumptions that the paper does not state give its numbers."""

from itertools import product

import pytest

import stabctl as st

PERCENT = {0: 5, 5: 6, 15: 7, 20: 8, 25: 8, 30: 8}  # of dispatch -> whole cycles
ASSUMED = list(product(("power", "current", "conductance"), ("0s", "50ms", "100ms"), ("5s", "20s")))


@pytest.mark.slow
@pytest.mark.parametrize(("characteristic", "lag", "observe"), ASSUMED)
def test_constant_conductance_with_50_ms_gives_it_and_the_others_do_not(characteristic, lag, observe):
    case, fault = st.load("wnaps_paper"), st.Contingency("83", trip="83-33")
    how = {"control": st.BangBang(), "resolution": "1cyc", "observe": observe}
    fleets = {p: case.with_storage(f"{p}%dispatch", characteristic=characteristic, lag=lag) for p in PERCENT}
    found = {p: fleet.clearing_time(fault, **how).cycles for p, fleet in fleets.items()}
    wrong = [abs(found[p] - PERCENT[p]) for p in PERCENT if found[p] != PERCENT[p]]
    assert (wrong == []) == (characteristic == "conductance" and lag == "50ms")
    assert len(wrong) <= 3
    assert all(cycles == 1 for cycles in wrong)
