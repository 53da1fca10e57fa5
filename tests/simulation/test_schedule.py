"""Orders laid down in advance: what is ordered is what happens, at its time, and what stands above it."""

import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.controllers import BangBang
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.schedule import Schedule
from stabctl.simulation.simulate import simulate

FAULT = Contingency("7-8@0.4", clear="12cyc", at=0.5)


@pytest.fixture(scope="module")
def point(cases):
    return cases("two_area").initialize(storage="50MW")


def _orders(run, frame, rate=60, start=0.0):
    """Orders recorded in a frame (steps, devices)."""
    return run.arrays.order[np.floor((run.time - start) * rate + 1e-6).astype(int) == frame]


def test_every_order_is_held_for_its_frame_and_the_devices_are_idle_before_and_after(point):
    table = np.random.default_rng(1).uniform(-1, 1, (30, 4))
    run = simulate(point, None, 1.5, control=Schedule(table, rate=30, start=0.2))
    for frame, wanted in enumerate(table):
        held = _orders(run, frame, 30, 0.2)
        assert len(held) == 4
        assert np.all(held == wanted)
    assert np.all(run.arrays.order[run.time < 0.2 - 1e-9] == 0)
    assert np.all(run.arrays.order[run.time > 1.2 + 1e-9] == 0)
    assert run.arrays.storage == pytest.approx(50 * run.arrays.order, abs=1e-9)


def test_a_device_is_idle_while_its_voltage_is_low(point):
    full, low = np.ones((120, 4)), (FAULT.at, FAULT.at + 0.2)
    run = simulate(point, FAULT, 2.0, control=Schedule(full))
    bus = [point.net.place[s.bus] for s in point.case.storage]
    during = (run.time > low[0] + 0.05) & (run.time < low[1] - 1e-9)
    volts = np.abs(run.arrays.V[:, bus])
    assert (volts[during] < 0.8).any()
    assert (volts[during] > 0.8).any()
    assert np.array_equal(run.arrays.order[during] == 0, volts[during] < 0.8)
    free = simulate(point, FAULT, 2.0, control=Schedule(full, min_voltage=0.0))
    assert np.all(free.arrays.order[:-1] == 1)


def test_the_law_takes_over_after_the_last_frame(point):
    law = BangBang(deadband=0.1)
    run = simulate(point, FAULT, 5.0, control=Schedule(np.zeros((60, 4)), law=law))
    sampled = np.flatnonzero((run.time > 1.0) & (np.abs(run.time * 60 % 1 - 0.5) > 0.49))
    hz, H = 60 * run.arrays.speed[sampled], point.inertia
    deviation = (hz - (hz @ H / H.sum())[:, None]) * H.sum() / (H.sum() - H)
    wanted = np.where(np.abs(deviation) > 0.1, np.sign(deviation), 0)
    assert np.array_equal(run.arrays.order[sampled], wanted)
    assert set(np.unique(wanted)) == {-1, 0, 1}
    assert np.all(run.arrays.order[run.time < 1.0 - 1e-9] == 0)


@pytest.mark.parametrize("orders", [np.full((3, 4), 1.5), np.full((3, 4), np.nan), np.zeros(4)])
def test_orders_beyond_the_rating_are_refused(orders):
    with pytest.raises(StudyError, match="orders from -1 to 1"):
        Schedule(orders)


def test_a_schedule_for_another_fleet_is_refused(point):
    with pytest.raises(StudyError, match="orders for 3 devices, but two_area has 4"):
        simulate(point, None, 1.0, control=Schedule(np.zeros((3, 3))))
