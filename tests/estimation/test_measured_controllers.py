"""Controllers behind PMUs and an estimator: with ideal ones nothing changes, with real ones little."""

import json

import numpy as np
import pytest
from islands import joined

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.estimation._signals import Deviations
from stabctl.estimation.estimator_loop import LawInputs
from stabctl.estimation.estimators import Estimate
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

FAULT = st.Contingency("7-8@0.4", clear="6cyc", at="0.5s")
NONE = np.zeros((0, 0))


def gain(inputs, outputs, D, **more):
    """A static gain, 60 frames a second."""
    p, m = np.shape(D)
    return st.Controller(inputs, outputs, NONE, np.zeros((0, m)), np.zeros((p, 0)), D, rate=60, **more)


CONTROLLERS = {  # signals of rotors, then those of PMUs elsewhere; delays come on top
    "deviation": gain(("deviation:1",), ("order:1@5",), [[200.0]], delay="50ms"),
    "group": gain(("deviation:1+2", "deviation:4"), ("order:1@5",), [[200.0, 20.0]]),
    "speeds": gain(("speed:2", "coi_speed", "rest_speed:2"), ("order:2@6",), [[100.0, -50.0, -50.0]]),
    "angles": gain(("angle:1", "angle:3"), ("order:1@5",), [[1.0, -1.0]]),
    "voltage": gain(("voltage:7",), ("vs:1",), [[0.1]]),
    "bus angle": gain(("bus_angle:7",), ("order:1@5",), [[-3.0]]),
    "flows": gain(("flow:7-8", "flow_q:8-7"), ("order:1@5",), [[-0.2, 0.1]], limits=(-0.5, 0.5)),
    "terminals": gain(("pe:1", "qe:2", "vt:1"), ("vs:1",), [[-0.1, 0.02, 0.1]]),
    "function": st.Controller.from_function(
        lambda seen: 100 * seen["deviation"], "deviation", "order", delay="50ms", name="law"
    ),
}


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area_thyristor").initialize(storage="50MW")


@pytest.fixture(scope="module")
def idle(base):
    return base.simulate(FAULT, "2s").speed.values


def behind(control, estimator="kalman", pmu=None, **more):
    return st.EstimatorControl(control, estimator, st.Pmu() if pmu is None else pmu, engine="batched", **more)


@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_ideal_measurements_change_nothing(base, idle, name):
    """Also through the fault, with the faulted line as a signal; the rest is the tolerance of the network solution."""
    c = CONTROLLERS[name]
    true = base.simulate(FAULT, "2s", control=c)
    ideal = base.simulate(FAULT, "2s", control=behind(c, "ideal", st.Pmu.exact()))
    assert np.abs(true.speed.values - idle).max() > 3e-5  # it acts
    assert np.abs(true.speed.values - ideal.speed.values).max() < 5e-9  # 2e-9 bus angle, others 6e-10


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "bound"),
    [("angles", 2e-5), ("deviation", 2e-5), ("flows", 4e-4), ("function", 2e-5), ("terminals", 1e-4)],
)
def test_kalman_filters_and_noise_change_little(base, idle, name, bound):
    c = CONTROLLERS[name]
    true = base.simulate(FAULT, "2s", control=c).speed.values
    runs = [base.simulate(FAULT, "2s", control=behind(c, seed=seed)).speed.values for seed in (1, 1, 2)]
    assert (runs[0] == runs[1]).all()
    assert (runs[0] != runs[2]).any()
    assert 1e-9 < np.abs(runs[0] - true).max() < bound


@pytest.mark.slow
def test_nothing_moves_at_rest_without_noise(base):
    reads = ("deviation", "angle", "voltage", "bus_angle", "bus_frequency", "pe")
    for kind in reads:
        one = st.Controller.from_function(lambda seen, kind=kind: 0.1 * seen[kind].sum(), kind, "order:1@5")
        run = base.simulate(until="1s", control=behind(one, pmu=st.Pmu.exact(latency=0.05)))
        assert np.abs(run.speed.values - 1).max() < 1e-8, kind


