"""The simulator: what happens to the network, where a run lands, how it ends, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import root
from systems import CLASSICAL, KINDS, small, with_shares

from stabctl.controllers import BangBang
from stabctl.devices.loads import zip_load as load_model
from stabctl.dynamics import operating_point
from stabctl.errors import StudyError
from stabctl.model import network
from stabctl.model.case import Branch, Bus, Load, Storage
from stabctl.model.location import locate
from stabctl.model.network import Switching, two_port
from stabctl.simulation import simulation, voltages
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import (
    Clear,
    Fault,
    LoadStep,
    Open,
    SwitchShunt,
    TripMachine,
)
from stabctl.simulation.simulation import Simulation, run
from stabctl.simulation.timeline import timeline
from stabctl.simulation.topology import stage

KEEP_ON = Criterion(max_angle=np.inf, low_voltage_s=0.0)


@pytest.fixture(scope="module")
def two_area(points):
    return points("two_area")


@pytest.fixture(scope="module")
def one():
    """The small system with full machine 1."""
    return operating_point.solve(with_shares(small(KINDS["sexs, pss, steam"]), p_current=1.0))


def at(run, t):
    """Row of the first record at t or later."""
    return np.searchsorted(run.time, t - 1e-9)


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


class TestTwoPort:
    Z, B = 0.01 + 0.1j, 0.2

    @given(f=st.floats(0.001, 0.999), g=st.floats(0.1, 1e7))
    def test_a_fault_along_a_line_is_a_bus_there_eliminated(self, f, g):
        Y = np.zeros((3, 3), complex)
        for i, j, part in ((0, 1, f), (1, 2, 1 - f)):
            y, half = 1 / (part * self.Z), 0.5j * part * self.B
            Y[np.ix_([i, j], [i, j])] += [[y + half, -y], [-y, y + half]]
        Y[1, 1] += g
        keep = np.ix_([0, 2], [0, 2])
        want = Y[keep] - Y[np.ix_([0, 2], [1])] @ Y[np.ix_([1], [0, 2])] / Y[1, 1]
        found = two_port(self.Z, self.B, network.BranchState(f, g))
        assert np.abs(found - want).max() < 1e-9 * np.abs(want).max()

    def test_bolted_it_is_two_shunts(self):
        found = two_port(self.Z, 0.0, network.BranchState(0.4, 1e7))
        want = np.diag([1 / (0.4 * self.Z), 1 / (0.6 * self.Z)])
        assert np.abs(found - want).max() < 1e-4

    @pytest.mark.parametrize("f", [None, 0.0, 0.3, 1.0])
    def test_open_ends(self, f):
        state = network.BranchState(f, 50.0)
        both = two_port(self.Z, self.B, state)
        near = two_port(self.Z, self.B, state._replace(to_closed=False))
        far = two_port(self.Z, self.B, state._replace(from_closed=False))
        assert near[0, 0] == pytest.approx(both[0, 0] - both[0, 1] * both[1, 0] / both[1, 1], rel=1e-12)
        assert far[1, 1] == pytest.approx(both[1, 1] - both[0, 1] * both[1, 0] / both[0, 0], rel=1e-12)
        assert np.count_nonzero(near) == np.count_nonzero(far) == 1
        assert not two_port(self.Z, self.B, state._replace(to_closed=False, from_closed=False)).any()

    def test_intact_it_is_the_branch_of_the_matrix(self, two_area):
        row = Switching(branches=((8, network.INTACT),))
        assert abs(network.admittance(two_area.net, row) - network.admittance(two_area.net)).max() < 1e-12


class TestFaults:
    def test_a_fault_along_a_line_equals_one_at_a_bus_put_there(self, cases):
        case = with_shares(cases("two_area"), p_current=0.0)
        row = next(i for i, k in enumerate(case.branches) if (k.from_bus, k.to_bus) == (7, 8))
        k = case.branches[row]._replace(b=0.0)  # one lumped section and two are not the same line before the fault
        case = replace(case, branches=(*case.branches[:row], k, *case.branches[row + 1 :]))
        parts = [
            k._replace(to_bus=99, r=0.3 * k.r, x=0.3 * k.x, b=0.3 * k.b),
            k._replace(from_bus=99, r=0.7 * k.r, x=0.7 * k.x, b=0.7 * k.b),
        ]
        split = replace(
            case,
            buses=(*case.buses, Bus(99, "pq", 0.95, -10.0)),
            branches=(*case.branches[:row], *case.branches[row + 1 :], *parts),
        )
        line = run(operating_point.solve(case), Contingency("7-8@0.3", 0.1, at=0.1), 1.0, criterion=KEEP_ON)
        events = [Fault("99", 0.1), Open("7-99", 0.2), Open("99-8", 0.2)]
        bus = run(operating_point.solve(split), events, 1.0, criterion=KEEP_ON)
        assert np.abs(line.arrays.speed - bus.arrays.speed).max() < 1e-8
        assert np.abs(line.arrays.V - bus.arrays.V[:, :-1]).max() < 1e-8

    @pytest.mark.parametrize(("place", "bus"), [("7-8@0", "7"), ("7-8@1", "8"), ("8-7@0", "8"), ("8-7@1.0", "7")])
    def test_at_its_ends_it_is_a_bus_fault_with_the_line_opened_at_clearing(self, two_area, place, bus):
        line = run(two_area, Contingency(place, 0.1, at=0.1), 1.0, criterion=KEEP_ON)
        events = [Fault(bus, 0.1), Clear(bus, 0.2), Open("7-8", 0.2)]
        assert np.abs(line.arrays.speed - run(two_area, events, 1.0, criterion=KEEP_ON).arrays.speed).max() < 1e-8

    def test_measured_from_the_bus_named_first(self, two_area):
        a, b = (run(two_area, Contingency(p, 0.1, at=0.1), 1.0, criterion=KEEP_ON) for p in ("7-8@0.25", "8-7@0.75"))
        assert np.array_equal(a.rows, b.rows)

    def test_circuits_are_counted_in_file_order(self, two_area):
        assert [locate(two_area.case, p).branch for p in ("7-8", "7-8#1", "7-8#2", "8-7#2")] == [8, 8, 9, 9]

    def test_a_bolted_fault_takes_the_voltage_and_an_impedance_leaves_some(self, two_area):
        for impedance, low, high in ((0j, 0, 1e-5), (0.05j, 0.3, 0.95)):
            traced = run(two_area, [Fault("7", 0.1, impedance), Clear("7", 0.15)], 0.2, criterion=KEEP_ON)
            size = np.abs(traced.arrays.V[:, two_area.net.place[7]])
            on = (traced.time >= 0.1) & (traced.time < 0.15 - 1e-9)
            assert low <= size[on].min() <= size[on].max() < high
            assert size[~on].min() > 0.8

    def test_ends_that_open_one_after_the_other(self, two_area):
        """Between them the fault hangs on the far end alone; both at once is the limit of a vanishing gap."""

        def opened(gap):
            events = [Fault("7-8@0.1", 0.1), Open("7-8", 0.2, end=7), Open("7-8", 0.2 + gap, end=8)]
            return run(two_area, events, 0.5, criterion=KEEP_ON, step=1 / 240)

        late, near, at_once = opened(0.1), opened(1e-6), opened(0.0)
        i7, i8 = two_area.net.place[7], two_area.net.place[8]
        between = (late.time > 0.2) & (late.time < 0.3 - 1e-9)
        assert np.abs(late.arrays.V[between, i7]).min() > np.abs(late.arrays.V[between, i8]).max() + 0.1
        assert np.abs(near.arrays.speed[-1] - at_once.arrays.speed[-1]).max() < 1e-6
        assert np.abs(late.arrays.speed[-1] - at_once.arrays.speed[-1]).max() > 1e-4
        full = run(two_area, Contingency("7-8@0.1", 0.1, at=0.1), 0.5, criterion=KEEP_ON, step=1 / 240)
        assert np.abs(at_once.arrays.speed - full.arrays.speed).max() < 1e-12

    def test_a_clearing_time_of_zero_only_opens_the_line(self, two_area):
        a = run(two_area, Contingency("7-8@0.4", 0.0, at=0.5), 1.0)
        b = run(two_area, [Open("7-8", 0.5)], 1.0)
        assert np.array_equal(a.rows, b.rows)

    def test_the_order_of_the_list_does_not_matter(self, two_area):
        events = Contingency("7", 0.1, ["7-8", "8-9#2"], at=0.1).timed(two_area.case)
        assert np.array_equal(run(two_area, events, 0.5).rows, run(two_area, events[::-1], 0.5).rows)


class TestOtherEvents:
    def test_a_load_step_is_a_case_with_that_load(self, cases):
        """The voltages right after the step are those of the same sources on the larger load."""
        case = cases("two_area")
        point = operating_point.solve(case)
        traced = run(point, [LoadStep(7, 0.1, 100.0, 30.0)], 0.2)
        k, i = at(traced, 0.1), point.net.place[7]
        drawn = -traced.arrays.V[k, i] * (network.admittance(point.net) @ traced.arrays.V[k])[i].conj() * 100
        m = abs(traced.arrays.V[k, i]) / abs(point.V[i])
        assert drawn == pytest.approx((967 + 100) * m + 1j * (100 + 30) * m**2, abs=1e-3)

    def test_a_load_step_where_there_is_no_load_is_an_admittance(self, two_area):
        a = run(two_area, [LoadStep(8, 0.1, 50.0, 20.0)], 1.0)
        scale = 1 / abs(two_area.V[two_area.net.place[8]]) ** 2
        b = run(two_area, [SwitchShunt(8, 0.1, 50 * scale, -20 * scale)], 1.0)
        assert np.abs(a.arrays.speed - b.arrays.speed).max() < 1e-12
        assert np.ptp(a.arrays.speed) > 1e-5

    def test_steps_add_up_and_take_each_other_back(self, two_area):
        events = [LoadStep(7, 0.1, 40.0), LoadStep(7, 0.1, 20.0), LoadStep(7, 0.3, -60.0)]
        traced = run(two_area, events, 0.4)
        single = run(two_area, [LoadStep(7, 0.1, 60.0), LoadStep(7, 0.3, -60.0)], 0.4)
        assert np.abs(traced.arrays.speed - single.arrays.speed).max() < 1e-12

    def test_a_tripped_machine_gives_nothing_and_stands_still(self, two_area):
        traced = run(two_area, [TripMachine(1, 0.1)], 0.6, criterion=KEEP_ON)
        after = traced.time >= 0.1
        assert np.ptp(traced.arrays.speed[after, 0]) == 0
        k = at(traced, 0.1)
        current = (network.admittance(two_area.net) @ traced.arrays.V[k])[two_area.net.place[1]]
        assert abs(current) < 1e-9
        assert traced.arrays.speed[-1, 1] < 1 - 1e-3
        assert traced.outcome.kind == "stable"

    def test_the_centre_of_inertia_is_that_of_the_machines_left(self, one):
        """Machine 2 alone remains: it is its own center, and cannot lose synchronism with itself."""
        traced = run(one, [TripMachine(1, 0.1)], 2.0)
        assert traced.outcome.stable
        assert traced.arrays.speed[-1, 1] < 0.999

    def test_every_machine_tripped_leaves_a_dead_system(self, one):
        traced = run(one, [TripMachine(1, 0.1), TripMachine(2, 0.1)], 0.5)
        assert np.isfinite(traced.rows).all()
        assert np.abs(traced.arrays.V[-1]).max() == 0


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
            "The switching cut off bus 20 without a machine: blacked out, its load lost. "
            "Every island stayed in synchronism until 2.000 s; final frequency 60.07 Hz."
        )
        after = traced.time >= 0.5
        assert np.abs(traced.arrays.V[after, -1]).max() == 0
        assert np.isfinite(traced.rows).all()
        lost = run(point, [LoadStep(20, 0.5, -80.0, -10.0)], 0.51)
        assert np.abs(traced.arrays.V[at(traced, 0.5), :-1]).min() == pytest.approx(np.abs(lost.arrays.V[-1, :-1]).min(), abs=2e-3)

    def test_an_island_whose_only_machine_is_tripped_is_dead_and_said_to_be(self, two_area):
        traced = run(two_area, [Open("1-5", 0.5), TripMachine(1, 0.6)], 1.0)
        assert np.abs(traced.arrays.V[traced.time >= 0.6, two_area.net.place[1]]).max() == 0
        assert "bus 1 with machine 1" not in traced.outcome.message
        assert "bus 1 without a machine: blacked out" in traced.outcome.message

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


class TestTime:
    def test_it_lands_exactly_on_every_event(self, two_area):
        instants = (0.1, 0.1 + 1 / 77, 0.3, 0.3 + 1e-4)
        events = [
            Fault("7", instants[0]),
            Clear("7", instants[1]),
            Open("7-8", instants[2]),
            LoadStep(7, instants[3], 5.0),
        ]
        traced = run(two_area, events, 0.5, step=1 / 100)
        for t in (*instants, 0.0, 0.5):
            assert np.abs(traced.time - t).min() < 1e-12
        assert np.diff(traced.time).max() <= 0.01 + 1e-12
        assert (np.diff(traced.time) > 0).all()
        assert traced.steps == len(traced.time) - 1

    def test_an_interval_at_a_time_equals_one_run(self, two_area):
        events = Contingency("7", 8 / 60, ["7-8"], at=0.5)
        whole = run(two_area, events, 2.0, step=1 / 120)
        sim = Simulation(two_area, events, step=1 / 120)
        for k in range(1, 61):
            assert sim.advance(k / 30)
        pieces = sim.finish()
        assert np.array_equal(np.round(whole.time, 9), np.round(pieces.time, 9))
        assert np.abs(whole.arrays.speed - pieces.arrays.speed).max() < 1e-7
        quiet = replace(two_area.case, loads=tuple(d._replace(p_current=0.0) for d in two_area.case.loads))
        point = operating_point.solve(quiet)
        whole, sim = run(point, events, 2.0, step=1 / 120), Simulation(point, events, step=1 / 120)
        for k in range(1, 61):
            sim.advance(k / 30)
        assert np.abs(whole.arrays.speed - sim.finish().arrays.speed).max() < 1e-11

    def test_a_late_start_finds_the_events_before_it_done(self, two_area):
        traced = run(two_area, [Open("7-8", 0.5)], 1.5, start=1.0)
        assert traced.time[0] == 1.0
        assert np.ptp(traced.arrays.speed) > 1e-5

    def test_an_early_stop_ends_the_run_at_the_slip(self, two_area):
        traced = run(two_area, Contingency("7", 0.3, ["7-8"]), 10.0)
        assert traced.outcome.kind == "lost_synchronism"
        assert traced.time[-1] == pytest.approx(traced.outcome.time_s)
        assert traced.outcome.time_s < 4
        assert traced.max_angle_from_coi_deg >= np.rad2deg(3.5)
        later = run(two_area, Contingency("7", 0.3, ["7-8"]), 10.0, criterion=Criterion(max_angle=6.0))
        assert later.outcome.time_s > traced.outcome.time_s

    def test_the_slip_is_measured_against_the_centre_of_inertia(self, two_area):
        traced = run(two_area, Contingency("7", 0.3, ["7-8"]), 10.0)
        H = two_area.inertia
        change = traced.arrays.angle - traced.arrays.angle[0]
        off = np.abs(change - (change @ H / H.sum())[:, None])
        assert np.rad2deg(off.max()) == pytest.approx(traced.max_angle_from_coi_deg, abs=1e-9)
        assert two_area.case.machines[off[-1].argmax()].machine == traced.outcome.machine
        assert (off[:-1] < 3.5).all()

    def test_without_record_the_outcome_is_the_same(self, two_area):
        events = Contingency("7", 0.3, ["7-8"])
        a, b = run(two_area, events, 5.0), run(two_area, events, 5.0, record=False)
        assert (a.outcome, a.steps) == (b.outcome, b.steps)
        assert a.peak == pytest.approx(b.peak, abs=0)
        assert len(b.rows) == 0


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


class TestNewtonFallback:
    """Two-area near the nose of its loads' voltage: substitution does not contract there."""

    @staticmethod
    def heavy(cases):
        case = cases("two_area")
        return with_shares(case, p_current=0.0, p_power=1.0, q_power=1.0)

    def test_voltages_solve_the_network_where_substitution_would_not_contract(self, cases):
        point = operating_point.solve(self.heavy(cases))
        events = Contingency("8", 6 / 60, ["7-8", "8-9"], at=0.1).timed(point.case)
        traced = run(point, events, 1.5, criterion=KEEP_ON)
        changes, sources, radius = timeline(point.case, events), self.sources(point), []
        for t in (0.05, 0.12, 0.25, 0.5, 1.0):
            k = min(at(traced, t), len(traced.time) - 1)
            switching = [c for c in changes if c.at <= traced.time[k] + 1e-9][-1].switching
            Y = point.admittance(switching).toarray()

            def substituted(pairs, Y=Y, k=k):
                return np.linalg.solve(Y, sources(traced.rows[k]) + self.draws(point, pairs.view(complex))).view(float)

            v = traced.arrays.V[k].copy().view(float)
            assert np.abs(substituted(v) - v).max() < 1e-6
            slopes = [(substituted(v + e) - substituted(v - e)) / 2e-6 for e in 1e-6 * np.eye(len(v))]
            radius.append(np.abs(np.linalg.eigvals(np.array(slopes))).max())
        assert max(radius) > 1  # 2.6

    @staticmethod
    def sources(point):
        from stabctl.dynamics import system

        def currents(row):
            b = system.buffers(point.plant, len(point.V))
            b.z[:] = row[: len(b.z)]
            system.sources(b.s, point.plant, np.zeros(len(point.case.machines), np.int64), b.r.g)
            return b.r.g.reshape(-1).view(complex)

        return currents

    @staticmethod
    def draws(point, V):
        out = np.zeros(len(V), complex)
        for par, bus in zip(point.plant.load, point.plant.load_bus, strict=True):
            out[bus] += complex(*load_model.output((V[bus].real, V[bus].imag), par))
        return out

    @pytest.mark.parametrize("slow", [False, True])
    @pytest.mark.parametrize("scale", [1.0, 0.97, 0.96, 0.955, 0.95, 0.945, 0.94, 0.93, 0.92, 0.9, 0.8, 0.6, 0.3, 0.1])
    def test_it_agrees_with_scipy_on_the_same_equations(self, cases, scale, slow):
        """Sources weakened to `scale`, so that one load and then both fall below their thresholds.

        Plain Newton may stop at the kink between; slowly it finds the solution that there always is.
        """
        point = operating_point.solve(self.heavy(cases))
        now = stage(point, Switching())
        plant, n = point.plant, len(point.V)
        source = scale * self.sources(point)(point.z)
        Y = point.admittance().toarray()

        def miss(pairs):
            V = np.ascontiguousarray(pairs).view(complex)
            return np.linalg.solve(Y, Y @ V - source - self.draws(point, V)).view(float)

        volt, blame = point.V.copy(), np.zeros(1, int)
        work = [np.zeros(n, complex) for _ in range(3)]
        nobody = np.recarray(0, [("share", float), ("energy", float)]), np.zeros(0)
        devices = plant.load, plant.load_slot, plant.storage, plant.storage_slot, *nobody
        found = voltages.newton(now.net.factors, source, volt, *work, plant.draw_bus, blame, slow, *devices)
        assert found or not slow
        if found:
            assert np.abs(miss(volt.view(float))).max() < 2e-7
            theirs = root(miss, volt.view(float), tol=1e-12)
            assert theirs.success
            assert np.abs(theirs.x.view(complex) - volt).max() < 1e-6


