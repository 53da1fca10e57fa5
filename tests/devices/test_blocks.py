"""Blocks: transfer functions, limits, and derivatives by complex step."""

import control
import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from stabctl.devices import blocks as b

W = np.geomspace(0.01, 300.0, 40)  # rad/s
LINEAR = {  # name -> output and rates of (u, states), number of states, numerator, denominator
    "lag": (lambda u, x: b.lag(0.3, u, x), 1, [1], [0.3, 1]),
    "lead-lag": (lambda u, x: b.lead_lag(0.5, 0.1, u, x), 1, [0.5, 1], [0.1, 1]),
    "washout": (lambda u, x: b.washout(5.0, u, x), 1, [5, 0], [5, 1]),
    "derivative": (lambda u, x: b.derivative(0.4, 0.2, u, x), 1, [0.4, 0], [0.2, 1]),
    "second order": (lambda u, x, d: b.second_order(0.2, 0.03, 0.5, 0.04, u, x, d), 2, [0.03, 0.2, 1], [0.04, 0.5, 1]),
    "notch at 10 rad/s": (
        lambda u, x, d: b.second_order(0.0, 0.01, 0.1, 0.01, u, x, d), 2, [0.01, 0, 1], [0.01, 0.1, 1],
    ),
    "second order without a square": (
        lambda u, x, d: b.second_order(0.2, 0.0, 0.5, 0.0, u, x, d), 2, [0.2, 1], [0.5, 1],
    ),
    "delay, order 1": (lambda u, x: b.delay1(0.1, u, x), 1, *control.pade(0.1, 1)),
    "delay, order 2": (lambda u, x, d: b.delay2(0.1, u, x, d), 2, *control.pade(0.1, 2)),
    "PI": (lambda u, x: b.pi(2.0, 3.0, u, x, -9e9, 9e9), 1, [2, 3], [1, 0]),
}  # fmt: skip


def response(block, n):
    """Frequency response at W of a linear block, from its values for unit vectors."""
    rows = np.array([block(*unit) for unit in np.eye(n + 1)]).T
    A, B, C, D = rows[1:, 1:], rows[1:, :1], rows[:1, 1:], rows[:1, :1]
    return np.array([(C @ np.linalg.solve(1j * w * np.eye(n) - A, B) + D)[0, 0] for w in W])


@pytest.mark.parametrize("name", LINEAR)
def test_frequency_response_equals_the_transfer_function(name):
    block, n, *fraction = LINEAR[name]
    found, exact = response(block, n), control.tf(*fraction)(1j * W)
    assert np.abs(found - exact).max() < 1e-12 * np.abs(exact).max()  # 2e-15


def test_the_transfer_function_in_symbols():
    """Any constants: s X = rates(U, X), solved by sympy."""
    s, u, x, d = sympy.symbols("s u x d")
    N1, N2, D1, D2 = sympy.symbols("N1 N2 D1 D2", positive=True)
    at = {N1: sympy.Rational(1, 5), N2: sympy.Rational(3, 100), D1: sympy.Rational(1, 2), D2: sympy.Rational(1, 25)}
    wanted = ((1 + s * N1 + s**2 * N2) / (1 + s * D1 + s**2 * D2)).subs(at)
    y, *rates = b.second_order(*(at[c] for c in (N1, N2, D1, D2)), u, x, d)
    states = sympy.solve([s * x - rates[0], s * d - rates[1]], [x, d])
    assert sympy.simplify(y.subs(states) / u - wanted) == 0


def test_a_notch_lets_nothing_through_where_it_is():
    block, n, *_ = LINEAR["notch at 10 rad/s"]
    assert np.abs(response(block, n)).min() < 0.1
    assert block(1.0, 1.0, 0.0)[0] == 1.0


@pytest.mark.parametrize(("name", "until"), [("delay, order 1", 0.59), ("delay, order 2", 1.65)])
def test_a_delay_has_gain_1_and_its_phase_within_1_degree(name, until):
    found = response(*LINEAR[name][:2])
    assert np.abs(np.abs(found) - 1).max() < 1e-12
    late = W * 0.1 < until
    assert np.rad2deg(np.abs(np.angle(found[late] * np.exp(0.1j * W[late])))).max() < 1


