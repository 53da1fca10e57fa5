"""How a run ends: synchronism, islands, voltage collapse; and the paper's cases."""

from dataclasses import replace

import numpy as np
import pytest
from comparison import KEEP_ON
from systems import CLASSICAL, small

from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.model import network
from stabctl.model.network import Switching
from stabctl.model.tables import Branch, Bus, Link, Load, Storage
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import (
    Fault,
    LoadStep,
    Open,
    TripMachine,
)
from stabctl.simulation.simulation import run


def at(run, t):
    """Row of the first record at t or later."""
    return np.searchsorted(run.time, t - 1e-9)


@pytest.fixture(scope="module")
def two_area(points):
    return points("two_area")


class TestPaperCase:
    """Section 5, case 1: fault on one circuit 7-8, cleared after 21 cycles; 50 MW at each machine."""

    EVENTS = Contingency("7-8@0.4", 21 / 60)

    def test_without_control_it_loses_synchronism(self, two_area):
        outcome = run(two_area, self.EVENTS).outcome
        assert outcome.kind == "lost_synchronism"
        assert not outcome.stable
        assert outcome.message.startswith(f"Machine {outcome.machine} lost synchronism at {outcome.time_s:.3f} s")

    def test_with_storage_it_stays_together_and_area_1_absorbs_first(self, cases):
        case = cases("two_area")
        case = case.with_storage(Storage(m.machine, m.storage_bus, 50.0) for m in case.machines)
        traced = run(operating_point.solve(case), self.EVENTS, control=BangBang())
        assert traced.outcome.kind == "stable"
        first = [s[np.abs(s) > 1][0] for s in traced.arrays.storage.T]
        assert first == pytest.approx([50, 50, -50, -50])

    @pytest.mark.parametrize(("cycles", "kind"), [(8.5, "stable"), (9.5, "lost_synchronism")])
    def test_fault_at_bus_7_is_critical_about_nine_cycles(self, two_area, cycles, kind):
        assert run(two_area, Contingency("7", cycles / 60, ["7-8"]), 6.0).outcome.kind == kind

    def test_case_2_loses_machine_14_and_only_13_and_14_act(self, cases, points):
        events = Contingency("83", 6 / 60, ["83-33"])
        assert run(points("wnaps"), events).outcome.machine == 14
        case = cases("wnaps")
        devices = [Storage(m.machine, m.storage_bus, 0.05 * m.base) for m in case.machines]
        traced = run(operating_point.solve(case.with_storage(devices)), events, control=BangBang())
        assert traced.outcome.kind == "stable"
        acted = {s.machine for s, P in zip(devices, traced.arrays.storage.T, strict=True) if np.abs(P).max() > 1}
        assert acted == {13, 14}


class TestExtremes:
    """The sentence of a stable run gives what was observed: extremes of the rotor speeds, lowest voltage at the end."""

    FAULT = Contingency("7-8@0.4", 6 / 60)

    def test_they_are_those_of_the_record(self, two_area):
        traced = run(two_area, self.FAULT, 3.0)
        hz, after = 60 * traced.arrays.speed, traced.time >= 1.1 - 1e-9
        V = np.abs(traced.arrays.V[after])
        slow, fast = (one.argmin() % hz.shape[1] + 1 for one in (hz, -hz))
        bus = two_area.case.buses[V.argmin() % V.shape[1]].bus
        assert np.abs(traced.arrays.V[~after]).min() < V.min() - 0.1  # the voltages during the fault are no part of it
        assert traced.outcome.message == (
            f"All machines stayed in synchronism until 3.000 s; frequency {hz.min():.2f} (machine {slow}) to "
            f"{hz.max():.2f} Hz (machine {fast}), lowest voltage after clearing {V.min():.2f} pu at bus {bus}."
        )

    def test_they_do_not_depend_on_the_rows_kept_and_an_unrecorded_run_says_nothing_of_them(self, two_area):
        whole, few = (run(two_area, self.FAULT, 3.0, every=apart).outcome.message for apart in (0.0, 0.5))
        assert few == whole
        for record in (False, "rotors"):
            message = run(two_area, self.FAULT, 3.0, record=record).outcome.message
            assert message == "All machines stayed in synchronism until 3.000 s."

    def test_a_machine_that_is_off_and_a_dead_bus_are_no_part_of_them(self, two_area):
        traced = run(two_area, [Open("1-5", 0.5), TripMachine(1, 0.6)], 1.0)
        on = traced.on
        assert f"to {60 * traced.arrays.speed[on].max():.2f} Hz (machine 1)" in traced.outcome.message
        V = np.abs(traced.arrays.V)
        assert f"lowest voltage {V[V > 0].min():.2f} pu" in traced.outcome.message