class TestRefusals:
    @pytest.mark.parametrize(
        ("events", "says"),
        [
            ([Fault("99", 1.0)], "There is no bus 99 in two_area; the nearest numbers are 9, 10, 11."),
            ([Fault("7-9", 1.0)], "There is no branch 7-9 in two_area; the branches at bus 7 are 7-6, 7-8."),
            ([Fault("7-99", 1.0)], "There is no branch 7-99 in two_area, since there is no bus 99; the nearest "),
            ([Fault("7-8#3", 1.0)], "Branch 7-8 of two_area has 2 circuits, but no circuit 3."),
            ([Fault("7-8#0", 1.0)], "Branch 7-8 of two_area has 2 circuits, but no circuit 0."),
            ([Fault("7-8@1.5", 1.0)], "The position 1.5 along 7-8 must be a number from 0 (bus 7) to 1 (bus 8)."),
            ([Fault("7-8@1e", 1.0)], "The position 1e along 7-8 must be a number from 0 (bus 7) to 1 (bus 8)."),
            ([Fault("somewhere", 1.0)], "'somewhere' is not a location; write 83 for a bus, "),
            ([Fault("", 1.0)], "'' is not a location; write 83 for a bus, "),
            ([Fault("9" * 5000, 1.0)], "'9999"),
            ([Fault("7", -1.0)], "The time -1 s of "),
            ([Fault("7", float("nan"))], "The time nan s of "),
            ([Fault("7", float("inf"))], "The time inf s of "),
            ([Fault("7", 1.0), Fault("7", 1.1)], "Bus 7 is faulted twice; "),
            ([Fault("7-8@0.1", 1.0), Fault("7-8@0.2", 1.1)], "Branch 7-8@0.2 is faulted twice; "),
            ([Fault("7", 1.0, complex("nan"))], "The impedance (nan"),
            ([Fault("7", 1.0, complex(-0.1, 0))], "The impedance (-0.1+0j) pu of the fault at 7 "),
            ([Clear("7", 1.0)], "There is no fault at 7 to clear at that time."),
            ([Open("7", 1.0)], "'7' is not a circuit; write 7-8"),
            ([Open("7-8@0.5", 1.0)], "'7-8@0.5' is not a circuit; "),
            ([Open("7-8", 1.0, end=9)], "Circuit 7-8 does not end at bus 9; it ends at 7 and 8."),
            ([TripMachine(9, 1.0)], "There is no machine 9 in two_area; its machines are 1, 2, 3, 4."),
            ([TripMachine(1, 1.0), TripMachine(1, 1.5)], "Machine 1 is tripped twice; remove one trip."),
            ([LoadStep(99, 1.0, 5.0)], "There is no bus 99 in two_area; the nearest numbers are "),
            ([LoadStep("7-8", 1.0, 5.0)], "'7-8' is not a bus of two_area; give a bus number."),
            ([LoadStep(7, 1.0, float("nan"))], "The p nan of "),
            ([SwitchShunt(7, 1.0, b=float("inf"))], "The b inf of "),
        ],
    )
    def test_impossible_events(self, two_area, events, says):
        with pytest.raises(StudyError) as caught:
            run(two_area, events, 2.0)
        assert str(caught.value).startswith(says)
        assert "\n" not in str(caught.value)

    @given(st.text(max_size=12) | st.from_regex(r"[0-9]{1,3}(-[0-9]{1,3}(#[0-9]{1,3})?(@[0-9.e+-]{1,6})?)?"))
    def test_any_text_names_a_place_or_is_refused_in_one_sentence(self, two_area, text):
        try:
            place = locate(two_area.case, text)
        except StudyError as error:
            said = str(error)
        else:
            said = ""
            assert (place.bus is None) != (place.branch is None)
        assert "\n" not in said

    def test_steps(self, two_area):
        longest = simulation.REACH / two_area.fastest
        with pytest.raises(StudyError, match=r"^The step 0\.05 s is too long for two_area, whose fastest eigenvalue"):
            run(two_area, step=0.05)
        for bad in (0.0, -0.1, float("nan"), float("inf")):
            with pytest.raises(StudyError, match=r"^The step .* s is not allowed; it must be at least 1e-07 s\.$"):
                run(two_area, step=bad)
        assert run(two_area, [LoadStep(7, 0.1, 10.0)], 1.0, step=0.99 * longest).outcome.kind == "stable"

    def test_the_longest_step_is_carried_and_twice_as_long_would_not_be(self, two_area, monkeypatch):
        longest = simulation.REACH / two_area.fastest
        events = [LoadStep(7, 0.1, 10.0)]
        assert (
            np.abs(np.diff(run(two_area, events, 3.0, step=longest, criterion=KEEP_ON).arrays.Efd[-20:], axis=0)).max() < 0.01
        )
        monkeypatch.setattr(simulation, "REACH", 10.0)
        wild = run(two_area, events, 3.0, step=2 * longest, criterion=KEEP_ON)
        assert np.abs(wild.arrays.Efd[-1] - two_area.z[-8:-4]).max() > 2.5

    @pytest.mark.parametrize("until", [0.0, -1.0, float("nan"), float("inf")])
    def test_ends(self, two_area, until):
        with pytest.raises(StudyError, match=r"it must end after its start"):
            run(two_area, until=until)

    @pytest.mark.parametrize("clear", [-0.1, float("nan")])
    def test_clearing_times(self, clear):
        with pytest.raises(StudyError, match=r"give a time of at least 0|is not a time; write"):
            Contingency("7", clear)


