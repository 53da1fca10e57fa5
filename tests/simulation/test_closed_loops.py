"""The step of a run in which a law or controller makes the loop faster; limit cycles at full power are named."""

import re
from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.linalg import expm

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.dynamics.operating_point import initialize
from stabctl.simulation import loop_eigenvalues
from stabctl.simulation.setup import setup

NONE = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))


def stored(points, name, storage="50MW"):
    return initialize(points(name).case, storage)


def loop_of(point, *controls):
    return setup(point, controls).closed.fastest


def lead(machine, gain, seconds=0.005):
    return st.Controller.from_control(
        gain * control.tf([0.5, 1], [seconds, 1]), inputs=f"deviation:{machine}", outputs=f"order:{machine}"
    )


def fastest(point, *controllers):
    """From the closed loop of the linear model, which is made without the simulation."""
    return np.abs(np.linalg.eigvals(point.closed_loop(*controllers).A)).max()


@pytest.mark.parametrize("name", ["wscc9", "two_area", "two_area_thyristor"])
@pytest.mark.parametrize("seed", range(3))
def test_the_fastest_eigenvalue_is_that_of_the_closed_loop(points, name, seed):
    rng = np.random.default_rng(seed)
    point = stored(points, name, "70MW")
    machines = rng.permutation([m.machine for m in point.case.machines])
    controllers = [lead(m, 10 ** rng.uniform(1, 3.3), rng.uniform(0.004, 0.03)) for m in machines[:2]]
    assert loop_of(point, *controllers) == pytest.approx(fastest(point, *controllers), rel=1e-9)  # 2e-12


@pytest.mark.parametrize("name", ["wscc9", "two_area"])
@pytest.mark.parametrize(
    "law", [st.Feedback(10.0), st.Feedback(40.0), st.StorageLaw(slope=0.004, deadband=0.0, angle_gain=0.9)]
)
def test_so_it_is_of_a_law(points, name, law):
    point = stored(points, name, "70MW")
    laws = law.controllers(point.case)
    assert loop_of(point, law) == pytest.approx(fastest(point, *laws), rel=1e-9)  # 1e-13


def test_a_group_counts_as_one_machine(points):
    point = stored(points, "two_area", "70MW")
    law = st.StorageLaw(groups=("1+2",), slope=0.002, deadband=0.0)
    assert loop_of(point, law) == pytest.approx(fastest(point, *law.controllers(point.case)), rel=1e-9)  # 1e-13


def test_what_does_not_act_continuously_closes_no_loop(points):
    point = stored(points, "wscc9")
    for law in (st.BangBang(), st.Feedback(10.0).sampled(50), st.StorageLaw(deadband=0.05)):
        assert loop_of(point, law) == 0
    relay = st.Controller(("deviation:2",), ("order:2",), *NONE, [[900.0]], relay=True, limits=0.7)
    assert loop_of(point, relay) < 1.01 * point.fastest
    two = ("flow:7-8", "speed:1"), ("order:2",), NONE[0], np.zeros((0, 2)), NONE[2], [[900.0, 1e5]]
    assert loop_of(point, st.Controller(*two, relay=True, limits=0.7)) < 1.01 * point.fastest


@pytest.mark.parametrize(
    "where",
    [
        {"deadband": 1e-3},
        {"limits": 1e-3},
        {"deadband": 1e-3, "limits": (-0.2, 0.5)},
        {"gate": st.Gate(start=0.5, end=0.9)},
        {"gate": st.Gate("voltage:7", high=0.9)},
        {"gate": st.Gate("voltage:7", high=0.9, start=0.5), "deadband": 1e-3},
    ],
)
def test_deadband_limits_and_gate_of_a_controller_are_left_out(points, where):
    """The loop is that where the controller acts: beyond its deadband, within its limits, while its gate is open."""
    point = stored(points, "wscc9")
    assert loop_of(point, replace(lead(3, 1000), **where)) == pytest.approx(fastest(point, lead(3, 1000)), rel=1e-9)