class TestFaultsLeftOn:
    """A run that ends during a fault says so, whether the system is still stable or not."""

    @pytest.mark.parametrize("until", [1.1, 5.0])
    def test_a_fault_at_the_end_is_said(self, two_area, until):
        outcome = run(two_area, [Fault("7", 1.0)], until).outcome
        assert outcome.stable is (until < 2)
        assert outcome.message.endswith("The fault at bus 7 is still on: it is not cleared before the end of the run.")

    def test_an_open_circuit_is_no_fault(self, two_area):
        message = run(two_area, [Open("8-9#2", 0.5), Fault("7-8@0.4", 1.0)], 1.05).outcome.message
        assert message.endswith(" The fault on circuit 7-8 is still on: it is not cleared before the end of the run.")

    def test_several_are_named_and_a_cleared_one_is_not(self, two_area):
        both = run(two_area, [Fault("7-8@0.4", 1.0), Fault("3", 1.0)], 1.05).outcome
        assert "The faults at bus 3 and on circuit 7-8 are still on" in both.message
        assert "still on" not in run(two_area, Contingency("7", "6cyc"), 1.2).outcome.message


class TestIslands:
    def test_a_bridge_that_opens_cuts_off_what_lies_behind_it(self, cases, points):
        """Bus 83 of wnaps hangs on 83-33 and its neighbors; 1-5 of two_area is the only way out of machine 1."""
        traced = run(points("two_area"), [Open("1-5", 0.5)], 1.0)
        outcome = traced.outcome
        assert outcome.kind == "islanded"
        assert outcome.message.startswith("The switching cut off bus 1 with machine 1.")
        assert outcome.stable
        assert np.isfinite(traced.rows).all()
        assert traced.arrays.speed[-1, 0] > 1.01  # 700 MW and no load

    def test_a_machine_that_runs_away_alone_is_taken_off_and_the_rest_is_judged(self, two_area):
        traced = run(two_area, [Open("1-5", 0.5)], 2.0, criterion=Criterion(fastest=1.05))
        outcome = traced.outcome
        assert (outcome.kind, outcome.machine, outcome.stable) == ("islanded", None, True)
        assert "Machine 1, alone in its island, left the speed range 0.5 to 1.05 pu at " in outcome.message
        gone = traced.arrays.speed[:, 0] == traced.arrays.speed[-1, 0]
        assert 5 < gone.sum() < len(gone) - 5
        assert (traced.arrays.Pm[-1, 0], traced.arrays.P[-1, 0]) == (0.0, 0.0)
        assert traced.arrays.V[-1, two_area.net.place[1]] == 0

    def test_a_machine_that_runs_away_among_others_ends_the_run(self, two_area):
        outcome = run(two_area, [Open("1-5", 0.5)], 60.0, criterion=Criterion(slowest=0.99, fastest=9.0)).outcome
        assert (outcome.kind, outcome.stable) == ("lost_synchronism", False)
        assert f"The speed of machine {outcome.machine} left the range 0.99 to 9 pu" in outcome.message
        assert "cut off bus 1 with machine 1" in outcome.message

    def test_an_island_without_a_machine_is_dead_and_its_load_lost(self, cases):
        case = cases("two_area")
        case = replace(
            case,
            buses=(*case.buses, Bus(20, "pq")),
            branches=(*case.branches, Branch(8, 20, 0.001, 0.02)),
            loads=(*case.loads, Load(20, 80.0, 10.0, 0.5, 0.5, 0.5, 0.5)),
        )
        point = operating_point.solve(case.with_storage([Storage(1, 20, 10.0, lag=0.02)]))
        traced = run(point, [Open("8-20", 0.5)], 2.0, control=BangBang())
        assert traced.outcome.kind == "islanded"
        assert traced.outcome.message == (
            "The switching cut off bus 20 without a machine or grid-forming converter: blacked out, its load lost. "
            "Every island stayed in synchronism until 2.000 s; frequency 60.00 (machine 1) to 60.07 Hz (machine 1), "
            "lowest voltage 0.94 pu at bus 20; final frequency 60.07 Hz."
        )
        after = traced.time >= 0.5
        assert np.abs(traced.arrays.V[after, -1]).max() == 0
        assert np.isfinite(traced.rows).all()
        lost = run(point, [LoadStep(20, 0.5, -80.0, -10.0)], 0.51)
        assert np.abs(traced.arrays.V[at(traced, 0.5), :-1]).min() == pytest.approx(
            np.abs(lost.arrays.V[-1, :-1]).min(), abs=2e-3
        )

    def test_an_island_whose_only_machine_is_tripped_is_dead_and_said_to_be(self, two_area):
        traced = run(two_area, [Open("1-5", 0.5), TripMachine(1, 0.6)], 1.0)
        assert np.abs(traced.arrays.V[traced.time >= 0.6, two_area.net.place[1]]).max() == 0
        assert "bus 1 with machine 1" not in traced.outcome.message
        assert "bus 1 without a machine or grid-forming converter: blacked out" in traced.outcome.message

    def test_a_machine_that_is_tripped_alone_later_was_cut_off_with_its_bus(self, two_area):
        said = run(two_area, [Open("1-5", 0.5)], 4.0).outcome.message
        assert said.startswith("The switching cut off bus 1 with machine 1. Machine 1, alone in its island, was ")

    @pytest.mark.parametrize("until", [1.0, 2.0])
    def test_a_blackout_is_dated_by_the_trip_of_the_last_machine(self, two_area, until):
        tripped = [TripMachine(number, 0.2 + 0.1 * number) for number in (1, 2, 3, 4)]
        outcome = run(two_area, tripped, until).outcome
        assert outcome.time_s == pytest.approx(0.6)
        assert outcome.message.startswith("The system is blacked out at 0.600 s: ")

    def test_two_areas_apart_are_each_judged_by_their_own_centre(self, two_area):
        events = [Open(f"7-8#{k}", 0.5) for k in (1, 2)]
        traced = run(two_area, events, 4.0)
        assert traced.outcome.kind == "islanded"
        assert "cut off buses 3, 4, 8, 9, 10, 11 with machines 3, 4." in traced.outcome.message
        drift = np.abs(np.diff(traced.arrays.angle[-1, [0, 2]] - traced.arrays.angle[0, [0, 2]]))
        assert drift > 3.5
        assert traced.max_angle_from_coi_deg < 10

    def test_every_bridge_of_wnaps_may_open(self, points):
        point = points("wnaps")
        parts = []
        for i, k in enumerate(point.case.branches):
            opened = Switching(branches=((i, network.BranchState(from_closed=False, to_closed=False)),))
            if network.islands(point.net, opened).max() > 0:
                parts.append(f"{k.from_bus}-{k.to_bus}")
        assert len(parts) > 25
        for name in parts[::4]:
            traced = run(point, [Open(name, 0.1)], 0.4)
            assert np.isfinite(traced.rows).all()
            assert "cut off" in traced.outcome.message