@pytest.mark.parametrize("T", [0.0, 9e-4])
def test_short_blocks_are_bypassed_and_stand_still(T):
    assert b.lag(T, 2.0, 1.0) == b.washout(T, 2.0, 1.0) == b.delay1(T, 2.0, 1.0) == (2.0, 0.0)
    assert b.delay2(T, 2.0, 1.0, 0.0) == (2.0, 0.0, 0.0)
    assert b.derivative(3.0, T, 2.0, 1.0) == (0.0, 0.0)


numbers = st.floats(-10, 10)


@given(numbers, numbers, numbers)
def test_gates_and_limits(x, y, z):
    low, high = sorted((y, z))
    assert b.low_value(x, y) == min(x, y)
    assert b.high_value(x, y) == max(x, y)
    assert b.at_least(x, y) == max(x, y)
    assert b.at_most(x, y) == min(x, y)
    assert b.clip(x, low, high) == b.rate_limit(x, low, high) == min(max(x, low), high)
    assert b.deadband(x, low, high) == x - b.clip(x, low, high)
    assert b.clip(np.inf, low, high) == high


def test_growth_away_from_zero_is_limited_and_decay_is_not():
    assert [b.growth_limit(rate, 0.3, 2.0) for rate in (-9.0, 1.0, 9.0)] == [-9.0, 1.0, 2.0]
    assert [b.growth_limit(rate, -0.3, 2.0) for rate in (-9.0, 1.0, 9.0)] == [-2.0, 1.0, 9.0]


@given(st.floats(-3, 8))
def test_curves_equal_those_of_numpy(x):
    xs, ys = (0.0, 1.0, 2.5, 5.0), (0.5, 1.0, 0.8, 3.0)
    assert b.lookup(x, xs, ys) == pytest.approx(np.interp(x, xs, ys), abs=1e-14)
    assert b.line(x, 1.0, 2.0, 3.0, -4.0) == pytest.approx(np.interp(x, [1.0, 3.0], [2.0, -4.0]), abs=1e-14)


def test_saturation_passes_through_its_points():
    A, B = b.through(1.0, 0.1, 1.2, 0.4)
    assert b.quadratic(1.0, A, B) == pytest.approx(0.1)
    assert b.quadratic(1.2, A, B) == pytest.approx(0.48)
    assert b.quadratic(A - 0.1, A, B) == 0


def test_an_integrator_stops_at_its_limits_and_leaves_them_at_once():
    assert b.non_windup(2.0, 1.0, -1.0, 1.0) == 0
    assert b.non_windup(-2.0, 1.0, -1.0, 1.0) == -2
    assert b.non_windup(-2.0, -1.0, -1.0, 1.0) == 0
    assert b.non_windup(2.0, 0.5, -1.0, 1.0) == 2


def test_a_pi_regulator_does_not_wind_up():
    """Error 1 for two seconds, then -1: the output leaves its limit at once."""
    h, x, y = 1e-3, 0.0, []
    for k in range(4000):
        error = 1.0 if k < 2000 else -1.0
        out, rate = b.pi(0.5, 2.0, error, x, -1.0, 1.0)
        y.append(out)
        x += h * rate
    y = np.array(y)
    assert y[300:2000] == pytest.approx(1.0)
    assert y[2000] == pytest.approx(0.0, abs=5e-3)  # the proportional part turns from +0.5 to -0.5
    assert y[2600:] == pytest.approx(-1.0)