def test_a_large_system_needs_only_its_fastest_eigenvalue(points, monkeypatch):
    point = stored(points, "two_area", "70MW")
    dense = loop_of(point, st.Feedback(25.0))
    vars(point).pop("closed")
    monkeypatch.setattr(loop_eigenvalues, "DENSE", 5)
    assert loop_of(point, st.Feedback(25.0)) == pytest.approx(dense, rel=loop_eigenvalues.ACCURACY)


CONVERTERS = "regc", "regc_b", "regc_c", "regc_repc", "regfm", "regfm_b1"


def fleet(case, megawatts=50.0, **given):
    return [st.Storage(machine=m.machine, bus=m.bus, rating=megawatts, **given) for m in case.machines]


@pytest.mark.parametrize("model", CONVERTERS)
@pytest.mark.parametrize("gain", [0.5, 8.0])
def test_so_it_is_beside_converters(points, monkeypatch, model, gain):
    """Beside a grid-forming one it was told as 142,021 1/s, whatever the gain, and the step was 83 times too short."""
    monkeypatch.setattr(loop_eigenvalues, "DENSE", 1000)
    case = points("two_area").case
    point = initialize(case, fleet(case, storage_model=model))
    law = st.Feedback(gain)
    assert loop_of(point, law) == pytest.approx(fastest(point, law), rel=1e-9)  # 3e-12


def accelerating(point, law):
    """Matrices (A, B) of the closed loop of a law with acceleration, and the deviations (C), B for a load at bus 7.

    u = K C x + G C x', with x' = A x + B u + W w, solved for u by hand.
    """
    case, orders = point.case, [f"order:{s.machine}" for s in point.case.storage]
    seen = [f"deviation:{s.machine}" for s in case.storage]
    m = point.linearize(inputs=[*orders, "load_p:7"], outputs=seen)
    n = len(orders)
    A, B, W, C = m.A, m.B[:, :n], m.B[:, n:], m.C
    full = [s.rating / case.machine(s.machine).base / (2 * np.pi * case.frequency_hz) for s in case.storage]
    K, G = (np.diag([gain / f for f in full]) for gain in (law.speed_gain, law.acceleration_gain))
    loop = np.linalg.inv(np.eye(n) - G @ C @ B)
    F = loop @ (K @ C + G @ C @ A)
    return A + B @ F, W + B @ loop @ G @ C @ W, C


@pytest.mark.parametrize("ka", [0.001, 0.03, 0.3, 3.0, -0.004])
def test_an_order_and_the_acceleration_it_causes_are_solved_for_at_once(points, ka):
    """From |Ka| = 2H/wb on, orders oscillated at full power from stage to stage, at every step and without a word."""
    case = points("two_area").case
    point = initialize(case, fleet(case))
    law = st.Feedback(0.05, ka, min_voltage=0.0)
    A, W, C = accelerating(point, law)
    assert loop_of(point, law) == pytest.approx(np.abs(np.linalg.eigvals(A)).max(), rel=2e-3)  # 2e-12; 4e-5 of angles
    size, at = 0.01, 1.0  # 1 MW
    wanted = C @ np.linalg.solve(A - 1e-9 * np.eye(len(A)), (expm(A * at) - np.eye(len(A))) @ W)[:, 0] * size
    for h in (1 / 120, 1 / 1000):
        ran = point.simulate("7:+1MW@1s", "2s", control=law, step=h)
        speed, H = ran.arrays.speed[-1], point.rotors.inertia
        own = speed - (speed @ H - speed * H) / (H.sum() - H)
        assert own == pytest.approx(wanted, rel=0, abs=5e-3 * np.abs(wanted).max())
        assert "trusted" not in str(ran)


def test_with_the_gain_of_the_documentation_the_answer_does_not_depend_on_the_step(points):
    """The largest power with Ka = 0.03 was 43.7 MW at 1/120 s and 28.5 MW at 1/960 s."""
    point = stored(points, "two_area")
    law = st.Feedback(0.0, 0.03, min_voltage=0.0)
    runs = [point.simulate("7:+60MW@0.1s", "2s", control=law, step=h) for h in (1 / 120, 1 / 960, 1 / 4000)]
    order = [np.interp(np.arange(0.15, 2, 0.05), ran.time, ran.arrays.order[:, 0]) for ran in runs]
    assert 0.05 < np.abs(order[2]).max() < 1
    assert order[0] == pytest.approx(order[2], abs=1e-3)
    assert order[1] == pytest.approx(order[2], abs=1e-4)