def test_remote_signals_are_late_and_own_ones_are_not(base):
    """The first frame at which a law sees the fault: 3 frames after it with 50 ms, at once at its own machine."""

    def first_seen(signal, drives):
        seen = []
        law = st.Controller.from_function(
            lambda now: seen.append((now.time, float(np.abs(now.values).max()))) or 0.0, signal, drives
        )
        base.simulate(FAULT, "0.8s", control=behind(law, pmu=st.Pmu.exact(latency=0.05)))
        return next(time for time, size in seen if size > 1e-4)

    assert first_seen("voltage:7", "order:1@5") == pytest.approx(0.55)
    assert first_seen("vt:1", "vs:1") == pytest.approx(0.5)
    assert first_seen("vt:1", "vs:2") == pytest.approx(0.55)
    assert first_seen("voltage:1", "vs:1") == pytest.approx(0.5)


def test_lost_reports_hold_the_last_value(base):
    seen = []
    law = st.Controller.from_function(
        lambda now: seen.append((now.time, float(now["voltage:7"]))) or 0.0, "voltage:7", "vs:1"
    )
    base.simulate(FAULT, "1s", control=behind(law, pmu=st.Pmu.exact(outage=("0.55s", "0.75s"))))
    during = {value for time, value in seen if 0.55 - 1e-9 <= time < 0.75 - 1e-9}
    assert len(during) == 1
    assert during.pop() < -0.3  # as in the fault, which is over at 0.6 s


def test_a_law_beside_controllers(base):
    """The law of the storage devices with estimated speeds, and stabilizers in the same loop, or with true signals."""
    pss = gain(("speed:2",), ("vs:2",), [[10.0]], limits=(-0.1, 0.1))
    both = base.simulate(FAULT, "2s", control=behind([st.BangBang(), pss], "ideal", st.Pmu.exact()))
    apart = base.simulate(FAULT, "2s", control=[behind(st.BangBang(), "ideal", st.Pmu.exact()), pss])
    assert np.abs(both.speed.values - apart.speed.values).max() < 1e-9
    found = base.estimate(FAULT, "2s", control=behind([st.BangBang(), pss]), seeds=(1, 2))
    assert found.runs[0].outcome.stable
    assert found.orders.any()


def test_the_command_line_puts_controllers_behind_pmus(stabctl, tmp_path):
    k = CONTROLLERS["deviation"].save(tmp_path / "k.toml")
    words = ("simulate", "two_area_thyristor", "--storage", "50MW", "--controller", k, "--json")
    words += ("--fault", "7-8@0.4", "--clear", "6cyc", "--until", "2s")
    true, late = (json.loads(stabctl(*words, *more)[1]) for more in ((), ("--estimator", "kalman")))
    key = "max_angle_from_coi_deg"
    assert 0 < abs(true[key] - late[key]) < 0.1


@pytest.mark.parametrize(
    ("control", "says"),
    [
        (behind(gain(("efd:1",), ("vs:1",), [[1.0]], name="k")), "k reads efd:1, which no PMU measures"),
        (behind(CONTROLLERS["angles"], "frequency"), "does not estimate rotor angles; choose 'kalman'"),
        ([behind(CONTROLLERS["angles"]), behind(st.BangBang())], "Give one EstimatorControl"),
        ([behind(st.BangBang()), st.BangBang()], "Give one storage law"),
        (lambda: behind([st.BangBang(), st.BangBang()]), "takes one storage law, or controllers"),
        (
            lambda: behind(st.Feedback(acceleration_gain=0.03), "frequency"),
            "reads the acceleration, which the estimator",
        ),
        (
            lambda: behind(st.StorageLaw(max_acceleration=0.2), "frequency"),
            "reads the acceleration, which the estimator",
        ),
        (lambda: behind(st.StorageLaw(angle_gain=5.0), "frequency"), "reads the angle, which the estimator"),
        (lambda: behind([]), "takes one storage law, or controllers"),
    ],
)
def test_mistakes(base, control, says):
    with pytest.raises(StudyError, match=says) as refusal:
        base.simulate(FAULT, "1s", control=control() if callable(control) else control)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "law", [st.BangBang(), st.StorageLaw(("1+2", "3+4"), 1.0, arm_at="200mHz", timeout="2s")], ids=["own", "group"]
)
def test_a_law_behind_ideal_pmus_acts_as_the_law_at_frames(law):
    """Groups, angles, arming and time-out are the same behind the estimator."""
    base = st.load("two_area").initialize(storage="50MW")
    fault = st.Contingency("7-8@0.4", clear="20cyc")
    behind = base.simulate(fault, 5, control=st.EstimatorControl(law, "ideal"))
    alone = base.simulate(fault, 5, control=law.sampled(60))
    assert np.array_equal(behind.arrays.order, alone.arrays.order)
    assert np.abs(behind.arrays.speed - alone.arrays.speed).max() < 1e-8  # measured 2e-9
    assert np.abs(alone.arrays.order).max() == 1


