"""What happens to the network: faults, openings, trips and steps, and the events that are refused."""

from dataclasses import replace

import numpy as np
import pytest
from comparison import KEEP_ON
from hypothesis import given
from hypothesis import strategies as st
from systems import KINDS, ROUND, small, with_shares

from stabctl import io
from stabctl._util.errors import StudyError
from stabctl.dynamics import operating_point
from stabctl.model import network
from stabctl.model.location import locate
from stabctl.model.network import Switching, two_port
from stabctl.model.tables import Branch, Bus, Link, Load
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.events import (
    Clear,
    Fault,
    LoadStep,
    Open,
    SwitchShunt,
    TripMachine,
)
from stabctl.simulation.simulate import simulate
from stabctl.simulation.simulation import run
from stabctl.simulation.timeline import timeline
from stabctl.simulation.topology import stage


def at(run, t):
    """Row of the first record at t or later."""
    return np.searchsorted(run.time, t - 1e-9)


@pytest.fixture(scope="module")
def two_area(points):
    return points("two_area")


@pytest.fixture(scope="module")
def one():
    """The small system with full machine 1."""
    return operating_point.solve(with_shares(small(KINDS["sexs, pss, steam"]), p_current=1.0))


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


class TestImpossibleEvents:
    @pytest.mark.parametrize(
        ("events", "says"),
        [
            ([Fault("99", 1.0)], "There is no bus 99 in two_area; the nearest numbers are 9, 10, 11."),
            ([Fault("7-9", 1.0)], "There is no branch 7-9 in two_area; the branches at bus 7 are 7-6, 7-8."),
            ([Fault("7-99", 1.0)], "There is no branch 7-99 in two_area, because there is no bus 99; the nearest "),
            ([Fault("7-8#3", 1.0)], "Branch 7-8 of two_area has 2 circuits, but no circuit 3."),
            ([Fault("7-8#0", 1.0)], "Branch 7-8 of two_area has 2 circuits, but no circuit 0."),
            (
                [Fault("7-8@1.5", 1.0)],
                "The position 1.5 along 7-8 is not allowed; it must be from 0 (bus 7) to 1 (bus 8).",
            ),
            ([Fault("7-8@1e", 1.0)], "'7-8@1e' is not a location; write 83 for a bus, "),
            ([Fault("somewhere", 1.0)], "'somewhere' is not a location; write 83 for a bus, "),
            ([Fault("", 1.0)], "'' is not a location; write 83 for a bus, "),
            ([Fault("9" * 5000, 1.0)], "'9999"),
            ([Fault("7", -1.0)], "The time -1 s of "),
            ([Fault("7", float("nan"))], "The time nan s of "),
            ([Fault("7", float("inf"))], "The time inf s of "),
            ([Fault("7", 1.0), Fault("7", 1.1)], "Bus 7 is faulted twice; "),
            ([Fault("7-8@0.1", 1.0), Fault("7-8@0.2", 1.1)], "Branch 7-8@0.2 is faulted twice; "),
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
            ([Clear("7", 0.9), Fault("7", 0.9)], "There is no fault at 7 to clear at that time."),
            ([SwitchShunt(7, 1.0, b=float("inf"))], "The b inf of "),
        ],
    )
    def test_impossible_events(self, two_area, events, says):
        with pytest.raises(StudyError) as caught:
            run(two_area, events, 2.0)
        assert str(caught.value).startswith(says)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize(
        ("made", "says"),
        [
            (lambda: Fault("7", 1.0, complex("nan")), "fault impedance .* is not a finite number"),
            (lambda: Fault("7", 1.0, "0.01"), "fault impedance '0.01' is not a finite number"),
            (lambda: Open(None, 1.0), "None is not a location"),
            (lambda: Open(["7-8"], 1.0), "is not a location"),
            (lambda: SwitchShunt(7, 1.0), "The shunt switching at bus 7 has no power"),
            (lambda: Contingency(trip="7-8", impedance=0.1j), "The impedance is that of a fault, and there is none"),
        ],
    )
    def test_what_is_no_event_is_told_where_it_is_made(self, made, says):
        with pytest.raises(StudyError, match=says):
            made()

    def test_numbers_and_text_are_read_as_elsewhere(self):
        assert Fault(7, "1s") == Fault("7", "1s")
        assert SwitchShunt(7, "1s", b="100Mvar") == SwitchShunt(7, "1s", b=100.0)
        case = io.load("two_area")
        assert timeline(case, [Open("7-8", 1.0, end="8")])[-1] == timeline(case, [Open("7-8", 1.0, end=8)])[-1]

    def test_a_fault_of_no_duration_changes_nothing(self, two_area):
        both = run(two_area, [Fault("7", 0.1), Clear("7", 0.1)], 0.3)
        assert np.abs(both.rows[-1] - run(two_area, [], 0.3).rows[-1]).max() < 1e-9

    @pytest.mark.parametrize("swapped", [False, True])
    def test_a_fault_may_begin_where_another_is_cleared(self, two_area, swapped):
        """0.1 + 0.2 s is later than 0.3 s by a rounding."""
        several = [Contingency("7", clear=0.2, at=0.1), Contingency("7", clear=0.05, at=0.3)]
        found = simulate(two_area, several[::-1] if swapped else several, 0.6)
        assert [round(c.at, 9) for c in found.happened.changes] == [0.0, 0.1, 0.3, 0.35]
        assert [bool(c.switching.faults) for c in found.happened.changes] == [False, True, True, False]

    @pytest.mark.slow
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

    @pytest.mark.parametrize("clear", [-0.1, float("nan")])
    def test_clearing_times(self, clear):
        with pytest.raises(StudyError, match=r"give a time of at least 0|is not a time; write"):
            Contingency("7", clear)


