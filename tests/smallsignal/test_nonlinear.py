"""The linear model is the tangent of the simulation: halving a step divides the difference by four."""

import control
import numpy as np
import pytest
from systems import ROUND, SEXS, small

from stabctl.dynamics import operating_point
from stabctl.model.tables import Storage
from stabctl.simulation.events import LoadStep
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation, run
from stabctl.smallsignal import descriptor, linearize, nonlinear


def _difference(model, time, simulated, size):
    T = np.linspace(0, time[-1], len(time))
    answer = control.forced_response(model.to_control(), T, np.full(len(T), size))
    return np.abs(answer.outputs - simulated).max(), np.abs(answer.outputs).max()


def test_load_step_simulated_and_linear(point):
    p = point("two_area")
    model = linearize(p, ["load_p:7"], ["speed", "voltage:8"])

    def difference(mw):
        t = run(p, [LoadStep(7, 0.0, p=mw)], until=4.0, step=1 / 480)
        simulated = np.vstack([t.arrays.speed.T - 1, np.abs(t.arrays.V[:, p.net.place[8]]) - abs(p.V[p.net.place[8]])])
        return _difference(model, t.time, simulated, mw / 100)

    (large, moved), (small, _) = difference(40.0), difference(20.0)
    assert large / small == pytest.approx(4, rel=0.05)  # 3.98
    assert large < 0.1 * moved  # 0.05 of it


def test_storage_order_simulated_and_linear(point):
    case = point("two_area").case.with_storage([Storage(1, 5, 100.0, lag=0.05)])
    p = operating_point.solve(case)
    model = linearize(p, ["order:1"], ["speed", "rest_speed:1"])

    def difference(share):
        s = Simulation(setup(p, step=1 / 480))
        s.orders[:] = share
        s.advance(4.0)
        t = s.finish()
        H = p.inertia
        speed = t.arrays.speed
        rest = (speed[:, 1:] @ H[1:]) / H[1:].sum()
        return _difference(model, t.time, np.vstack([speed.T, rest]) - 1, share)

    (large, _), (small, _) = difference(0.4), difference(0.2)
    assert large / small == pytest.approx(4, rel=0.05)  # 3.94


def test_the_nonlinear_system_has_the_linear_one_as_its_tangent(point):
    """Every kind of signal at once, along a random direction."""
    p = point("two_area")
    names = (
        ["storage:8", "vref", "pref:2", "load_p", "load_q:9"],
        ["speed", "angle", "coi_speed", "rest_speed:3", "voltage", "bus_angle", "frequency", "flow", "flow_q"],
    )
    model, system = linearize(p, *names), nonlinear(p, *names)
    assert system.state_labels == list(model.to_control().state_labels)
    assert system.output_labels == list(model.outputs)
    rng = np.random.default_rng(1)
    x, u = 1e-4 * rng.normal(size=len(model.states)), 1e-4 * rng.normal(size=len(model.inputs))

    def difference(k):
        rates = system.dynamics(0, k * x, k * u) - k * (model.A @ x + model.B @ u)
        outputs = system.output(0, k * x, k * u) - k * (model.C @ x + model.D @ u)
        return np.array([np.abs(rates).max(), np.abs(outputs).max()])

    assert np.allclose(difference(1.0) / difference(0.5), 4, rtol=0.02)  # 4.000, 4.000
    assert np.abs(system.dynamics(0, 0 * x, 0 * u)).max() < 1e-9  # 2e-13


def test_so_it_has_for_a_frequency_and_an_order_that_moves_the_power_with_a_lag(point):
    p = operating_point.solve(point("two_area").case.with_storage([Storage(1, 5, 100.0, lag=0.05)]))
    names = ["order:1"], ["frequency:5", "frequency:8"]
    direct, system = linearize(p, *names).D[:, 0], nonlinear(p, *names)
    assert np.abs(direct).min() > 1e-4  # 4.5e-4
    assert system.output(0, np.zeros(system.nstates), [1e-4]) / 1e-4 == pytest.approx(direct, rel=1e-3)


def test_a_state_at_its_limit_moves_back_and_not_beyond_it():
    p = operating_point.solve(small({"genrou": ROUND, "sexs": SEXS}))
    system, limits = nonlinear(p, ["vref:1"]), p.system.limits
    row, x = system.state_labels.index("field voltage SEXS 1"), np.zeros(system.nstates)
    x[row] = limits.high[0] - p.s[limits.state[0]]
    assert system.dynamics(0, x, [0.05])[row] == 0
    assert system.dynamics(0, x, [-0.05])[row] < 0


def test_python_control_simulates_the_nonlinear_system(point):
    """Its own integrator gives the trajectory of ours."""
    p = point("two_area_manual")
    T = np.linspace(0, 1.0, 41)
    answer = control.input_output_response(
        nonlinear(p, ["load_p:7"], ["speed"]), T, np.full((1, len(T)), 0.2), solve_ivp_kwargs={"rtol": 1e-7}
    )
    ours = run(p, [LoadStep(7, 0.0, p=20.0)], until=1.0, step=1 / 480)
    there = np.array([np.interp(T, ours.time, s) for s in ours.arrays.speed.T]) - 1
    assert np.abs(answer.outputs - there).max() < 1e-7  # 8e-9


def test_a_loop_closes_with_interconnect(point):
    """Damping by storage at bus 5: the nonlinear plant and a gain in one system."""
    plant = nonlinear(point("two_area_thyristor"), ["storage:5"], ["speed:1"])
    gain = control.ss([], [], [], [[30.0]], inputs=["speed GENROU 1"], outputs=["P storage bus 5"], name="damping")
    loop = control.interconnect([plant, gain], inputs=[], outputs=["speed GENROU 1"])
    assert loop.nstates == plant.nstates
    assert np.abs(loop.dynamics(0, np.zeros(loop.nstates), [])).max() < 1e-9  # 4e-15


def test_a_case_is_initialized_first(cases):
    case = cases("two_area")
    assert nonlinear(case, "vref:1", "speed:1").nstates == len(descriptor(case).states) > 0
