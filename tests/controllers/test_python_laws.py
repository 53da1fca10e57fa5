"""Laws that are Python functions: like the matrices of the same law, at rest while a gate is closed, linearized."""

from contextlib import nullcontext

import control
import numpy as np
import pytest
from test_controller import STEP, order

import stabctl as st
from stabctl._util.errors import StudyError


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area").initialize(storage="50MW")


def test_a_gain_at_frames_is_the_python_function(base):
    """Matrices and Python function give the same orders, as far as the voltages are iterated (1e-7 pu)."""
    gain = control.ss([], [], [], [[300.0]])
    options = {"rate": 60, "delay": "50ms", "limits": 0.5, "deadband": 0.01}
    one = st.Controller.from_control(gain, "deviation:1", "order:1@5", **options)
    two = st.Controller.from_function(lambda seen: 300 * seen["deviation:1"], "deviation:1", "order:1@5", **options)
    a, b = (base.simulate(STEP, "3s", control=c) for c in (one, two))
    assert np.abs(order(a)).max() > 0.01
    assert np.abs(order(a) - order(b)).max() < 1e-7  # 2.0e-8
    assert np.abs(a.arrays.speed - b.arrays.speed).max() < 1e-9


def test_while_its_gate_is_closed_a_function_rests(base):
    """An integrator of time begins when the gate opens, at its start and with nothing on its way."""
    seen = []

    def law(now, x):
        seen.append((now.time, float(x[0])))
        return 0.1 * x, x + 1 / 60

    one = st.Controller.from_function(
        law, "deviation:1", "order:1@5", start=[0.0], rate=60, delay="50ms", gate=st.Gate(start=0.5)
    )
    run = base.simulate(until="1s", control=one)
    assert seen[0] == (pytest.approx(0.5, abs=1 / 60), 0.0)
    assert seen[-1][1] == pytest.approx(seen[-1][0] - seen[0][0], abs=1e-9)
    late = run.time < seen[0][0] + 0.05 - 1e-9
    assert np.abs(order(run)[late]).max() == 0
    assert np.abs(order(run)[~late]).max() > 0.01


class Lagged:
    """A first-order lag, 0.5 s at 60 frames per second."""

    def __init__(self):
        self.y = 0.0

    def __call__(self, seen):
        self.y += (seen["deviation:1"] - self.y) / 30
        return 30.0 * self.y


def test_the_states_of_a_law_are_those_of_its_linear_model_or_it_has_none(base):
    """A law of seen and x has the modes of its matrices; what an object remembers is not in view."""
    K, F = 30.0, 29 / 30
    matrices = st.Controller("deviation:1", "order:1@5", [[F]], [[1 / 30]], [[K * F]], [[K / 30]], rate=60)

    def law(seen, x):
        x = F * x + seen["deviation:1"] / 30
        return K * x, x

    named = {"inputs": "deviation:1", "outputs": "order:1@5", "rate": 60}
    function = st.Controller.from_function(law, start=[0.0], **named)
    a, b = (base.closed_loop(c).modes().eigenvalues for c in (function, matrices))
    assert np.abs(a - b).max() < 1e-6
    for unseen, says in ((Lagged, "is a class, so it has no linear model"), (Lagged(), "depend on earlier calls")):
        with pytest.raises(StudyError, match=says):
            base.closed_loop(st.Controller.from_function(unseen, **named))


@pytest.mark.parametrize(
    ("law", "smooth"),
    [
        (np.sign, False),
        (np.abs, False),
        (lambda w: w > 0, False),
        (lambda w: np.maximum(w, 2 * w), False),
        (lambda w: np.sign(w) * (np.abs(w) > 2e-5), True),
        (lambda w: np.tanh(1e3 * w), True),
        (lambda w: 20 * w + 1e5 * w**2, True),
        (np.square, True),
    ],
)
def test_a_law_that_jumps_or_bends_at_the_operating_point_has_no_linear_model(base, law, smooth):
    one = st.Controller.from_function(lambda seen: law(np.real(seen["deviation:1"])), "deviation:1", "order:1@5")
    with nullcontext() if smooth else pytest.raises(StudyError, match="it jumps or bends"):
        base.closed_loop(one)