def test_a_tripped_unit_has_no_field_voltage_and_no_power_even_where_these_are_set_points():
    point = operating_point.solve(small(KINDS["bare"]))
    a = run(point, [TripMachine(1, 0.1)], until=0.2).arrays
    assert (a.Pm[0, 0], a.Efd[0, 0]) != (0.0, 0.0)
    assert (a.Pm[-1, 0], a.Efd[-1, 0], a.P[-1, 0]) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("load", "step"), [(Load(2, 200.0, 0.0, q_power=1.0), {"q": 50.0}), (Load(2, 0.0, 0.0, p_power=1.0), {"p": 50.0})]
)
def test_a_load_of_zero_power_steps_too(load, step):
    point = operating_point.solve(small(KINDS["classical"], load=load))
    a = run(point, [LoadStep(2, 0.1, **step)], until=0.2).arrays
    assert np.abs(a.V[-1] - a.V[0]).max() > 1e-3


@pytest.mark.parametrize("turned", [False, True])
def test_a_step_is_one_of_all_loads_at_its_bus(turned):
    """In proportion to what they draw: 0.6 of constant admittance, 0.4 of constant power."""
    loads = Load(2, 120.0, 30.0), Load(2, 80.0, 20.0, p_power=1.0, q_power=1.0)
    case, step = small(KINDS["classical"]), 0.5 + 0.2j
    point = operating_point.solve(replace(case, loads=loads[::-1] if turned else loads))
    now = stage(point, Switching(loads=(((1, ""), step),)))
    added = 0.6 * step.conjugate() / abs(point.V[1]) ** 2
    assert (now.Y - point.admittance())[1, 1] == pytest.approx(added, abs=1e-12)
    ((_, _, par),) = now.constants
    assert complex(par.Pp, par.Qp) == pytest.approx(0.8 + 0.2j + 0.4 * step)


def test_a_step_adds_its_power_at_the_voltage_of_the_power_flow():
    """Where that is not 1, active and reactive power of other characteristics need other factors."""
    point = operating_point.solve(small(KINDS["classical"], load=Load(2, 200.0, 50.0, p_current=1.0, v=1.0), v=1.06))
    V = abs(point.V[1])
    more = (stage(point, Switching(loads=(((1, ""), 0.5 + 0.2j),))).Y - point.admittance())[1, 1]
    assert V > 1.02
    assert more == pytest.approx(-0.2j / V**2, abs=1e-12)


@pytest.mark.parametrize(("ends", "opened"), [((3, 4), "2-4"), ((4, 3), "2-4")])
def test_a_link_with_a_dead_terminal_is_blocked(ends, opened):
    """Without bus 4, the machines feed the load at bus 2 and the losses, and nothing through the link."""
    case = small({"genrou": ROUND}, p=200.0)
    case = replace(
        case,
        buses=(*case.buses, Bus(4, "pq")),
        branches=(*case.branches, Branch(2, 4, 0.001, 0.02)),
        links=(Link("a", *ends, 50.0, 0.0),),
    )
    point = operating_point.solve(case)
    ran = run(point, [Open(opened, 0.1)], 0.2)
    P = ran.arrays.P[-1].sum()
    V = abs(ran.arrays.V[-1, 1]) / abs(ran.point.V[1])
    assert P == pytest.approx(200.0 * V**2, abs=1.0)  # MW; losses 0.45 and 0.43
    faulted = stage(point, Switching(faults=((point.case.row_of_bus[4], 1e7 + 0j),)))
    assert faulted.constants == ()  # in a fault at one converter, the other goes on


@pytest.mark.parametrize("fault_at", [None, 0.0, 0.4, 1.0])
@pytest.mark.parametrize("from_closed", [True, False])
@pytest.mark.parametrize("to_closed", [True, False])
def test_a_fault_on_a_circuit_is_on_until_both_its_ends_are_open(fault_at, from_closed, to_closed):
    state = network.BranchState(fault_at, 1e7 + 0j, from_closed, to_closed)
    switching = Switching(branches=((0, network.INTACT), (3, state)))
    assert switching.faulted == (fault_at is not None and (from_closed or to_closed))
    assert Switching(branches=((3, state),), faults=((0, 1e7 + 0j),)).faulted


def test_without_a_fault_no_fault_is_on():
    assert not Switching().faulted
    assert not Switching(shunts=((0, 1j),), loads=((0, 1 + 0j),), tripped=frozenset({0})).faulted


def test_the_network_changes_once_at_each_instant_and_is_intact_before_the_first(two_area):
    case = two_area.case
    found = timeline(case, [Open("7-8", 0.0), Open("8-9", 1.0), LoadStep(9, 1.0, 5.0)])
    assert [change.at for change in found] == [0.0, 0.0, 1.0]
    assert found[0].switching == timeline(case, [])[0].switching != found[1].switching
    assert (
        found[2].switching == timeline(case, [LoadStep(9, 0.2, 5.0), Open("8-9", 0.3), Open("7-8", 0.4)])[-1].switching
    )
