"""Islands that a network had from the beginning are no event; each keeps its own center of inertia and frequency."""

from operator import attrgetter

import numpy as np
import pytest
from islands import SHIFT, joined, single

import stabctl as st
from stabctl.clearing.trial import _equivalent
from stabctl.simulation.criterion import Criterion

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


def test_a_bus_angle_is_that_against_the_machines_that_are_left(alone):
    """Whichever machine is tripped; of the first one of its island, too."""
    gain = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[0.5]]
    control = st.Controller(("bus_angle:5",), ("order:2",), *gain)
    run = alone.simulate([st.TripMachine(1, 0.2)], "1s", control=control)
    H = alone.inertia * run.on
    angle = np.angle(run.arrays.V[:, 4]) - (H * run.arrays.angle).sum(axis=1) / H.sum(axis=1)
    assert np.abs(run.arrays.order[:, 1] - 0.5 * (angle - angle[0])).max() < 1e-9  # 1e-16
    assert run.arrays.order[-1, 1] < -0.4


@pytest.mark.parametrize("gain", [20.0, -200.0])
@pytest.mark.parametrize("signal", ["angle:1", "bus_angle:5"])
def test_the_loop_of_controllers_at_rest_is_that_of_its_island(both, alone, signal, gain):
    """An angle against the center of inertia of both islands grew by 0.017 1/s, or by that instead of 8.2 1/s."""
    empty = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    control = st.Controller((signal,), ("order:1",), *empty, [[gain]])
    ends = [str(point.simulate("7:+0.001MW@0.01s", "0.05s", control=control).outcome) for point in (both, alone)]
    said = [end.partition("Where the control acts")[2] for end in ends]
    assert said[0] == said[1]
    assert bool(said[0]) == (signal == "angle:1" and gain < 0)


def test_a_tripped_machine_is_no_island_whose_frequency_is_judged(both, alone):
    """The island is named only beside others with machines."""
    narrow = Criterion(min_frequency="59.95Hz", frequency_delay_s=0.1)
    for point, island in ((alone, ""), (both, " of the island of machines 2, 3, 4")):
        end = point.simulate([st.TripMachine(1, 0.5)], "8s", criterion=narrow).outcome
        assert end.kind == "frequency_instability"
        assert str(end).startswith(f"The frequency{island} was outside 59.95 to 62 Hz for 0.1 s at ")


def test_a_machine_that_was_alone_before_is_judged_as_any_other():
    """One that a switching leaves alone is tripped; one that was alone is the system of its own that it always was."""
    lone, two = single(st.load("two_area"), 300.0), st.load("wscc9")
    ends = [
        case.simulate(f"{bus}:-290MW@0.5s", "10s").outcome for case, bus in ((lone, 2), (joined(two, lone), 2 + SHIFT))
    ]
    assert [end.kind for end in ends] == ["frequency_instability"] * 2
    assert ends[0].time_s == pytest.approx(ends[1].time_s, abs=1e-6)
    assert f"of the island of machine {SHIFT + 1} " in str(ends[1])


def test_the_frequency_of_an_island_without_a_governor_is_not_judged_beside_one_with_governors():
    """Nothing restores the frequency of wscc9: 73 Hz 10 s after a load of 150 MW is lost, alone or beside two_area."""
    two, nine = st.load("two_area"), st.load("wscc9")
    ends = [
        case.simulate(f"{bus}:-150MW@0.5s", "10s").outcome for case, bus in ((nine, 5), (joined(two, nine), 5 + SHIFT))
    ]
    assert [end.kind for end in ends] == ["stable"] * 2
    assert "73.06 Hz in the island of machine 1001" in str(ends[1])


def test_swings_and_angles_are_those_against_the_center_of_the_own_island(both, alone):
    run, one = (point.simulate(FAULT, "2s") for point in (both, alone))
    for name in ("arrays.swing", "angle_from_coi_deg"):
        of_both, of_one = (attrgetter(name)(r) for r in (run, one))
        assert np.abs(of_both[:, :4] - of_one).max() < 1e-5  # 2e-7
        assert np.ptp(of_both[:, 4:], axis=0).max() < 1e-6


