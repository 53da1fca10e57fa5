"""A megawatt drawn from a bus is taken from the machines, the loads and the losses, and from nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from systems import CLASSICAL, doubled, small, with_shares

from stabctl._util.errors import StudyError
from stabctl.dynamics import operating_point
from stabctl.model.tables import Storage
from stabctl.placement.sensitivity import sensitivity
from stabctl.simulation.events import Fault, LoadStep, Open, TripMachine
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation
from stabctl.simulation.timeline import timeline
from stabctl.smallsignal import linearize, nonlinear


def _switched(case, *events):
    return timeline(case, events)[-1].switching


@pytest.mark.parametrize("name", ["two_area", "ieee39"])
def test_it_is_the_input_matrix_of_the_linear_model(points, name):
    p = points(name)
    found = sensitivity(p)
    m = linearize(p, [f"storage:{c.bus}" for c in found.candidates])
    J = -2 * p.inertia[:, None] * m.B[m.speeds()]
    assert np.abs(found.J - J).max() < 1e-12  # 3e-16
    mean = p.inertia @ m.B[m.speeds()] / p.inertia.sum()
    rest = (m.B[m.speeds()] - mean) / p.case.base_mva
    assert np.abs(found.acceleration - rest).max() < 1e-18  # 3e-20


def test_it_is_the_slope_of_the_nonlinear_rates(points):
    p = points("two_area")
    found = sensitivity(p, [(1, 5), (2, 8)])
    system, rows = nonlinear(p, ["storage:5", "storage:8"]), linearize(p).speeds()
    for k in range(2):
        u = 1e-3 * np.eye(2)[k]
        still = np.zeros(system.nstates)
        rate = (system.dynamics(0, still, u) - system.dynamics(0, still, -u))[rows] / 2e-3
        assert np.abs(found.J[:, k] + 2 * p.inertia * rate).max() < 1e-8  # 5e-10


@pytest.mark.parametrize("classical", [True, False])
def test_the_simulator_moves_so_in_its_first_step_after_a_line_has_opened(cases, classical):
    case = cases("ieee39").classical() if classical else cases("ieee39")
    p, h, opened = operating_point.solve(case.with_storage([Storage(9, 29, 10.0)])), 1e-5, Open("16-21", 0.0)
    found = sensitivity(p, [(9, 29)], _switched(case, opened))

    def speeds(order):
        s = Simulation(setup(p, step=h), [opened])
        s.orders[:] = order
        s.advance(h)
        return s.finish().speed[-1]

    moved = (speeds(1.0) - speeds(-1.0)) / (2 * 0.1 * h)
    assert np.abs(found.J[:, 0] + 2 * p.inertia * moved).max() < 1e-4  # classical 2.2e-6, full 3.3e-5
    assert np.abs(found.J[:, 0] - sensitivity(p, [(9, 29)]).J[:, 0]).max() > 1e-2  # 1.4e-2, 1.5e-2


def test_machines_loads_and_losses_give_what_is_absorbed(cases):
    """sum J = 1 + change of the loads (constant impedances, 2 P dV/V) + change of what the branches lose."""
    p = operating_point.solve(cases("ieee39").classical())
    found, case = sensitivity(p), p.case
    buses = [load.bus for load in case.loads]
    both = [f"flow:{text}" for k in case.branches for text in (f"{k.from_bus}-{k.to_bus}", f"{k.to_bus}-{k.from_bus}")]
    m = linearize(p, [f"storage:{c.bus}" for c in found.candidates], [f"voltage:{b}" for b in buses] + both)
    V = np.abs(p.V[[p.net.place[b] for b in buses]])
    P = np.array([load.p for load in case.loads]) / case.base_mva
    loads, losses = (2 * P / V) @ m.D[: len(buses)], m.D[len(buses) :].sum(axis=0)
    assert np.abs(found.J.sum(axis=0) - 1 - loads - losses).max() < 1e-10  # 4e-14
    assert loads.max() < -0.01


def test_without_losses_and_with_loads_of_constant_power_the_machines_give_it_all():
    case = with_shares(small({"gencls": CLASSICAL._replace(ra=0.0)}), p_power=1, q_power=1)
    case = replace(case, branches=tuple(k._replace(r=0.0) for k in case.branches))
    found = sensitivity(operating_point.solve(case), [(1, 1), (1, 2), (2, 3)])
    assert found.J.sum(axis=0) == pytest.approx(1, abs=1e-12)
    assert (found.J > 0).all()


def test_two_equal_machines_give_the_same(cases):
    one = operating_point.solve(small({"gencls": CLASSICAL}))
    two = operating_point.solve(doubled(one.case))
    J = sensitivity(two, [(1, 2)]).J
    assert J[0] == pytest.approx(J[1], abs=1e-12)
    assert J[0] + J[1] == pytest.approx(sensitivity(one, [(1, 2)]).J[0], abs=1e-9)


def test_islands_have_their_own_coi(cases):
    p = operating_point.solve(with_shares(cases("two_area"), p_current=0))
    found = sensitivity(p, None, _switched(p.case, Open("8-9", 0.0), Open("8-9#2", 0.0)))
    assert len(set(found.island)) == 2
    apart = found.island[:, None] != found.island
    assert np.abs(found.J[apart]).max() < 1e-12
    for number in set(found.island):
        assert np.abs(found.in_coi[found.island == number].sum(axis=0)).max() < 1e-12


def test_a_bus_without_a_machine_moves_nobody(points):
    p = points("ieee39")
    found = sensitivity(p, [(1, 12), (1, 39)], _switched(p.case, Open("11-12", 0.0), Open("12-13", 0.0)))
    assert not found.J[:, 0].any()
    assert found.J[0, 1] > 0.5


@pytest.mark.parametrize(
    ("candidates", "events", "words"),
    [
        ([(9, 5)], [], "no machine 9"),
        ([(1, 99)], [], "no bus 99 in two_area for the storage of machine 1"),
        ([(1, 5), (1, 5)], [], "1@5 is listed twice"),
        ([], [], "no candidate for storage in two_area"),
        (None, [Fault("8", 0.0)], "without a fault"),
        (None, [TripMachine(1, 0.0)], "all its machines"),
        (None, [LoadStep(7, 0.0, 10.0)], "load steps"),
        (None, [Open("9-10", 0.0)], "has no voltage solution just after this switching"),
    ],
)
def test_what_cannot_be_is_said(points, candidates, events, words):
    p = points("two_area")
    with pytest.raises(StudyError, match=words):
        sensitivity(p, candidates, _switched(p.case, *events))


def test_it_prints_itself(points):
    text = str(sensitivity(points("ieee39"))).splitlines()
    assert len(text) == 12
    assert text[2].split() == ["1@39", "0.933", "0.988", "1", "(0.933)"]