def test_the_ideal_estimator_gives_laws_the_true_acceleration(cases):
    """It is the rate of the deviation: between events, the trapezoidal rule gives its change over a frame."""
    base = cases("two_area").classical().initialize(storage="50MW")
    law = st.Feedback(acceleration_gain=0.03, braking=True)
    found = base.estimate(st.Contingency("7", clear="4cyc"), "3s", control=st.EstimatorControl(law, "ideal"))
    idle = base.estimate(
        st.Contingency("7", clear="4cyc"), "3s", control=st.EstimatorControl(st.Feedback(0.0), "ideal")
    )
    assert np.abs(found.orders).max() == 1
    later = idle.time > 1.2
    change, rate = np.diff(idle.deviation[later], axis=0), idle.acceleration[later]
    assert change == pytest.approx((rate[1:] + rate[:-1]) / 120, abs=2e-3 * np.abs(change).max())


def test_a_bus_angle_is_that_from_its_own_island(cases):
    case = cases("two_area").classical()
    base = joined(case, case).initialize(storage="1=50MW")
    one = gain(("bus_angle:1007",), ("order:1@5",), [[1.0]])
    ideal = base.simulate(FAULT, "1.5s", control=behind(one, "ideal", st.Pmu.exact()))
    assert np.abs(ideal.arrays.order).max() < 1e-6


@pytest.mark.parametrize("name", ["deviation:1+2", "deviation:2+1", "angle_deviation:1+2", "speed:1", "rest_speed:2"])
def test_a_group_goes_on_without_a_machine_that_is_tripped(base, name):
    """Behind ideal PMUs as with true signals: of a group those are meant that are on; of none, the value at rest."""
    lost = st.Contingency("7-8@0.4", clear="6cyc", after=["2@0.2s"])
    one = gain((name,), ("order:1@5",), [[20.0]])
    true = base.simulate(lost, "2s", control=one)
    ideal = base.simulate(lost, "2s", control=behind(one, "ideal", st.Pmu.exact()))
    assert (np.abs(true.arrays.order[-1]).max() > 1e-4) == (name != "rest_speed:2")
    assert np.abs(true.arrays.order - ideal.arrays.order).max() < 1e-6
    assert np.nanmax(np.abs(true.speed.values - ideal.speed.values)) < 1e-8


def test_a_law_with_groups_goes_on_without_a_machine_that_is_tripped():
    """Apart from the frame in which it is tripped, and the instants of switching that follow from it."""
    base = st.load("two_area").initialize(storage="50MW")
    lost = st.Contingency("7-8@0.4", clear="10cyc", after=["2@0.2s"])
    law = st.StorageLaw(("1+2", "3+4"), 1.0, arm_at="200mHz", timeout="2s")
    behind = base.simulate(lost, 3, control=st.EstimatorControl(law, "ideal")).arrays.order
    alone = base.simulate(lost, 3, control=law.sampled(60)).arrays.order
    assert np.mean((behind != alone).any(axis=1)) < 0.03  # 4 of 361 steps; 127 where the group was dead
    assert np.abs(alone[240:, 0]).max() == 1


def test_the_acceleration_of_a_group_is_that_of_its_center():
    base = st.load("two_area").initialize(storage="50MW")
    H, rate = np.array([1.0, 3.0, 2.0, 2.0]), np.array([[0.4, 0.8, 0.1, 0.3]])
    none, here = np.zeros((1, 4)), np.ones((1, 4), bool)
    now = Estimate(none, rate, none, none, here, none, none)
    seen = LawInputs(base, st.StorageLaw(("1+2", "3+4"), max_acceleration=0.1), H, st.Pmu.exact()).signals(
        0, Deviations(none, rate, none, here, now, now), np.zeros(4, int), Simulation(setup(base))
    )
    assert [one.acceleration for one in seen] == pytest.approx([0.5, 0.5, -0.5, -0.5])


def test_a_law_behind_pmus_has_their_rate():
    with pytest.raises(StudyError, match="once per PMU frame"):
        st.EstimatorControl(st.BangBang().sampled(60))
