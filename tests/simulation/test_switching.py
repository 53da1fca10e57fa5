"""Jumps of power within a step: switching orders, full and empty devices; states that reach their limits."""

import numpy as np
import pytest
from systems import KINDS, SEXS, small

from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.model.tables import Storage
from stabctl.simulation import simulation
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import Clear, Fault
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation
from stabctl.simulation.steps import STEP

KEEP_ON = Criterion(max_angle=np.inf)


def fleet(case, share=0.05, **values):
    """An operating point with a device at every machine, rated at a share of its MVA."""
    rows = (Storage(m.machine, m.storage_bus, share * m.base, **values) for m in case.machines)
    return operating_point.solve(case.with_storage(rows))


def angles(point, fault, step, until=3.0, law=None):
    """Angles (rad) against the first machine at every 1/60 s."""
    run = simulation.run(point, fault, until, control=law or BangBang(), step=step, criterion=KEEP_ON)
    rows = np.searchsorted(run.time, np.arange(60 * until) / 60 - 1e-9)
    return run.arrays.angle[rows] - run.arrays.angle[rows][:, [0]]


@pytest.mark.parametrize(
    ("name", "fault", "values", "largest"),
    [
        ("two_area", Contingency("7", "5cyc", "7-8"), {}, 2.5e-4),  # 1.7e-4; 2.3e-3 with orders changed between steps
        ("two_area", Contingency("7", "5cyc", "7-8"), {"energy": 0.006}, 7e-4),  # 5.4e-4; full after 0.24 s
        pytest.param("wnaps_paper", Contingency("83", "5cyc", "83-33"), {}, 2e-5, marks=pytest.mark.slow),  # 1.3e-5
    ],
)
def test_a_step_of_1_120_s_agrees_with_a_fine_one_although_orders_switch_within_it(cases, name, fault, values, largest):
    point = fleet(cases(name), **values)
    assert np.abs(angles(point, fault, STEP) - angles(point, fault, STEP / 16)).max() < largest


def test_halving_the_step_divides_the_error_by_four_or_more_on_average(cases):
    """Order 2 or more between 1/120 and 1/960 s: three halvings divide it by 64 or more (measured: 37 in the worst)."""
    point, fault = fleet(cases("two_area")), Contingency("7", "5cyc", "7-8")
    exact = angles(point, fault, STEP / 64)
    coarse, fine = (np.abs(angles(point, fault, h) - exact).max() for h in (STEP, STEP / 8))
    assert coarse / fine > 30


@pytest.mark.parametrize("order", [1.0, -1.0])
def test_a_device_that_fills_or_empties_within_a_step_stops_there(order):
    """The same as an order that ends at the instant of the limit, which is computed by hand."""
    case = small(KINDS["bare"])
    limited = operating_point.solve(case.with_storage([Storage(1, 2, 40.0, energy=0.01, charge=0.5)]))
    free = operating_point.solve(case.with_storage([Storage(1, 2, 40.0)]))
    instant = 0.1 + 0.005 * 3600 / 40  # s, 0.55: 66 steps of 1/120 s
    instant += 0.3 / 120

    def run(point, end):
        made = Simulation(setup(point, criterion=KEEP_ON), [Fault("2", 0.05), Clear("2", 0.08)])
        made.advance(0.1 + 0.3 / 120)
        made.orders[:] = order
        made.advance(end)
        if point is free:
            made.orders[:] = 0.0
        made.advance(0.7)
        return made

    stopped, ended = run(limited, 0.65), run(free, instant)
    assert stopped.angle == pytest.approx(ended.angle, abs=5e-9)  # 1.6e-9: voltages are solved to 1e-7 pu
    assert stopped.finish().arrays.storage[-1] == 0


@pytest.mark.parametrize("later", [0.4, -0.2])
def test_two_devices_that_stop_within_a_step_stop_one_after_the_other(later):
    """The second one `later` (steps) than the first one of the case, or before it."""
    case, lasts = small(KINDS["bare"]), (0.45, 0.45 + later / 120)  # s
    sites = [Storage(1, 2, 40.0), Storage(2, 3, 20.0)]
    small_stores = [s._replace(energy=2 * s.rating * t / 3600, charge=0.5) for s, t in zip(sites, lasts, strict=True)]
    limited, free = (operating_point.solve(case.with_storage(s)) for s in (small_stores, sites))

    def run(point):
        made = Simulation(setup(point, criterion=KEEP_ON), [Fault("2", 0.05), Clear("2", 0.08)])
        begin = 0.1 + 0.3 / 120
        made.advance(begin)
        made.orders[:] = -1.0
        for j in np.argsort(lasts) if point is free else ():
            made.advance(begin + lasts[j])
            made.orders[j] = 0.0
        made.advance(0.7)
        return made

    assert run(limited).angle == pytest.approx(run(free).angle, abs=5e-9)


def test_chattering_orders_are_left_to_the_ends_of_the_steps(cases):
    """Without a deadband orders switch all the time; the run ends, and every order is allowed."""
    run = simulation.run(fleet(cases("two_area")), Contingency("7", "5cyc", "7-8"), 6.0, control=BangBang(0.0))
    assert set(np.unique(run.arrays.order)) <= {-1.0, 0.0, 1.0}
    assert (np.diff(run.arrays.order, axis=0) != 0).sum() > 200


def test_a_state_that_reaches_its_limit_within_a_step_is_there_at_its_end():
    """Field voltage after a voltage drop: the exact rise passes the limit after 0.6 of the step."""
    point = operating_point.solve(
        small(KINDS["bare"] | {"sexs": SEXS._replace(TR=0.0, KA=20.0, TA=0.02, Efdmax=4.0, Efdmin=-4.0)})
    )
    events = [Fault("2", 0.1), Clear("2", 0.2)]
    run = simulation.run(point, events, 0.3, step=STEP, criterion=KEEP_ON)
    fine = simulation.run(point, events, 0.3, step=STEP / 32, criterion=KEEP_ON)
    efd, exact = (r.field_voltage.to_numpy()[:, 0] for r in (run, fine))
    reached = fine.time[np.argmax(exact == 4.0)]
    assert 0.1 < reached < 0.2
    assert efd[np.searchsorted(run.time, reached - 1e-9)] == 4.0