class TestCollapse:
    def test_a_load_beyond_what_the_network_carries_collapses_and_names_its_bus(self):
        case = small({"gencls": CLASSICAL}, load=Load(2, 200.0, 50.0, p_power=1.0, q_power=1.0))
        point = operating_point.solve(case)
        traced = run(point, [LoadStep(2, 0.5, 3000.0, 1000.0)], 5.0)
        assert (traced.outcome.kind, traced.outcome.bus) == ("voltage_collapse", 2)
        assert traced.outcome.message.startswith("Voltage collapse at bus 2 at ")
        assert not traced.outcome.stable
        assert np.isfinite(traced.rows).all()

    def test_not_during_a_fault_and_not_when_switched_off(self):
        case = small({"gencls": CLASSICAL}, load=Load(2, 200.0, 50.0, p_power=1.0, q_power=1.0))
        point = operating_point.solve(case)
        fault = [Fault("2", 0.1, 0.02j)]
        assert run(point, fault, 1.5, criterion=Criterion(max_angle=np.inf)).outcome.kind != "voltage_collapse"
        step = [LoadStep(2, 0.5, 3000.0, 1000.0)]
        assert run(point, step, 2.0, criterion=KEEP_ON).outcome.kind != "voltage_collapse"

    @pytest.mark.parametrize(
        ("power", "blocked", "kind"), [(20.0, 0, "voltage_collapse"), (0.0, 0, "stable"), (20.0, 1, "islanded")]
    )
    def test_it_is_that_of_a_link_only_where_the_link_has_current(self, power, blocked, kind):
        """Loads of constant admittance are not watched; the link from bus 2 ends at bus 4, which a breaker cuts off."""
        case, link = small({"gencls": CLASSICAL}), Link("L", 2, 4, power, 0.0)
        buses, branches = (*case.buses, Bus(4, "pq")), (*case.branches, Branch(3, 4, 0.0, 0.1))
        case = replace(case, buses=buses, branches=branches, links=(link,))
        cut = [Open("3-4", 0.5)] if blocked else []
        events = [*cut, LoadStep(2, 1.0, 20.0, 9000.0)]
        end = run(operating_point.solve(case), events, 2.0, criterion=Criterion(max_angle=np.inf)).outcome
        assert (end.kind, end.bus) == (kind, 2 if kind == "voltage_collapse" else None)
        assert ("its voltage stayed below the limit of HVDC link L for 0.5 s" in str(end)) == (end.bus == 2)
