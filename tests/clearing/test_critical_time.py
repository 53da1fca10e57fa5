"""Critical clearing times: the search, and the paper's Table 4."""

import pytest

from stabctl import io
from stabctl.clearing.critical_time import _search, clearing_time
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.errors import StudyError
from stabctl.model import fleet, powerflow


def survivors(critical, also=()):
    """A system that survives up to `critical`, and the numbers in `also`; and the list of what it was asked."""
    asked = []

    def survives(k):
        asked.append(k)
        return k <= critical or k in also

    return survives, asked


@pytest.mark.parametrize("critical", [*range(12), 31, 32, 33, 63, 64, 65, 478, 479])
@pytest.mark.parametrize("resolution", [0.125, 1.0])
def test_search_finds_the_last_survivor(critical, resolution):
    survives, _ = survivors(critical)
    assert _search(survives, 480, resolution) == (critical, "found")


def test_search_asks_few_questions():
    survives, asked = survivors(73)
    _search(survives, 480, 0.125)
    assert len(asked) <= 11


def test_unstable_at_zero_and_stable_at_the_limit_are_answers():
    assert _search(survivors(-1)[0], 480, 0.125) == (0, "unstable_at_zero")
    assert _search(survivors(999)[0], 480, 0.125) == (480, "stable_at_limit")
    assert _search(survivors(999)[0], 60, 1.0) == (60, "stable_at_limit")


@pytest.fixture(scope="module")
def two_area():
    case = io.load("two_area")
    stored = case.with_storage(fleet.everywhere(case, "50MW"))
    return operating_point.solve(case), operating_point.solve(stored)


def test_two_area_fault_at_bus_7(two_area):
    bare, stored = two_area
    without = clearing_time(bare, "7", ["7-8"])
    held = clearing_time(stored, "7", ["7-8"], BangBang())
    assert without.cycles == 9.0
    assert held.cycles == 12.25
    assert without.monotone
    assert "9 cycles" in str(without)
    assert "observed 5 s" in str(without)


def test_the_value_is_stable_and_the_next_is_not(two_area):
    found = clearing_time(two_area[0], "7-8@0.3", resolution_cycles=0.25)
    by_cycles = {r.cycles: r.stable for r in found.runs}
    assert by_cycles[found.cycles]
    assert not by_cycles[found.cycles + 0.25]


def test_longer_observation_never_helps(two_area):
    short = clearing_time(two_area[0], "7", ["7-8"], observed_s=1.0)
    assert short.cycles >= clearing_time(two_area[0], "7", ["7-8"], observed_s=5.0).cycles


def test_clearing_does_not_depend_on_what_was_searched_before(two_area):
    first = clearing_time(two_area[1], "7-8@0.4", control=BangBang())
    clearing_time(two_area[1], "8-9@0.5", control=BangBang(0.0, 0.0))
    again = clearing_time(two_area[1], "7-8@0.4", control=BangBang())
    assert [r[:4] for r in first.runs] == [r[:4] for r in again.runs]


def test_table_4_of_the_paper_in_whole_cycles():
    case = io.load("wnaps_paper")
    flow = powerflow.solve(case)
    cycles = []
    for percent in (0, 5, 15, 20, 25, 30):
        devices = fleet.everywhere(case, f"{percent}%dispatch", flow, characteristic="conductance", lag=0.05)
        found = clearing_time(operating_point.solve(case.with_storage(devices), flow), "83", ["83-33"], BangBang(), 1.0)
        assert found.machine == 14
        cycles.append(found.cycles)
    assert cycles == [5, 6, 7, 8, 8, 8]


@pytest.mark.parametrize("grid", [(0.0, 60), (-1, 60), (2, 1), (float("nan"), 60), (1, float("inf"))])
def test_impossible_grids_are_refused(two_area, grid):
    with pytest.raises(StudyError, match="resolution"):
        clearing_time(two_area[0], "7", resolution_cycles=grid[0], limit_cycles=grid[1])
