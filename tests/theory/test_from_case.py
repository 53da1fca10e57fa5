"""The equivalent from a case: exact for two machines, and in agreement with the full simulation."""

import numpy as np
import pytest
from islands import joined, single
from records import gencls

from reproduction import paper
from stabctl import io
from stabctl._util.errors import StudyError
from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang, Feedback
from stabctl.dynamics import operating_point
from stabctl.model import fleet
from stabctl.model.case import Case
from stabctl.model.tables import Branch, Bus, Load, Machine
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run
from stabctl.theory.omib import during_fault
from stabctl.theory.two_machine import Equivalent, equivalent


@pytest.fixture(scope="module")
def two():
    """Machine 1 sends 50 MW to machine 2 over two lines; lossless, no load, on one base."""
    buses = (Bus(1, "pv", 1.0), Bus(2, "swing", 1.0))
    branches = (Branch(1, 2, 0.0, 1.0), Branch(1, 2, 0.0, 1.0))
    machines = (Machine(1, 1, 100, 50, 1), Machine(2, 2, 100, -50, 2))
    rows = {
        1: gencls.Par(mva=0, wb=0, H=1.0, D=0, ra=0, x1d=0.25),
        2: gencls.Par(mva=0, wb=0, H=6.0, D=0, ra=0, x1d=0.25),
    }
    return Case("two", buses, branches, machines, {"gencls": rows})


def test_two_machines_are_their_own_equivalent(two):
    found = equivalent(two, 1)
    point = operating_point.solve(two)
    E = point.s[[point.layout.signals[unit, "Efd"] for unit in point.rotors.unit]]
    assert (found.H1, found.HCOI, found.base) == (1.0, 6.0, 100)
    assert 1 / found.X == pytest.approx(E[0] * E[1], rel=1e-12)  # X = 0.25 + 1/2 + 0.25
    assert found.Pm1 == pytest.approx(0.5, abs=1e-9)
    assert found.omib.start == pytest.approx(np.ptp(point.rotor_angle), abs=1e-9)


def test_its_critical_time_is_that_of_the_simulation(two):
    exact = equivalent(two, 1).critical().cycles
    fault = clearing_time(two, "1", resolution="0.015625cyc", limit="30cyc", step=1 / 480)
    assert fault.cycles <= exact < fault.cycles + 1 / 64 + 0.01


@pytest.fixture(scope="module")
def loaded(two):
    """Machine 1 sends 150 MW through lines with losses; a load of 120 MW between, machines with resistance."""
    buses = (Bus(1, "pv", 1.02), Bus(2, "pq", 1.0), Bus(3, "swing", 1.0))
    branches = (Branch(1, 2, 0.01, 0.1), Branch(2, 3, 0.03, 0.2, b=0.1), Branch(2, 3, 0.03, 0.2, b=0.1))
    machines = (Machine(1, 1, 200, 150, 1), Machine(2, 3, 800, 0, 3))
    rows = {
        1: gencls.Par(mva=0, wb=0, H=3.0, D=0, ra=0.01, x1d=0.3),
        2: gencls.Par(mva=0, wb=0, H=5.0, D=0, ra=0.005, x1d=0.2),
    }
    return Case("loaded", buses, branches, machines, {"gencls": rows}, loads=(Load(2, 120, 40),))


def test_loads_and_losses_of_the_faulted_network_count(loaded):
    """Exact for two machines: in the fault, machine 1 supplies its resistance alone, and machine 2 the load."""
    pair = equivalent(loaded, 1)
    fault = clearing_time(loaded, "1", resolution="0.015625cyc", scan="0s", step=1 / 480)
    assert fault.cycles <= pair.critical().cycles < fault.cycles + 1 / 64 + 0.01