def test_the_margin_of_a_lost_run_is_that_of_its_island(both, alone):
    """The others are those of the island, not the machines that the widest gap parts off: both rotate apart."""
    lost = st.Contingency("7-8@0.4", clear="30cyc")
    speeds = [_equivalent(point.simulate(lost, "4s")) for point in (both, alone)]
    assert speeds[0][1] == pytest.approx(speeds[1][1], rel=1e-12)
    assert speeds[0][0] == pytest.approx(speeds[1][0], abs=1e-7)


def test_an_automatic_trip_happens_when_it_happens(alone):
    """Bus 1 keeps its voltage until machine 1, cut off with it, has run away; the change of the network is then."""
    run = alone.simulate("1-5@0.5s", "3s")
    (off,) = run.happened.off_s[np.isfinite(run.happened.off_s)]
    assert off > 1.5
    tripped = [c.at for c in run.happened.changes if c.switching.tripped]
    assert tripped == [pytest.approx(off, abs=1e-9)]
    bus = [b.bus for b in run.point.case.buses].index(1)
    voltage = run.voltage.values[:, bus]
    assert run.energized[run.time < off - 1e-9, bus].all()
    assert voltage[run.time < off - 1e-9].min() > 0.9
    assert not run.energized[run.time > off, bus].any()


def test_angles_are_against_the_island_of_that_moment(alone):
    """The areas drift apart by turns; against its own, no machine has moved far."""
    run = alone.simulate(["7-8@0.5s", "7-8#2@0.5s"], "4s")
    angle = run.angle_from_coi_deg
    before, after = run.time < 0.5 - 1e-9, run.time > 0.5
    H = run.point.inertia
    for rows, groups in ((before, [[0, 1, 2, 3]]), (after, [[0, 1], [2, 3]])):
        for own in groups:
            assert np.abs(angle[np.ix_(rows, own)] @ H[own]).max() < 1e-8
    assert np.abs(angle[after]).max() < 25  # 19; 1951 against the center of all
    assert np.ptp(np.rad2deg(run.arrays.angle[after] @ [1, 1, -1, -1])) > 500


def test_angles_against_a_machine_that_is_off_are_not_known(alone):
    table = alone.simulate(st.TripMachine(1, 0.5), 1.0).table("angle:2", angle_reference=1)
    assert table[table.time_s < 0.5 - 1e-9].iloc[:, 1].notna().all()
    assert table[table.time_s > 0.5].iloc[:, 1].isna().all()


def test_a_trip_by_itself_is_no_event(alone):
    """What is seen after the last event begins with the switching."""
    run = alone.simulate("1-5@0.5s", "3s")
    assert [c.automatic for c in run.happened.changes] == [False, False, True]
    assert run.happened.last_event_s == 0.5


@pytest.mark.parametrize("kind", ["deviation", "angle_deviation"])
def test_a_group_of_which_all_are_off_is_at_rest(kind):
    base = st.load("two_area").initialize(storage="3@11=50MW")
    gain = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1.0]]
    one = st.Controller((f"{kind}:1+2",), ("order:3@11",), *gain, limits=1.0)
    run = base.simulate([st.TripMachine(1, 0.2), st.TripMachine(2, 0.2)], "0.5s", control=one)
    assert np.abs(run.storage.values[run.time > 0.21]).max() == 0


def test_a_group_whose_first_machine_is_off_is_seen_through_the_others():
    """Controllers that read a group act as the law that does, after machine 1 of the two has been tripped."""
    base = st.load("two_area").initialize(storage="2@6=50MW")
    law = st.StorageLaw(("1+2",), deadband="0.05Hz")
    events = [st.TripMachine(1, "0.2s"), st.Fault("7", "0.4s"), st.Clear("7", "0.5s")]
    several = law.controllers(base.case)
    assert any("deviation:1+2" in one.inputs for one in several)
    runs = [base.simulate(events, "1.5s", control=control) for control in (law, [*several])]
    power = [run.storage.values[run.time > 0.45] for run in runs]
    assert np.abs(power[0]).max() > 40
    assert np.mean(np.abs(power[1] - power[0]) > 1) < 0.05  # 0.008: instants of a relay differ by a step
