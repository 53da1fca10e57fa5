"""Scenarios: operating points, outages of devices, trips of machines; tables of sites; sizes in modules."""

import json
from dataclasses import replace

import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import CaseError, StudyError
from stabctl.controllers import BangBang
from stabctl.model.loads import with_load_level
from stabctl.placement.contingencies import Scenario, operating_points, scenarios
from stabctl.placement.place import place
from stabctl.placement.sensitivity import sensitivity
from stabctl.placement.site_options import SiteOption, read, sites
from stabctl.placement.trials import Trials
from stabctl.simulation.contingency import Contingency

NEAR_9 = Contingency("29", 4.75 / 60, "26-29")
TRIP = Contingency(events="8@1s", name="trip of 8")


@pytest.fixture(scope="module")
def case(cases):
    return cases("ieee39").classical()


@pytest.fixture(scope="module")
def levels(case):
    return {"light": case.with_load_level(0.95), "heavy": case.with_load_level(1.02)}


@pytest.fixture(scope="module")
def alone(case):
    """One device at bus 29, for the fault near machine 9."""
    return place(case, [NEAR_9], candidates=[(9, 29)], observe=2.0)


def survives(case, fleet, one):
    """A run of this fleet beside the case's own devices, through the public records alone."""
    point = case.with_storage((*case.storage, *fleet)).initialize()
    until = (one.clear or 1.0) + 2.0
    return point.simulate(replace(one, at=0.0) if one.fault else one, until, control=BangBang()).outcome.stable


def test_a_load_level_scales_loads_and_dispatch(case):
    light = with_load_level(case, 0.9)
    assert sum(load.p for load in light.loads) == pytest.approx(0.9 * sum(load.p for load in case.loads))
    assert [m.p for m in light.machines] == pytest.approx([0.9 * m.p for m in case.machines])
    assert with_load_level(case, 1) == case
    for level in (0, -1, np.nan, 11, "1", True):
        with pytest.raises(StudyError, match="load level"):
            case.with_load_level(level)


def test_operating_points_have_names_and_the_same_places(case, levels):
    assert list(operating_points(case)) == ["ieee39"]
    assert list(operating_points([case, case.initialize()])) == ["ieee39", "ieee39#2"]
    assert list(operating_points(levels)) == ["light", "heavy"]
    for wrong, words in (
        ([], "no operating point"),
        (7, "7 is not a system"),
        ("ieee39", "is not a system"),
        ({"a": case, "b": case.trip_machine(5)}, "a and b differ in their machines"),
        ([case, case.with_storage("5MW")], "differ in their existing storage"),
    ):
        with pytest.raises(StudyError, match=words):
            operating_points(wrong)


def test_scenarios_are_every_combination():
    every = scenarios((NEAR_9, TRIP), 3, devices=2)
    assert len(every) == len(set(every)) == 2 * 3 * 3
    assert {s.out for s in every} == {None, 0, 1}
    assert scenarios((NEAR_9,), 1) == (Scenario(NEAR_9),)


@pytest.mark.slow
def test_a_fleet_survives_at_every_operating_point(case, levels):
    found = {name: place(one, [NEAR_9], candidates=[(9, 29)], observe=2.0) for name, one in levels.items()}
    both = place(levels, [NEAR_9], candidates=[(9, 29)], observe=2.0)
    assert found["light"].total_mw < found["heavy"].total_mw  # 18.1, 60.0
    assert both.total_mw == pytest.approx(found["heavy"].total_mw, rel=2e-3)
    assert [c.operating_point for c in both.contingencies] == ["light", "heavy"]
    assert [c.binding for c in both.contingencies] == [False, True]
    assert "29 trip 26-29, heavy" in str(both)
    assert "survive 2 scenarios" in str(both)
    assert all(survives(one, both.storage(), NEAR_9) for one in levels.values())


@pytest.mark.slow
def test_a_fleet_survives_without_any_one_device(case):
    places = [(9, 29), (9, 28)]
    found = place(case, [NEAR_9], candidates=places, outages=True, observe=2.0)
    assert len(found.sites) == 2
    assert {c.out for c in found.contingencies} == {"", "9@29", "9@28"}
    assert all(c.stable for c in found.contingencies)
    for kept in found.storage():
        assert survives(case, [kept], NEAR_9)
    without = place(case, [NEAR_9], candidates=places, observe=2.0)
    assert without.total_mw < 0.6 * found.total_mw


@pytest.mark.slow
def test_an_outage_that_no_other_device_makes_up_for_is_said(case):
    found = place(case, [NEAR_9], candidates=[(9, 29), (8, 25)], outages=True, observe=2.0)
    (missing,) = found.infeasible
    assert (missing.contingency, missing.out) == (NEAR_9, "9@29")
    assert "survive 1 scenario of 2" in found.remarks()[0]
    assert "No fleet within the caps was found that survives 29 trip 26-29, without 9@29." in found.remarks()[0]