def test_while_its_gate_is_closed_an_instance_of_a_class_is_new(base):
    """Its attribute counts frames since the gate has opened."""

    class Law:
        def __init__(self):
            self.frames = 0

        def __call__(self, now):
            self.frames += 1
            return 0.01 * self.frames

    gate = st.Gate("voltage:7", low=0.8)
    one = st.Controller.from_function(Law, "deviation:1", "order:1@5", rate=60, gate=gate)
    run = base.simulate(st.Contingency("7", clear="100ms", at="0.5s"), "1s", control=one)
    orders, opened = order(run), run.time[np.flatnonzero(np.abs(run.arrays.V[:, 6]) < 0.8)[-1]]
    assert np.abs(orders[(run.time > 0.52) & (run.time < 0.6)]).max() == 0
    assert np.abs(orders).max() == pytest.approx(0.01 * 30, abs=0.021)
    assert np.abs(orders[-1]) == pytest.approx(0.01 * 60 * (1.0 - opened), abs=0.021)


def test_a_law_that_does_not_rest_has_no_linear_model(base):
    one = st.Controller.from_function(lambda seen: 0.1, "speed:1", "order:1@5")
    with pytest.raises(StudyError, match="is not in steady state at the operating point"):
        base.closed_loop(one)


def written(seen):
    u = np.zeros(4)
    u[:] = 100 * seen["deviation"]
    return u


def square_root(seen):
    return np.array([np.sqrt(1 + 200 * float(v)) - 1 for v in seen["deviation"]])


@pytest.mark.parametrize(
    "law",
    [
        lambda seen: 100 * seen["deviation"],
        lambda seen: np.asarray(100 * seen["deviation"], float),
        lambda seen: 100 * np.real(seen["deviation"]),
        lambda seen: 60 * seen["deviation"] + 40 * np.real(seen["deviation"]),
        written,
        square_root,
    ],
)
@pytest.mark.filterwarnings("error")
def test_the_slopes_of_a_law_are_those_of_its_values(base, law):
    """Also where it drops the imaginary part of a complex step."""
    one = st.Controller.from_function(law, "deviation", "order", rate=60)
    same = st.Controller.from_control(control.ss([], [], [], 100 * np.eye(4)), "deviation", "order", rate=60)
    found, expected = (base.closed_loop(c).modes().df for c in (one, same))
    assert np.abs(found.real - expected.real).max() < 1e-6
    assert np.abs(found.imag - expected.imag).max() < 1e-6


OPTIONS = {
    "nothing": {},
    "limits": {"limits": (-0.2, 0.35)},
    "deadband": {"deadband": 0.04, "limits": (-0.5, 0.3)},
    "relay": {"deadband": 0.05, "limits": (-0.4, 0.6), "relay": True},
    "ramp": {"ramp": 1.7, "limits": 0.5},
    "delay": {"delay": "50ms"},
    "window": {"gate": st.Gate(start=0.7, end=1.1), "delay": "50ms"},
    "low voltage": {"gate": st.Gate("voltage:7", 0.9)},
    "high voltage": {"gate": st.Gate("voltage:7", high=0.97), "ramp": 20.0},
}


@pytest.mark.parametrize("name", OPTIONS)
def test_a_function_and_matrices_of_the_same_law_act_alike(base, name):
    """Whatever else they have: two signals, two outputs, and a state, which begins anew when a gate opens."""
    A, B, C, D = [[0.9]], [[2.0, 0.0]], [[6.0], [-3.0]], [[25.0, 0.0], [10.0, -15.0]]
    what = ("deviation:1", "deviation:4"), ("order:1@5", "order:4@10")

    def law(seen, x):
        u = np.array([seen["deviation:1"], seen["deviation:4"]])
        return np.array(C) @ x + np.array(D) @ u, np.array(A) @ x + np.array(B) @ u

    fault = st.Contingency("7-8@0.4", clear="6cyc", at="0.5s")
    linear = st.Controller(*what, A, B, C, D, rate=60, **OPTIONS[name])
    function = st.Controller.from_function(law, *what, start=[0.0], rate=60, **OPTIONS[name])
    one, other = (base.simulate(fault, "1.5s", control=c) for c in (linear, function))
    for device in (0, 3):
        assert order(other, device) == pytest.approx(order(one, device), abs=1e-6)  # 2e-8
        assert np.ptp(order(one, device)) > 0.01
    if "gate" in OPTIONS[name]:
        assert (order(other) == 0).any()