@pytest.fixture(scope="module")
def traced(cases):
    case = cases("two_area").with_storage([Storage(1, 5, 50.0), Storage(2, 6, 20.0)])
    return run(operating_point.solve(case), Contingency("7", 0.1, ["7-8"], at=0.1), 0.5, control=BangBang())


class TestTrajectory:
    def test_is_immutable(self, traced):
        with pytest.raises(ValueError, match="read-only"):
            traced.rows[0, 0] = 1
        with pytest.raises(AttributeError):
            traced.outcome = None

    def test_tables_and_files_hold_the_same(self, traced, tmp_path):
        import pandas as pd
        import xarray as xr

        frame = traced.df
        assert list(frame.columns) == [
            "time_s",
            *(f"speed_pu:{m}" for m in (1, 2, 3, 4)),
            *(f"angle_rad:{m}" for m in (1, 2, 3, 4)),
            *(f"voltage_pu:{b}" for b in range(1, 12)),
            "storage_mw:1",
            "storage_mw:2",
        ]
        assert len(frame) == traced.steps + 1
        again = pd.read_csv(traced.save(tmp_path / "run.csv"))
        assert np.abs(again.to_numpy() - frame.to_numpy()).max() < 1e-12
        data = traced.dataset
        assert data["speed"].dims == ("time", "machine")
        assert data["voltage"].dims == ("time", "bus")
        assert {v.attrs["units"] for v in data.data_vars.values()} == {"pu", "rad", "MW", "MWh", "1"}
        with xr.open_dataset(traced.save(tmp_path / "run.nc"), engine="scipy") as stored:
            assert np.array_equal(stored["speed"], traced.arrays.speed)
            assert stored.attrs["outcome"] == "stable"
        with pytest.raises(StudyError, match=r"give a name ending in \.csv or \.nc"):
            traced.save(tmp_path / "run.mat")

    def test_prints_itself_in_a_sentence(self, traced):
        assert str(traced).startswith("two_area: All machines stayed in synchronism until 0.500 s.")
        assert Fault("7", 1.0) == Fault("7", 1.0)
