"""The storage device: power against voltage, lag, ramp, energy, efficiency."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from records import esd, zip_load
from systems import KINDS, small

from stabctl.dynamics import operating_point
from stabctl.model.tables import Storage
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

KEEP_ON = Criterion(max_angle=np.inf)
IDLE = esd.Par(
    Pp=0.0, Pc=0.0, Pg=0.0, vlow=0.5, Tlag=0.0, ramp=0.0, floor=-np.inf, capacity=np.inf, stored=0.0, efficiency=1.0,
    Smax=1.0,
)  # fmt: skip
ROLES = {"power": ("Pp", 0), "current": ("Pc", 1), "conductance": ("Pg", 2)}
EMPTY = esd.State(0.0, 0.0, 0.0)


def at_terminals(par, size, order=1.0, angle=0.3, state=EMPTY):
    """Power and current of a device at a voltage of this size and angle."""
    v = size * np.cos(angle), size * np.sin(angle)
    u = esd.Input(order, 0.0)
    return esd.equations(state, u, v, par)[0].P, complex(*esd.current(state, u, v, par))


def absorbed(*terminals, **options):
    return at_terminals(*terminals, **options)[0]


@pytest.mark.parametrize("kind", ROLES)
def test_power_against_voltage(kind):
    field, exponent = ROLES[kind]
    par = IDLE._replace(**{field: 0.4})
    for size in (0.5, 0.8, 1.0, 1.1):
        assert pytest.approx(0.4 * size**exponent, rel=1e-14) == absorbed(par, size)
        assert pytest.approx(-0.4 * size**exponent, rel=1e-14) == absorbed(par, size, -1.0)


@pytest.mark.parametrize("kind", ROLES)
def test_below_its_lowest_voltage_it_passes_continuously_to_a_conductance(kind):
    par = IDLE._replace(**{ROLES[kind][0]: 0.4})
    at = absorbed(par, 0.5)
    assert pytest.approx(at, rel=1e-7) == absorbed(par, 0.5 - 1e-9)
    for size in (0.4, 0.1, 0.0):
        assert pytest.approx(at * (size / 0.5) ** 2, abs=1e-15) == absorbed(par, size)


@given(size=st.floats(0, 1.5), order=st.floats(-1, 1), angle=st.floats(-3, 3))
def test_current_and_voltage_give_the_power_and_no_reactive_power(size, order, angle):
    P, current = at_terminals(IDLE._replace(Pp=0.3, Pc=0.2, Pg=0.1), size, order, angle)
    S = size * np.exp(1j * angle) * -current.conjugate()
    assert S.real == pytest.approx(P, abs=1e-14)
    assert S.imag == pytest.approx(0, abs=1e-14)


@given(size=st.floats(0, 1.5), angle=st.floats(-3, 3))
def test_a_load_draws_what_its_shares_say_and_is_continuous_at_its_threshold(size, angle):
    par = zip_load.Par(Pp=0.5, Qp=0.2, Pc=0.3, Qc=0.1, Pz=0.4, Qz=0.6, vlow=0.5)
    v = size * np.exp(1j * angle)
    S = -v * complex(*zip_load.current((v.real, v.imag), par)).conjugate()
    m = max(size, 0.5)
    want = ((0.5 + 0.2j) / m**2 + (0.3 + 0.1j) / m + 0.4 + 0.6j) * size**2
    assert pytest.approx(want, abs=1e-13) == S


def test_full_and_empty_stop_only_the_direction_that_goes_on():
    par = IDLE._replace(Pp=0.4, floor=0.0, capacity=10.0)
    full, empty = esd.State(0.0, 10.0, 0.0), esd.State(0.0, 0.0, 0.0)
    assert absorbed(par, 1.0, 1.0, state=full) == 0
    assert pytest.approx(-0.4) == absorbed(par, 1.0, -1.0, state=full)
    assert absorbed(par, 1.0, -1.0, state=empty) == 0
    assert pytest.approx(0.4) == absorbed(par, 1.0, 1.0, state=empty)
    assert pytest.approx(-0.4) == absorbed(par._replace(floor=-np.inf, capacity=np.inf), 1.0, -1.0, state=empty)


def driven(orders, until=2.0, step=1 / 100, **options):
    """A run with orders set from outside: {time: order}. Device of machine 1, 40 MW, at bus 2."""
    case = small(KINDS["sexs, pss, steam"]).with_storage([Storage(1, 2, 40.0, **options)])
    sim = Simulation(setup(operating_point.solve(case), step=step, criterion=KEEP_ON))
    for t, order in orders.items():
        assert sim.advance(t)
        sim.orders[0] = order
    assert sim.advance(until)
    return sim.finish()


def energy(run):
    """Energy in the only device (MWh)."""
    return run.arrays.energy[:, 0]


def test_orders_from_outside_are_followed_at_once():
    run = driven({0.5: 1.0, 1.0: -0.5, 1.5: 0.0})
    want = np.select([run.time < 0.5 - 1e-9, run.time < 1 - 1e-9, run.time < 1.5 - 1e-9], [0.0, 40.0, -20.0], 0.0)
    assert run.arrays.storage[:, 0] == pytest.approx(want, abs=1e-9)


@pytest.mark.parametrize(("kind", "exponent"), [("power", 0), ("current", 1), ("conductance", 2)])
def test_characteristic_in_a_run(kind, exponent):
    run = driven({0.5: 1.0}, characteristic=kind)
    on = run.time > 0.5
    size = np.abs(run.arrays.V[on, 1])
    assert run.arrays.storage[on, 0] == pytest.approx(40 * size**exponent, rel=1e-6)
    assert np.ptp(size) > 1e-4


def test_lag_answers_a_step_exponentially():
    run = driven({0.5: 1.0}, lag=0.1)
    after = np.maximum(run.time - 0.5, 0)
    assert run.arrays.storage[:, 0] == pytest.approx(
        40 * (1 - np.exp(-after / 0.1)), abs=1e-4
    )  # 3.1e-5, RK4 at h/T = 0.1


def test_ramp_limits_the_order():
    run = driven({0.5: 1.0, 1.5: -1.0}, ramp=80.0, until=2.5)
    steps = np.diff(run.arrays.storage[:, 0])
    assert np.abs(steps).max() == pytest.approx(0.8, rel=1e-9)  # MW in 1/100 s
    assert run.arrays.storage[np.searchsorted(run.time, 0.99), 0] == pytest.approx(40, abs=0.9)
    assert run.arrays.storage[np.searchsorted(run.time, 0.75), 0] == pytest.approx(20, abs=0.9)
    assert run.arrays.storage[-1, 0] == pytest.approx(-40, abs=0.9)


@pytest.mark.parametrize("efficiency", [1.0, 0.81])
def test_store_holds_the_integral_of_the_power_less_the_losses_each_way(efficiency):
    run = driven({0.5: 1.0, 1.0: -1.0}, energy=1.0, charge=0.5, efficiency=efficiency)
    way = np.sqrt(efficiency)
    P = run.arrays.storage[:-1, 0]
    gained = np.r_[0, np.cumsum(np.where(P > 0, way, 1 / way) * P * np.diff(run.time))] / 3600
    assert energy(run) == pytest.approx(0.5 + gained, abs=1e-12)
    assert np.ptp(energy(run)) > 4e-3


@pytest.mark.parametrize(("order", "charge"), [(1.0, 1.0), (-1.0, 0.0)])
def test_a_full_store_absorbs_and_an_empty_one_injects_nothing(order, charge):
    run = driven({0.5: order}, energy=1.0, charge=charge)
    assert np.abs(run.arrays.storage).max() == 0
    turned = driven({0.5: -order}, energy=1.0, charge=charge)
    assert turned.arrays.storage[-1, 0] == pytest.approx(-40 * order)


@pytest.mark.parametrize(("order", "charge"), [(1.0, 0.5), (-1.0, 0.5)])
def test_a_small_store_stops_when_full_or_empty(order, charge):
    capacity = 0.01  # MWh: half of it lasts 0.45 s at 40 MW
    run = driven({0.5: order}, energy=capacity, charge=charge)
    worked = np.abs(run.arrays.storage[:, 0]) > 1
    assert run.time[worked].max() == pytest.approx(0.95, abs=0.011)
    assert run.arrays.storage[-1, 0] == 0
    assert energy(run).max() <= capacity
    assert energy(run).min() >= 0


def test_a_store_with_lag_and_limits_starts_at_rest():
    run = driven({}, energy=2.0, charge=0.25, lag=0.05, ramp=10.0)
    assert energy(run) == pytest.approx(0.5, abs=1e-12)
    assert np.abs(run.arrays.speed - 1).max() < 1e-12