@pytest.mark.slow
def test_outages_of_what_is_not_built_are_no_scenarios():
    """Also of a contingency that is lost with every fleet tried: its outages are those of the fleet."""
    case = st.load("wscc9").classical()
    hopeless, near = st.Contingency("8", clear="30cyc", trip="7-8"), st.Contingency("7", clear="6.5cyc", trip="5-7")
    places = [(2, 7), (1, 4)]
    found = place(case.with_storage({2: "20MW"}), [hopeless, near], candidates=places, outages=True, observe=2.0)
    own = {f"{s.machine}@{s.bus}" for s in found.sites}
    assert len(own) == 1
    for one in (hopeless, near):
        rows = [row for row in (*found.contingencies, *found.infeasible) if row.contingency == one]
        assert sorted(row.out for row in rows) == sorted({"", "existing 2@7", *own})
    assert f"scenarios of {len(found.contingencies) + len(found.infeasible)}," in found.remarks()[0]


@pytest.mark.slow
def test_an_existing_device_may_be_out_of_service_too(case, alone):
    own = case.with_storage({9: "60MW"})
    kept = place(own, [NEAR_9], candidates=[(9, 29)], observe=2.0)
    assert kept.sites == ()
    lost = place(own, [NEAR_9], candidates=[(9, 29)], outages=True, observe=2.0)
    assert lost.total_mw == pytest.approx(alone.total_mw, rel=2e-3)
    assert sorted(c.out for c in lost.contingencies) == ["", "9@29", "existing 9@29"]


def test_a_device_out_of_service_does_nothing_and_costs_no_second_run(case):
    devices = (st.Storage(9, 29, 60.0), st.Storage(9, 29, 60.0), st.Storage(8, 25, 60.0))
    point = case.with_storage(devices[1:]).initialize()
    trials = Trials(point, scenarios((NEAR_9,), 1, 2), np.array([60.0, 60.0]))
    assert trials.lost(np.array([60.0, 0.0])) == [1]
    assert trials.simulations == 2  # without the second device, which has no rating, is the same run
    assert trials.ratings(np.array([60.0, 5.0]), 1).tolist() == [0.0, 5.0]
    assert (trials.multiple(0, 1), trials.multiple(1, 1)) == (0, 1)
    assert trials.of(np.array([60.0, 0.0])).scenarios == (Scenario(NEAR_9), Scenario(NEAR_9, out=0))


@pytest.mark.slow
def test_the_trip_of_a_machine_is_survived_or_not(case):
    found = place(case, [NEAR_9, TRIP], candidates=[(9, 29)], observe=2.0)
    trip = next(c for c in found.contingencies if c.contingency == TRIP)
    assert (trip.target_cycles, trip.critical_cycles, trip.margin_cycles, trip.stable) == (None, None, None, True)
    assert f"{'trip of 8':26s}       -         -" in str(found)
    assert survives(case, found.storage(), TRIP)
    assert found.clearing_times.margin_cycles.isna().tolist() == [False, True]


def test_a_fault_with_impedance_needs_less(case, alone):
    mild = replace(NEAR_9, impedance=0.001 + 0.004j)
    less = place(case, [mild], candidates=[(9, 29)], observe=2.0)
    assert less.total_mw < 0.9 * alone.total_mw


TABLE = """bus,machine,cap_mw,module_mw,cost_per_mw,cost_per_mwh,cost_per_site
29,9,100,12.5,1,,
28,,80,,1.5,100,20
"""


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "sites.csv"
    path.write_text(TABLE)
    return path


def test_a_table_of_sites(case, table):
    assert read(table) == (SiteOption(29, 9, 100.0, 12.5, 1.0), SiteOption(28, None, 80.0, None, 1.5, 100.0, 20.0))
    found = sites(case.initialize(), table, "30%mva", st.Costs(mwh=7.0), case.power_flow())
    assert found.candidates == ((9, 29), (9, 28))
    assert found.cap.tolist() == [100.0, 80.0]
    assert found.module.tolist() == [12.5, 0.0]
    assert [column.tolist() for column in found.prices] == [[1.0, 1.5], [7.0, 100.0], [0.0, 20.0]]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("cap_mw", "cap", "row 1: 'cap' is not a column of this table; did you mean cap_mw"),
        ("12.5", "-1", r"row 2, module_mw: -1(.0)? is not allowed; it must be a number above 0"),
        ("12.5", "x", "row 2, column module_mw: 'x' is not allowed"),
        ("28,", ",", "row 3, column bus"),
        ("28,", "99,", "no bus 99"),
        ("29,9", "29,77", "no machine 77"),
        ("28,,80", "29,9,80", "listed twice"),
        (TABLE[TABLE.index("29") :], "", "has no sites"),
        ("1.5,100", "0,0", "costs per MW and per MWh are both 0"),
    ],
)
def test_a_mistake_in_a_table_of_sites_is_a_sentence(case, table, old, new, words):
    table.write_text(TABLE.replace(old, new, 1))
    with pytest.raises((StudyError, CaseError), match=words):
        sites(case.initialize(), table, "30%mva", st.Costs(), case.power_flow())


