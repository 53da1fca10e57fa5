"""The laws that control storage, alone and in a run."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from systems import CLASSICAL, KINDS, REGC, ROUND, doubled, small

from stabctl.controllers import BangBang, Controller, Feedback, Input, StorageDevice, bang_bang, decided
from stabctl.dynamics import operating_point
from stabctl.model.tables import Storage
from stabctl.simulation import control, simulation
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import Clear, Fault, Open, TripMachine
from stabctl.simulation.setup import setup
from stabctl.simulation.simulate import simulate

KEEP_ON = Criterion(max_angle=np.inf)


class TestBangBangLaw:
    LAW = BangBang()
    PAR = LAW.par(StorageDevice(50.0, 900.0, 60.0))

    def test_constants(self):
        assert bang_bang.Par(0.1 / 60, 0.8) == self.PAR

    @given(st.floats(-1, 1), st.floats(0, 1.5))
    def test_it_absorbs_when_fast_injects_when_slow_and_idles_inside_deadband_and_gate(self, deviation, voltage):
        order = decided(self.LAW, self.PAR, Input(deviation, 0.0), voltage).wanted
        if voltage < 0.8 or abs(deviation) <= 0.1 / 60:
            assert order == 0
        else:
            assert order == np.sign(deviation)

    def test_edges(self):
        for deviation, voltage, order in (
            (0.1 / 60, 1.0, 0),
            (0.1001 / 60, 1.0, 1),
            (-0.1001 / 60, 0.8, -1),
            (0.1, 0.7999, 0),
        ):
            assert decided(self.LAW, self.PAR, Input(deviation, 0.0), voltage).wanted == order


class TestFeedbackLaw:
    DEVICE = StorageDevice(50.0, 900.0, 60.0)

    @given(st.floats(-0.05, 0.05), st.floats(-0.1, 0.1), st.floats(0, 1.2))
    def test_power_is_gain_times_speed_and_acceleration_on_the_machine_base(self, slip, rate, size):
        """P = S (Kv w + Ka w') with w in rad/s (the paper, eq. (13)), idle at low voltage; the hold limits it."""
        law = Feedback(speed_gain=0.02, acceleration_gain=0.01)
        order = decided(law, law.par(self.DEVICE), Input(slip, rate), size).wanted
        wb = 2 * np.pi * 60
        want = 900 * (0.02 * wb * slip + 0.01 * wb * rate)
        assert 50 * order == pytest.approx(want if size >= 0.8 else 0, abs=1e-9)

    @given(st.floats(-0.05, 0.05), st.floats(-0.1, 0.1))
    def test_braking_never_feeds_the_swing(self, slip, rate):
        """Eq. (14): the power has the sign of the speed and the size of the acceleration."""
        law = Feedback(0.0, 0.001, braking=True)
        order = decided(law, law.par(self.DEVICE), Input(slip, rate), 1.0).wanted
        assert order * slip >= 0
        assert abs(order) == pytest.approx(abs(rate) * 0.001 * 2 * np.pi * 60 * 18 * (slip != 0), abs=1e-12)


@pytest.fixture(scope="module")
def bang(cases):
    """Two-area, fault at 7, eight cycles, 50 MW at every high-voltage bus."""
    case = cases("two_area")
    point = operating_point.solve(case.with_storage(Storage(m.machine, m.storage_bus, 50.0) for m in case.machines))
    events = [Fault("7", 1.0), Clear("7", 1 + 8 / 60), Open("7-8", 1 + 8 / 60)]
    return simulation.run(point, events, 6.0, control=BangBang(), criterion=KEEP_ON)


def test_orders_follow_the_speed_against_the_rest_of_the_system(bang):
    """Recomputed from the trajectory: own speed against the COI of the other three, own voltage, deadband, gate."""
    H, case = bang.point.inertia, bang.point.case
    rest = (bang.arrays.speed @ H)[:, None] - bang.arrays.speed * H
    deviation = bang.arrays.speed - rest / (H.sum() - H)
    size = np.abs(bang.arrays.V[:, [bang.point.net.place[s.bus] for s in case.storage]])
    want = np.where((size < 0.8) | (np.abs(deviation) <= 0.1 / 60), 0.0, np.sign(deviation))
    clear = (np.abs(np.abs(deviation) - 0.1 / 60) > 1e-9) & (np.abs(size - 0.8) > 1e-2)
    assert (clear.mean(), np.abs(want).mean()) > (0.95, 0.05)
    wrong = (bang.arrays.storage != 0) & clear & (np.abs(bang.arrays.storage - 50 * want) > 1e-6)
    assert not wrong.any()
    assert np.array_equal((np.abs(bang.arrays.storage) > 1)[clear], (want != 0)[clear])


def test_each_law_gives_its_own_orders_whatever_ran_before(bang):
    """Feedback after bang-bang in one process: orders in proportion to the deviation, recomputed from the run."""
    point, law = bang.point, Feedback(speed_gain=0.002)
    run = simulation.run(point, [Fault("7", 0.1), Clear("7", 0.2)], 2.0, control=law, criterion=KEEP_ON)
    H, base = point.inertia, np.array([m.base for m in point.case.machines])
    deviation = run.arrays.speed - ((run.arrays.speed @ H)[:, None] - run.arrays.speed * H) / (H.sum() - H)
    size = np.abs(run.arrays.V[:, [point.net.place[s.bus] for s in point.case.storage]])
    want = np.where(size < 0.8, 0.0, np.clip(0.002 * 2 * np.pi * 60 * base / 50 * deviation, -1, 1))
    clear = np.abs(size - 0.8) > 1e-2
    assert np.abs(run.arrays.order - want)[clear].max() < 1e-9
    assert len(np.unique(np.round(run.arrays.order, 6))) > 100


def test_it_idles_at_low_voltage(bang):
    case = bang.point.case
    size = np.abs(bang.arrays.V[:, [bang.point.net.place[s.bus] for s in case.storage]])
    assert (size < 0.8).any()
    assert np.abs(bang.arrays.storage[size < 0.8 - 1e-6]).max() == 0


def test_it_works_in_both_directions_and_calms_down(bang):
    assert bang.arrays.storage.max() == pytest.approx(50)
    assert bang.arrays.storage.min() == pytest.approx(-50)
    assert np.abs(bang.arrays.storage[-1]).max() == 0


@pytest.mark.parametrize("lag", [0.0, 0.1])
def test_the_device_of_a_tripped_machine_idles(cases, lag):
    case = cases("two_area")
    point = operating_point.solve(
        case.with_storage(Storage(m.machine, m.storage_bus, 50.0, lag=lag) for m in case.machines)
    )
    events = [Fault("7", 0.5), Clear("7", 0.6), TripMachine(1, 0.8)]
    run = simulation.run(point, events, 4.0, control=BangBang(), criterion=KEEP_ON)
    before, after = run.time < 0.8, run.time > 0.8 + 12 * lag
    assert np.abs(run.arrays.storage[before, 0]).max() > 10
    assert np.abs(run.arrays.storage[after, 0]).max() < 1e-3
    assert np.abs(run.arrays.storage[after, 1]).max() > 10


def test_a_device_alone_in_its_island_idles():
    case = small(KINDS["bare"]).with_storage([Storage(1, 2, 40.0)])
    events = [Open("2-3", 0.1), Open("2-3#2", 0.1)]
    run = simulation.run(operating_point.solve(case), events, 0.5, control=BangBang(), criterion=KEEP_ON)
    assert run.arrays.speed[-1, 0] > 1.003
    assert np.abs(run.arrays.storage).max() == 0


def test_a_law_in_python_sees_the_rotors_of_a_system_with_a_converter():
    """A converter has no speed to follow, but its storage device takes orders."""
    shown = []

    def law(seen):
        shown.append(seen)
        return [0.5, 10 * seen["deviation"][0]] if seen.time else 0.0

    case = doubled(small(KINDS["bare"]))
    case = replace(case, devices={"genrou": {101: ROUND}, "gencls": case.devices["gencls"], "regc_a": {1: REGC}})
    point = operating_point.solve(case.with_storage([Storage(1, 2, 40.0), Storage(101, 2, 40.0)]))
    events = [Fault("2", 0.1), Clear("2", 0.18), TripMachine(2, 0.3)]
    control = Controller.from_function(law, "deviation, speed, angle", "order")
    run = simulation.run(point, events, 0.5, control=control, criterion=KEEP_ON)
    assert shown[0]["speed"].shape == shown[0]["angle"].shape == shown[0]["deviation"].shape == (2,)
    deviation = np.array([seen["deviation"][0] for seen in shown if seen.time < 0.3 - 1e-9])
    rows = np.searchsorted(run.time, [seen.time - 1e-9 for seen in shown[: len(deviation)]])
    assert deviation == pytest.approx(run.arrays.speed[rows, 0] - run.arrays.speed[rows, 1], abs=1e-12)
    assert np.ptp(deviation) > 1e-3
    assert shown[-1]["deviation"][0] == 0  # alone in its island
    assert run.arrays.storage[-1, 0] == pytest.approx(20.0)


def test_a_run_whose_storage_gets_no_orders_says_so_when_it_is_printed(points):
    """Once, and not where a law or a controller gives them, or there is nothing to order."""
    point, said = points("two_area"), "No orders are given to the storage: give control=BangBang(), for example."
    assert str(simulate(point, None, 0.1, storage="50MW")).count(said) == 1
    orders = Controller(("deviation:1",), ("order:1",), *(np.zeros(one) for one in ((0, 0), (0, 1), (1, 0))), [[9.0]])
    for storage, law in (("50MW", BangBang()), ("50MW", orders), ("0MW", None), (None, None)):
        assert said not in str(simulate(point, None, 0.1, storage=storage, control=law))
    by_hand = simulation.Simulation(setup(operating_point.solve(point.case.with_storage("50MW"))))
    by_hand.advance(0.1)
    assert said not in str(by_hand.finish())


def test_at_rest_an_order_follows_the_acceleration():
    """A fault begins at a deviation of exactly 0: the order is that of the acceleration, as just beside it."""
    law = Feedback(speed_gain=0.02, acceleration_gain=0.01)
    at = [decided(law, law.par(TestFeedbackLaw.DEVICE), Input(slip, 0.001), 1.0).wanted for slip in (0.0, 1e-15)]
    assert at[0] == pytest.approx(at[1])
    assert at[0] > 0


def reading(outputs):
    """A controller without states of these outputs."""
    n = len(outputs)
    return Controller(("deviation:1",), outputs, *(np.zeros(one) for one in ((0, 0), (0, 1), (n, 0))), [[9.0]] * n)


@pytest.mark.parametrize(
    ("outputs", "gives"),
    [
        (("order:1",), True),
        (("order:1@5",), True),
        (("order",), True),
        (("vs:1", "order:4"), True),
        (("order_q:1",), False),
        (("order_v:1",), False),
        (("vs:1",), False),
        (("pref:4", "vref:1"), False),
    ],
)
def test_a_law_stands_beside_controllers_unless_one_gives_orders(outputs, gives):
    """Orders of reactive power or of a voltage are none of active power, but the storage has orders."""
    one, other, law = reading(outputs), reading(("vref:1",)), BangBang()
    assert control.ordered([one]) == control.ordered([other, one]) == gives
    assert control.with_law([one], law) == ([one] if gives else [law, one])
    assert control.with_law([other, one], law) == ([other, one] if gives else [law, other, one])
    assert control.with_law([Feedback(3.0), one], law) == [Feedback(3.0), one]
    assert control.with_law([], law) == [law]
    case = small({"gencls": CLASSICAL}).with_storage("5MW")
    assert control.idle(case, [one]) == (not any("order" in name for name in outputs))
    assert not control.idle(case, [law, one])
    assert not control.idle(case.with_storage("0MW"), None)