def test_a_gain_that_takes_away_more_inertia_than_there_is_is_refused(points):
    point = stored(points, "two_area")
    with pytest.raises(StudyError, match="takes away more inertia than the machines of two_area with storage have"):
        point.simulate(None, "1s", control=st.Feedback(0.0, -0.2))


def test_a_speed_that_is_no_state_has_no_acceleration_in_any_order_of_the_machines(cases):
    case = cases("two_area").with_device("regfm_a1", 2)  # with droop: its speed follows its power at once
    turned = {model: dict(reversed(rows.items())) for model, rows in case.devices.items()}
    both = [initialize(c, "50MW") for c in (case, replace(case, machines=case.machines[::-1], devices=turned))]
    assert [int((point.rotors.speed >= point.layout.nx).sum()) for point in both] == [1, 1]
    one, other = (loop_of(point, st.Feedback(0.05, 0.03, min_voltage=0.0)) for point in both)
    assert one == pytest.approx(other, rel=1e-9)  # 4e-15


@pytest.mark.parametrize("gain", [10.0, 35.0])
def test_a_ramp_that_is_not_reached_changes_nothing(points, gain):
    """Orders were held over a step, which nothing made short: 8.6 MW after a step of 0.01 MW."""
    case = points("two_area").case
    free, ramped = (initialize(case, fleet(case, ramp=ramp)) for ramp in (0.0, 2000.0))
    runs = [p.simulate("7:+0.01MW@1s", "3s", control=st.Feedback(gain)) for p in (free, ramped)]
    assert runs[0].step == runs[1].step
    assert runs[1].arrays.order == pytest.approx(runs[0].arrays.order, abs=1e-15)
    assert np.abs(runs[1].arrays.order).max() * 50 < 0.01


def test_an_order_moves_by_its_ramp_and_no_faster(points):
    case = points("two_area").case
    point = initialize(case, fleet(case, ramp=100.0))  # 2 ratings per second
    fault = st.Contingency("7-8@0.4", clear="6cyc")
    runs = [point.simulate(fault, "2s", control=st.Feedback(3.0, min_voltage=0.0), step=h) for h in (1 / 120, 1 / 2000)]
    for ran in runs:
        rate = np.abs(np.diff(ran.arrays.order, axis=0)) / np.diff(ran.time)[:, None]
        assert rate.max() == pytest.approx(2.0, rel=1e-9)
    shared = [ran.arrays.order[np.searchsorted(ran.time, np.arange(0.2, 1.9, 0.1) - 1e-9)] for ran in runs]
    assert shared[0] == pytest.approx(shared[1], abs=0.02)  # 0.01


def test_a_loop_that_grows_is_said(points):
    case = points("two_area").case
    late = initialize(case, fleet(case, storage_model="regc_b"))
    ran = late.simulate(None, "0.1s", control=st.Feedback(12.5, min_voltage=0.0))
    said = r"the closed loop is unstable at rest: an oscillation at 9\.\d Hz grows by 2\d 1/s; reduce the gain"
    assert re.search(said, str(ran))
    assert "unstable at rest" not in str(late.simulate(None, "0.1s", control=st.Feedback(0.5, min_voltage=0.0)))


@pytest.mark.parametrize("gain", [-3.0, -0.5, 0.5, 3.0, 12.5])
def test_the_eigenvalue_that_grows_is_the_rightmost(points, gain):
    """None of a stable loop, oscillating or not."""
    point, law = stored(points, "two_area", "70MW"), st.Feedback(gain, min_voltage=0.0)
    last = np.linalg.eigvals(point.closed_loop(*law.controllers(point.case)).A)
    last = last[last.real.argmax()]
    _, growing, alone = setup(point, law).closed
    assert alone is None
    assert (growing is not None) == (last.real > loop_eigenvalues.GROWING) == (gain < 0)
    if growing is not None:
        assert growing.real == pytest.approx(last.real, rel=1e-8)
        assert abs(growing.imag) == pytest.approx(abs(last.imag), rel=1e-8)