def test_a_bus_without_a_machine_follows_the_nearest_one(case):
    """The one that a MW at the bus decelerates most; a storage bus belongs to its own machine."""
    point = case.initialize()
    buses = [m.storage_bus for m in case.machines] + [28, 16, 3]
    found = sites(point, buses, "50MW", st.Costs(), case.power_flow()).candidates
    assert [c.machine for c in found[:10]] == [m.machine for m in case.machines]
    assert found[10].machine == 9  # bus 28 is next to bus 29
    free = sensitivity(point, [(1, bus) for bus in buses[10:]])
    assert [c.machine for c in found[10:]] == [free.machines[i] for i in free.acceleration.argmin(axis=0)]


@pytest.mark.slow
def test_sizes_are_whole_modules(case, table):
    """The cheapest number of modules: one fewer does not survive."""
    found = place(case, [NEAR_9], candidates=table, observe=2.0)
    (site,) = found.sites
    assert (site.bus, site.mw % 12.5) == (29, 0.0)
    assert found.cost == site.mw
    assert found.cuts_cost <= found.cost
    assert survives(case, found.storage(), NEAR_9)
    assert not survives(case, [s._replace(rating=s.rating - 12.5) for s in found.storage()], NEAR_9)


@pytest.mark.slow
def test_the_command(stabctl, table, tmp_path):
    file = tmp_path / "faults.toml"
    file.write_text('[[contingency]]\nfault = "29"\ntrip = "26-29"\nclear = "4.7cyc"\n')
    words = ("place", "ieee39", "--classical", "--contingencies", file, "--observe", 2, "--candidates", table)
    words += ("--load-level", 0.97, "--load-level", 1, "--storage-at", "8=5MW", "--json")
    code, out, err = stabctl(*words)
    assert (code, err) == (0, "")
    record = json.loads(out)
    assert [c["operating_point"] for c in record["contingencies"]] == ["load 97 %", "load 100 %"]
    assert [s["rating"] for s in record["existing"]] == [5.0]
    assert all(s["mw"] % 12.5 == 0 for s in record["sites"] if s["bus"] == 29)


@pytest.mark.slow
def test_the_prices_of_the_command(stabctl, tmp_path):
    """Each goes to what it is the price of."""
    file = tmp_path / "fault.toml"
    file.write_text('[[contingency]]\nfault = "7"\ntrip = "7-8"\nclear = "9cyc"\n')
    words = ("place", "two_area", "--classical", "--contingencies", file, "--observe", 2)
    words += ("--cost-mw", 2, "--cost-site", 30, "--cost-mwh", 500)
    code, out, _ = stabctl(*words, "--json")
    found = json.loads(out)
    assert code == 0
    assert found["total_mw"] > 0
    paid = 2 * found["total_mw"] + 30 * len(found["sites"]) + 500 * found["total_mwh"]
    assert found["cost"] == pytest.approx(paid, rel=1e-12)


def test_cases_and_load_levels_of_the_command_have_names(case):
    from stabctl.cli.place import _operating_points

    assert list(_operating_points([case], None)) == ["ieee39"]
    assert list(_operating_points([case, case], None)) == ["ieee39", "ieee39#2"]
    levels = _operating_points([case], [0.9, 1.0])
    assert list(levels) == ["load 90 %", "load 100 %"]
    assert levels["load 90 %"] == case.with_load_level(0.9)
    assert list(_operating_points([case, case], [0.9])) == ["ieee39, load 90 %", "ieee39#2, load 90 %"]


@pytest.mark.slow
def test_three_operating_points_five_contingencies(cases):
    """Scenarios of a planner on the full-order system: 15, all survived."""
    from stabctl.io.contingencies.toml import read
    from stabctl.placement.contingencies import packaged

    case = cases("ieee39")
    points = {f"{level:g}": case.with_load_level(level) for level in (0.9, 0.95, 1.0)}
    found = place(points, read(packaged("ieee39"), case)[:5])
    assert len(found.contingencies) == 15
    assert all(c.stable for c in found.contingencies)
    assert found.cuts_cost <= found.cost
