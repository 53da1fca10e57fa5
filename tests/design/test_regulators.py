"""Regulators: their equations against SciPy, the separation of estimator and regulator, margins that hold."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.linalg as sl
from ringdown import errors, ringdown
from uneven import uneven_point

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.design import lqg, lqr, quadratic
from stabctl.design.lqg import response
from stabctl.dynamics.signals import INPUTS, OUTPUTS, chosen


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area_thyristor").initialize(storage="50MW")


@pytest.fixture(scope="module")
def measured(base):
    return lqr(base, inputs="angle, speed")


@pytest.fixture(scope="module")
def late(base):
    return lqg(base, rate=60, delay="50ms")


@pytest.mark.parametrize("behind", [False, True])
def test_a_run_says_once_that_a_regulator_has_lost_a_machine(base, measured, late, behind):
    """Not of controllers each of whose outputs follows one machine, and not if none trips."""
    lost = st.TripMachine(3, "0.5s"), st.TripMachine(4, "0.6s")
    gains = 10 * np.eye(4)
    own = st.Controller("deviation", "order", [], [], [], gains, name="own")
    several = [measured.controller, own] if behind else [lqr(base).controller, late.controller, own]
    control = st.EstimatorControl(several, "ideal") if behind else several
    names = [c.name for c in several if c is not own]
    said = base.simulate(lost, "0.7s", control=control).outcome.message
    for name in names:
        assert said.count(f"{name} reads machines 3, 4, off from 0.500 s: ") == 1
    assert said.count(" does not hold any more.") == len(names)
    assert "hold any more" not in base.simulate(st.LoadStep(7, "0.1s", 10.0), "0.7s", control=control).outcome.message
    mixed = replace(own, D=gains + np.eye(4, k=-1))  # the order at machine 4 follows machine 3, too
    assert "own reads machine 3, off" in base.simulate(lost[0], "0.6s", control=mixed).outcome.message


@pytest.fixture(scope="module")
def whole():
    """Options -> a regulator of an uneven system, all of whose states it estimates."""

    @cache
    def make(*options):
        point = uneven_point()
        drives, reads = "order:7@20, order:3@30", "deviation:7, flow:10-30"
        return lqg(point, drives, reads, order=len(point.linearize().A), **{"angle": "2deg"} | dict(options))

    return lambda **options: make(*options.items())


@pytest.mark.parametrize("seed", [1, 2])
def test_riccati_equations_as_by_scipy(seed):
    rng = np.random.default_rng(seed)
    A, B, C = rng.standard_normal((8, 8)), rng.standard_normal((8, 2)), rng.standard_normal((3, 8))
    assert (np.linalg.eigvals(A).real > 0).any()
    X = quadratic.continuous_riccati(A, B @ B.T, C.T @ C)
    assert np.abs(X - sl.solve_continuous_are(A, B, C.T @ C, np.eye(2))).max() < 1e-9 * np.abs(X).max()  # 1e-13
    X = quadratic.discrete_riccati(A, B @ B.T, C.T @ C)
    assert np.abs(X - sl.solve_discrete_are(A, B, C.T @ C, np.eye(2))).max() < 1e-9 * np.abs(X).max()
    with pytest.raises(np.linalg.LinAlgError):
        quadratic.continuous_riccati(np.eye(2), np.diag([1.0, 0.0]), np.eye(2))


def test_signals_that_tell_all_states_give_the_gain_of_all_states(base):
    full = lqr(base)
    same = lqr(base, inputs=full.controller.inputs)
    rotation = base.linearize().rotation()[:, 0]
    rotation = rotation / np.linalg.norm(rotation)
    K, own = full.controller.D, same.controller.D
    unturned = np.eye(len(rotation)) - np.outer(rotation, rotation)
    assert np.abs(K - own @ unturned).max() < 2e-3 * np.abs(K).max()  # 7e-4, of states that hardly move
    s, t = (base.closed_loop(one.controller).modes().eigenvalues for one in (full, same))
    assert (np.abs(s[:, None] - t[None, :]).min(axis=1) < 1e-3 * np.maximum(np.abs(s), 1)).all()
    assert same.own.gain_down == pytest.approx(0.5, abs=3e-3)  # 0.5014; that of an optimal loop
    assert same.full.gain_up == np.inf


def test_angles_and_speeds_are_enough(base, measured):
    assert measured.worst_after == pytest.approx(lqr(base).worst_after, abs=5e-4)  # 0.1016, 0.1015
    assert measured.own.gain_down < 0.51
    assert {name.partition(":")[0] for name in measured.controller.inputs} == {"angle", "speed"}


@pytest.mark.slow
@pytest.mark.parametrize("what", ["late", "measured"])
def test_guaranteed_margins_are_below_the_true_ones(base, what, request):
    """Those with equal gains and delays in all outputs; 252 and 253 ms against 250 to 290 ms."""
    found = request.getfixturevalue(what)
    true = base.margins(found.controller)
    assert true.gain_up > found.own.gain_up
    assert true.gain_down < found.own.gain_down
    assert true.delay > found.own.delay_s > 0.1
    one = found.controller
    limit = 0.99 * found.own.gain_up
    uneven = replace(one, C=np.diag([limit, 1, limit, 1]) @ one.C, D=np.diag([limit, 1, limit, 1]) @ one.D)
    assert base.closed_loop(uneven).modes().eigenvalues.real.max() < 1e-6


@pytest.mark.slow
def test_estimator_and_regulator_are_separate(base):
    """Without reduction the loop has the eigenvalues of the regulator, whatever the noise, and of the estimator."""
    loops = [
        base.closed_loop(lqg(base, delay="50ms", noise=noise, order=28).controller).modes().eigenvalues
        for noise in (1.0, 30.0)
    ]
    near = np.abs(loops[0][:, None] - loops[1][None, :]).min(axis=1)
    same = near < 1e-4 * np.maximum(np.abs(loops[0]), 1)
    slow = np.abs(loops[0]) < 10
    assert same[slow].sum() >= 10
    assert (~same).sum() >= 10
    k = np.argmin(np.abs(loops[0] - 3.8j))  # the inter-area mode is one of the regulator
    assert near[k] < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    "units",
    [{"speed": 0.3, "angle": "6deg", "effort": 3.0}, {"disturbance": "30MW", "noise": 3.0}],
    ids=["cost", "noise"],
)
def test_the_units_of_the_cost_and_of_the_noise_do_not_matter(whole, units):
    """Only what counts against what: all states kept, a regulator is the same with all weights or all noise times 3."""
    ours, same = whole(), whole(**units)
    for w in (1.0, 7.0, 40.0, 180.0):
        wanted = response(ours.controller, w)
        assert np.abs(response(same.controller, w) - wanted).max() < 1e-7 * np.abs(wanted).max()  # 1e-9
    for margins in ("full", "own"):
        wanted = vars(getattr(ours, margins))
        assert vars(getattr(same, margins)) == pytest.approx(wanted, rel=1e-4)
    if "effort" in units:
        one, other = (lqr(uneven_point(), inputs="angle, speed", **how) for how in ({"angle": "2deg"}, units))
        assert np.abs(one.controller.D - other.controller.D).max() < 1e-7 * np.abs(one.controller.D).max()


def test_the_loop_of_its_margins_returns_1_at_every_mode(whole):
    """The line power follows the orders at once; a frame sees those before it."""
    found = whole()
    cost = quadratic.quadratic(
        uneven_point(),
        chosen(uneven_point().case, found.controller.outputs, INPUTS),
        quadratic.Weights(),
        chosen(uneven_point().case, found.controller.inputs, OUTPUTS),
    )
    assert cost.D.any()
    seen = quadratic.plant(cost.modes, cost.C, cost.D, 60)
    modes = uneven_point().closed_loop(found.controller).modes()
    for s in modes.eigenvalues[modes.swings()]:
        loop = response(found.controller, -1j * s) @ seen(-1j * s)
        assert abs(np.linalg.det(np.eye(2) - loop)) < 1e-6


@pytest.mark.slow
def test_a_smaller_observer_loses_little(base, late):
    small = lqg(base, rate=60, delay="50ms", order=8)
    assert len(small.controller.A) < len(late.controller.A)
    assert small.worst_after == pytest.approx(late.worst_after, abs=1e-3)  # 0.1017, 0.1015
    assert small.controller.inputs == late.controller.inputs == tuple(f"deviation:{i}" for i in (1, 2, 3, 4))


def test_the_regulator_in_the_simulation(base, late):
    modes = base.closed_loop(late.controller).modes()
    k = min(modes.swings(), key=lambda k: abs(modes.frequency_hz[k] - 0.6))
    poles, _ = ringdown(base, late.controller, bus=7, mw=0.3)
    frequency, decay = errors(poles, modes.eigenvalues[k])
    assert frequency < 5e-4
    assert decay < 5e-4


def test_the_power_of_a_bus_with_a_machine_is_an_input_once(base):
    assert lqg(base, outputs="storage:5", order=12).controller.outputs == ("storage:5",)


@pytest.mark.slow
def test_measurements_that_cross_the_network(base):
    """Line power and bus frequency: a direct path from outputs to inputs, and a sensor with a state of its own."""
    found = lqg(base, inputs="bus_frequency:7, flow:7-8", delay="50ms")
    assert found.worst_after > 0.08  # 0.0858
    assert base.margins(found.controller).gain_up == pytest.approx(found.own.gain_up, rel=0.02)  # 2.89


@pytest.mark.slow
def test_every_speed_and_frequency_is_measured_with_the_same_noise(base):
    """5 mHz, also of the exact frequency of a bus."""
    found = lqg(base, inputs="frequency:7", delay="50ms"), lqg(base, inputs="bus_frequency:7", delay="50ms")
    up, down = ([getattr(one.own, name) for one in found] for name in ("gain_up", "gain_down"))
    assert up[0] == pytest.approx(up[1], rel=0.1)  # 2.63, 2.79
    assert down[0] == pytest.approx(down[1], rel=0.1)  # 0.617, 0.609


def test_a_regulator_behind_kalman_filters(base, measured):
    """The system survives a fault that it does not survive without control, with true and with estimated signals."""
    fault = st.Contingency("7-8@0.4", clear="24cyc", at="0.5s")
    assert not base.simulate(fault, "5s").outcome.stable
    behind = st.EstimatorControl(measured.controller, engine="batched")
    true, late = (base.simulate(fault, "5s", control=c) for c in (measured.controller, behind))
    assert true.outcome.stable
    assert late.outcome.stable
    assert late.max_angle_from_coi_deg == pytest.approx(true.max_angle_from_coi_deg, rel=0.02)


@pytest.mark.slow
def test_commands(stabctl, tmp_path):
    out = tmp_path / "k.toml"
    words = ("two_area_thyristor", "--storage", "50MW", "--out", out, "--json")
    code, text, _ = stabctl("design", "lqg", *words, "--delay", "50ms", "--order", "8")
    found = json.loads(text)
    assert code == 0
    assert found["worst_damping_before"] == pytest.approx(-0.0087, abs=1e-4)
    assert found["worst_damping_after"] == pytest.approx(0.1017, abs=1e-3)
    assert found["margins"]["gain_up"] == pytest.approx(7.3, abs=0.2)
    assert found["margins_all_states"]["gain_up"] is None
    assert st.load_controller(out).delay == pytest.approx(0.05)
    code, text, _ = stabctl("design", "lqr", *words, "--input", "angle, speed", "--angle", "10deg")
    assert code == 0
    assert json.loads(text)["margins"]["gain_down"] == pytest.approx(0.5, abs=5e-3)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda b: lqr(b, speed=0.0), "speed = 0.0 is not allowed"),
        (lambda b: lqr(b, angle="-3deg"), "angle = '-3deg' is not allowed"),
        (lambda b: lqr(b, inputs="coi_speed"), "lqr does not stabilize two_area_thyristor with coi_speed"),
        (lambda b: lqg(b, inputs="sped"), "'sped' is not an output"),
        (lambda b: lqg(b, delay="7ms"), "not a whole number of frames"),
        (lambda b: lqg(b, order=100), "cannot be reduced to 100 states"),
    ],
)
def test_mistakes(base, call, says):
    with pytest.raises(StudyError, match=says) as refusal:
        call(base)
    assert "\n" not in str(refusal.value)


@pytest.mark.slow
def test_longer_faults_than_with_bang_bang(cases):
    """wnaps with 5 % of storage, orders limited to -1..1, with true signals and behind PMUs and Kalman filters."""
    base = cases("wnaps").initialize(storage="5%mva")
    fault = st.Contingency("83", trip="83-33")

    def cycles(control):
        return base.clearing_time(fault, control=control, scan=0).cycles

    found = lqr(base, inputs="angle, speed", angle="1deg")
    behind = [st.EstimatorControl(c, engine="batched") for c in (st.BangBang(), found.controller)]
    assert cycles(None) == 4.5
    assert cycles(st.BangBang()) == cycles(behind[0]) == 6.5
    assert cycles(found.controller) == 10.375
    assert cycles(behind[1]) == 10.0
    assert found.own.delay_s > 0.07


@pytest.mark.parametrize("make", [lqr, lqg])
def test_the_delay_margin_of_a_lightly_damped_loop_is_kept(cases, make):
    """Its resonances are narrow: 108 ms, where 338 ms were said and 200 ms are unstable."""
    base = cases("ieee39").classical().initialize(storage="2%mva")
    found = make(base, inputs="deviation", speed=10.0)
    assert 0.05 < found.own.delay_s < 0.2
    if make is lqr:
        assert base.closed_loop(found.controller.delayed(found.own.delay_s)).modes().stable


def test_a_loop_that_stands_any_delay_says_so():
    assert str(quadratic.Robustness(0.1, 0.5, np.inf, np.inf)).endswith("delay margin any")


def test_what_nothing_moves_is_left_out(cases):
    """A rotor circuit that is open, and the speed of an infinite bus."""
    found = lqr(cases("ieee39"), storage="5%mva")
    assert found.worst_after > found.worst_before + 0.02  # 0.0851, 0.1129
    case = cases("two_area").classical()
    rows = dict(case.devices["gencls"])
    infinite = replace(case, devices={"gencls": {**rows, 1: rows[1]._replace(H=0.0)}})
    for make in (lqr, lqg):
        assert make(infinite, "order:3@11, order:4@10", storage="5%mva").worst_after > 0.02  # 0.0209, 0.0208