@pytest.mark.parametrize("acts", ["sampled", "estimator", "sampled law", "relay"])
def test_a_loop_that_is_closed_elsewhere_is_not_called_unstable(points, acts):
    """The eigenvalues here are those without it, of which one grows; that of the sampled damper is stable."""
    point = stored(points, "two_area_thyristor")
    damper = st.Controller("deviation:1", "order:1@5", [], [], [], [[200.0]], rate=60, name="damper")
    assert point.closed_loop(damper).modes().stable
    one = {
        "sampled": damper,
        "estimator": st.EstimatorControl(replace(damper, rate=None), "ideal"),
        "sampled law": st.Feedback(1.0, min_voltage=0.0).sampled(60),
        "relay": st.BangBang(),
    }[acts]
    small = st.Controller("speed:1", "vs:1", [], [], [], [[1e-6]], name="small")
    assert setup(point, [one, small]).closed.growing is None
    assert setup(point, small).closed.growing is not None


def test_what_grows_without_the_control_is_said(points):
    """To reduce the gain helps only where nothing grows without it."""
    point = stored(points, "two_area_thyristor")
    first = max(point.modes().eigenvalues, key=lambda s: s.real)
    for gain in (1e-6, -100.0):
        one = st.Controller("deviation:1", "order:1@5", [], [], [], [[gain]])
        alone = setup(point, one).closed.alone
        assert [alone.real, abs(alone.imag)] == pytest.approx([first.real, abs(first.imag)], rel=1e-6)
        said = str(point.simulate(None, "0.1s", control=one))
        assert re.search(r"by 0\.\d+ 1/s; without the control, an oscillation at 0.61 Hz grows by 0.033 1/s\.", said)
        assert "reduce the gain" not in said


def test_a_stable_loop_decays_after_a_small_step(points):
    """At 1/120 s, with orders held over a step, this law chattered at full power after a step of 0.01 MW."""
    point = stored(points, "two_area")
    ran = point.simulate("7:+0.01MW@1s", "6s", control=st.Feedback(10.0))
    assert ran.step * loop_of(point, st.Feedback(10.0)) < 1.3
    order = np.abs(ran.arrays.order)
    assert order.max() < 5e-4  # 1.5e-4
    assert order[-60:].max() < order.max() / 2
    fine = point.simulate("7:+0.01MW@1s", "6s", control=st.Feedback(10.0), step=1 / 3000)
    assert order[-1] == pytest.approx(np.abs(fine.arrays.order)[-1], rel=1e-3)  # 3e-5
    assert not ran.outcome.cycling


def test_a_law_is_evaluated_within_a_step(points):
    """The error of a run under a continuous law falls with the fourth power of the step, not with the first."""
    point = stored(points, "two_area")
    event = "7:+30MW@0.1s"
    law = st.Feedback(0.05, min_voltage=0.0)
    runs = [point.simulate(event, "1.1s", control=law, step=h) for h in (1 / 60, 1 / 120, 1 / 1920)]
    errors = [np.abs(r.arrays.speed[-1] - runs[-1].arrays.speed[-1]).max() for r in runs[:2]]
    assert errors[1] < errors[0] / 8


def test_at_rest_a_fast_controller_moves_nothing(points):
    """At 1/120 s the voltages collapsed within a second, without any disturbance."""
    point = stored(points, "wscc9")
    ran = point.simulate(None, "3s", control=lead(3, 1000))
    assert ran.outcome.stable
    assert np.abs(ran.arrays.speed - 1).max() < 1e-8
    assert ran.step < 1.3 / fastest(point, lead(3, 1000))


def test_the_step_follows_a_controller_at_its_limit_too(points):
    """An integral, x' = y, is slow; beyond its limit, x' = y - (x - limit) / Tt is as fast as its tracking."""
    point, integral = stored(points, "wscc9"), control.tf([1], [1, 0])
    for seconds in (1.0, 0.001):
        slow = st.Controller.from_control(integral, "deviation:2", "order:2", limits=1e-5, tracking=seconds)
        ran = point.simulate("5:+10MW@0.1s", "1s", control=slow)
        assert np.abs(ran.arrays.order).max() == pytest.approx(1e-5)
        assert ran.step == pytest.approx(min(1 / 120, 1.3 * seconds), rel=0.3)