CURVED = {  # name -> function of one value, points away from its kinks
    "clip": (lambda x: b.clip(x, -1.0, 2.0), (-2.0, 0.5, 3.0)),
    "deadband": (lambda x: b.deadband(x, -1.0, 2.0), (-2.0, 0.5, 3.0)),
    "low value": (lambda x: b.low_value(x * x, 2 * x), (0.5, 3.0)),
    "high value": (lambda x: b.high_value(x * x, 2 * x), (0.5, 3.0)),
    "line": (lambda x: b.line(x, 1.0, 2.0, 3.0, -4.0), (0.5, 1.7, 4.0)),
    "lookup": (lambda x: b.lookup(x, (0.0, 1.0, 2.5), (0.5, 1.0, 0.8)), (-1.0, 0.5, 2.0, 3.0)),
    "saturation": (lambda x: b.quadratic(x, 0.8, 2.0), (0.5, 1.1)),
    "non-windup": (lambda x: b.non_windup(x * x, 0.3, -1.0, 1.0), (0.7,)),
    "PI": (lambda x: sum(b.pi(2.0, 3.0, x, 0.1, -1.0, 1.0)), (-2.0, 0.2, 2.0)),
    "beyond a limit": (lambda x: sum(b.beyond(2.0, 3.0, x, 0.3)), (-2.0, 0.1, 2.0)),
    "shortened": (lambda x: b.shortened(x, 0.7 + x * x, 0.9)[0], (0.1, 0.8)),
    "magnitude": (lambda x: b.magnitude(x, 0.7 + x * x), (0.4,)),
    "angle": (lambda x: b.angle(x, 0.7 + x * x), (0.4, -0.3)),
}


@pytest.mark.parametrize("name", CURVED)
def test_complex_step_equals_the_central_difference(name):
    f, points = CURVED[name]
    for x in points:
        step = np.imag(f(x + 1e-30j)) / 1e-30
        assert step == pytest.approx((f(x + 1e-6) - f(x - 1e-6)) / 2e-6, abs=1e-8)  # 2e-10


def test_a_polyline_goes_on_beyond_its_ends():
    xs, ys = (0.1, 0.7, 0.9, 1.0), (0.0, 0.3, 0.5, 0.9)
    at = np.linspace(0.1, 1.0, 50)
    assert [b.polyline(x, xs, ys) for x in at] == pytest.approx(np.interp(at, xs, ys), abs=1e-14)
    assert b.polyline(1.1, xs, ys) == pytest.approx(0.9 + 4 * 0.1)
    assert b.polyline(0.0, xs, ys) == pytest.approx(-0.05)
    assert b.polyline(0.8 + 1e-30j, xs, ys).imag == pytest.approx(1e-30)


def test_a_power_is_zero_below_zero_and_has_its_derivative():
    assert b.power(1.3, 4.2) == pytest.approx(1.3**4.2, rel=1e-15)
    assert b.power(0.0, 4.2) == b.power(-1.0, 4.2) == 0
    assert b.power(1.3 + 1e-30j, 4.2).imag == pytest.approx(4.2e-30 * 1.3**3.2, rel=1e-14)


def test_a_controller_beyond_a_limit_rests_below_it_and_forgets():
    """Excess 1 for a second, then -0.5: it acts at once, leaves with its integral, and starts anew from 0."""
    assert b.beyond(0.5, 2.0, -0.2, 0.0) == (0, 0)
    h, x, y = 1e-3, 0.0, []
    for k in range(7000):
        excess = 1.0 if k < 1000 or k >= 6000 else -0.5
        out, rate = b.beyond(0.5, 2.0, excess, x)
        y.append(out)
        x = max(x + h * rate, 0.0)
    y = np.array(y)
    assert y[0] == 0.5
    assert y[999] == pytest.approx(0.5 + 2.0, abs=5e-3)
    assert y[1000] == pytest.approx(2.0 - 0.25, abs=5e-3)
    assert y[3000:6000].max() == 0
    assert y[6000] == 0.5


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0.1, 3))
def test_a_phasor_is_shortened_to_a_circle(re, im, most):
    z, length = complex(*b.shortened(re, im, most)), abs(complex(re, im))
    assert abs(z) == pytest.approx(min(length, most), rel=1e-12)
    assert z * length == pytest.approx(complex(re, im) * abs(z), rel=1e-12, abs=1e-300)