@pytest.mark.parametrize(("name", "machine"), [("two_area", 1), ("two_area", 2), ("wscc9", 3), ("ieee39", 9)])
def test_the_fault_accelerates_the_machine_as_in_a_simulation(name, machine):
    """The first 2 ms of a fault at its bus, with classical machines and loads as constant impedances."""
    case = io.load(name).classical().with_loads("impedance")
    pair, point = equivalent(case, machine), operating_point.solve(case)
    own = case.machines.index(case.machine(machine))
    run_ = run(point, Contingency(str(case.machines[own].bus), 0.002), until=1.004, step=0.001)
    H = np.array([case.devices["gencls"][m.machine].H * m.base for m in case.machines])
    others = np.arange(len(H)) != own
    speed = run_.arrays.speed[run_.time < 1.002 + 1e-9][-1]
    gained = speed[own] - H[others] @ speed[others] / H[others].sum()
    expected = during_fault(pair.omib, 0.002)[1]
    assert 2 * np.pi * case.frequency_hz * gained == pytest.approx(expected, rel=1e-4)


def test_machines_of_another_island_do_not_count(two):
    """Two copies without a connection: the equivalent is that of one; a machine alone has none."""
    found, one = equivalent(joined(io.load("two_area"), io.load("two_area")), 1), equivalent(io.load("two_area"), 1)
    assert [found.HCOI, found.Pm1, found.X] == pytest.approx([one.HCOI, one.Pm1, one.X], rel=1e-9)
    with pytest.raises(StudyError, match="no other machine connected"):
        equivalent(joined(two, single(io.load("two_area"), 100.0)), 1001)


def test_one_machine_of_a_large_case(two):
    case = io.load("wnaps")
    found = equivalent(case, 14)
    assert found.H1 == pytest.approx(6.5 * 23)
    assert (
        pytest.approx(sum(case.devices["genrou"][m.machine].H * m.base for m in case.machines) / 100)
        == found.H1 + found.HCOI
    )
    assert 0 < found.omib.start < np.pi / 2
    with pytest.raises(StudyError, match="no machine 99"):
        equivalent(case, 99)


def test_table_2_has_the_powers_it_states():
    assert Equivalent().omib.start == pytest.approx(paper.TABLE_2["start"].value, abs=1e-4)


@pytest.mark.parametrize("law", [Feedback(0.02), Feedback(0.02, -0.004), Feedback(0.0, 0.007, braking=True)])
def test_feedback_laws_hold_a_multi_machine_case(law):
    """The laws (13), (14) as storage orders save what is lost without, within the rating, and damp."""
    case = io.load("two_area")
    point = operating_point.solve(case.with_storage(fleet.everywhere(case, "100MW")))
    events = Contingency("7-8@0.4", 21 / 60)
    assert run(point, events).outcome.machine == 4
    held = run(point, events, control=law)
    assert held.outcome.stable
    assert np.abs(held.arrays.storage).max() <= 100 * (1 + 1e-9)
    half = np.abs(held.arrays.storage[1:]) < 100 * 0.5
    assert (half & (np.abs(held.arrays.storage[1:]) > 1)).any()  # continuous orders, no bang-bang


def test_negative_acceleration_gain_lightens_the_rotor():
    """With (13) and Ka < 0 the law injects while the machine accelerates: its order has the sign of Ka times a."""
    case = io.load("two_area")
    point = operating_point.solve(case.with_storage(fleet.chosen(case, "1=100MW")))
    run_ = run(point, Contingency("7-8@0.4", 0.1), until=1.2, control=Feedback(0.0, -0.004, min_voltage=0.0))
    during = (run_.time > 1.02) & (run_.time < 1.05)
    assert (run_.arrays.storage[during, 0] < 0).all()


def test_bang_bang_is_the_limit_of_a_steep_feedback():
    case = io.load("two_area")
    point = operating_point.solve(case.with_storage(fleet.everywhere(case, "50MW")))
    events = Contingency("7-8@0.4", 21 / 60)
    steep = run(point, events, until=1.6, control=Feedback(1e6, deadband=0.1))
    switched = run(point, events, until=1.6, control=BangBang())
    np.testing.assert_allclose(steep.arrays.storage, switched.arrays.storage, atol=1e-9)