def test_a_step_that_is_too_long_for_the_loop_is_refused(points):
    point = stored(points, "wscc9")
    with pytest.raises(StudyError, match=r"too long for wscc9, .* \(that of the loop closed by the control; reduce"):
        point.simulate(None, "1s", control=lead(3, 1000), step="4ms")


def test_a_loop_that_no_step_follows_is_said(points):
    point = stored(points, "wscc9")
    ran = point.simulate(None, "0.1s", control=st.Feedback(1e5))
    assert ran.step == 1e-4
    assert re.search(r"eigenvalue near [0-9.e+]+ 1/s, too fast for the step of 0.1 ms: .* cannot be trusted", str(ran))
    slower = point.simulate(None, "0.1s", control=st.Feedback(100.0))
    assert "trusted" not in str(slower)
    relay = st.Feedback(1e6, deadband="0.1Hz")  # full power from the edge of its deadband on
    assert loop_of(point, relay) == 0


@pytest.mark.parametrize(
    ("law", "cycles"),
    [(st.BangBang(), False), (st.BangBang(deadband=0.0), True), (st.Feedback(10.0, min_voltage=0.0), False)],
)
def test_a_limit_cycle_at_full_power_is_named(points, law, cycles):
    point = stored(points, "two_area")
    end = point.simulate(st.Contingency("7-8@0.4", clear="10cyc"), control=law).outcome
    assert end.stable
    assert bool(end.cycling) == cycles
    assert ("a limit cycle of the control" in str(end)) == cycles
    if cycles:
        assert "Storage devices 1@5, 2@6, 3@11, 4@10 still reverse between full charging and full discharging" in str(
            end
        )


@pytest.mark.parametrize(("storage", "until"), [("50MW", 3), ("20MW", 3), ("20MW", 5), ("5MW", 3), ("5MW", 5)])
def test_orders_that_follow_swings_for_a_while_are_no_limit_cycle(points, storage, until):
    """Undelayed, the law opposes every swing; its orders reverse with them, twice per period of 0.6 Hz at most."""
    ran = stored(points, "two_area_thyristor", storage).simulate(
        st.Contingency("7", clear=0.1, at=0.1), until, control=st.BangBang()
    )
    reversals = max((np.diff(np.sign(one[one != 0])) != 0).sum() for one in ran.arrays.order.T)
    assert 1 <= reversals < 1.3 * until  # 2 to 6
    assert not ran.outcome.cycling
    assert "limit cycle" not in str(ran)


def test_the_advice_on_a_limit_cycle_fits_the_law(points):
    """A relay without delay has neither a gain nor a delay to reduce."""
    point, event = stored(points, "two_area"), st.Contingency("7-8@0.4", clear="10cyc")
    relay = st.BangBang(deadband=0.0)
    assert str(point.simulate(event, control=relay).outcome).endswith(
        "a limit cycle of the control; widen its deadband."
    )
    late = str(point.simulate(event, control=relay.sampled(60, "200ms")).outcome)
    assert "a limit cycle of the control; reduce its gain or delay, or widen its deadband." in late


def test_the_rate_of_a_limit_cycle(points):
    """A late controller of high gain: as many reversals as its order makes in the last second."""
    point = stored(points, "two_area", "200MW")
    late = st.Controller(("deviation:1",), ("order:1",), *NONE, [[16000.0]], rate=1000, delay="20ms")
    ran = point.simulate("7:+1MW@0.5s", "10s", control=late)
    order = ran.arrays.order[:, 0][ran.time > ran.time[-1] - 1]
    side = np.sign(order[np.abs(order) > 0.9])
    reversals = int((np.diff(side) != 0).sum())
    assert ran.outcome.cycling == ("1@5",)
    assert reversals > 10
    said = int(str(ran.outcome).split("up to ")[1].split(" times")[0])
    assert abs(said - reversals) <= 2
