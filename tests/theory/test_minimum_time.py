import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from reproduction import paper
from stabctl._util.errors import StudyError
from stabctl.theory.convex_program import SpeedProgram, by_convex_program
from stabctl.theory.equal_area import simulated_critical_time
from stabctl.theory.minimum_time import by_collocation, by_shooting, stop_angle
from stabctl.theory.omib import against_speed, swing_curve
from stabctl.theory.two_machine import Equivalent

PAIR = Equivalent()
TABLE2 = PAIR.minimum_time_problem(6)
SWITCHED = replace(TABLE2, x1=-1.5, x2=2.0)
AT_LIMIT = replace(TABLE2, x1=-2.102, x2=6.7687, Pm=0.8359, Pc_min=-1.083, Pc_max=1.008)

TWO_EXTREMALS = replace(TABLE2, x1=-2.3938, x2=11.0664, Pm=0.4647, Pc_min=-0.2047, Pc_max=1.9743)


def problems(lowest):
    angle, power = st.floats(lowest, 2), st.floats(0, 2)
    return st.builds(
        lambda x1, x2, Pm, low, high: replace(TABLE2, x1=x1, x2=x2, Pm=Pm, Pc_min=-low, Pc_max=high),
        angle,
        st.floats(0.5, 12),
        st.floats(-0.3, 0.7),
        power,
        power,
    )


def time_with_one_switch(p, at):
    """Time to rest when the device injects up to `at` (s) and absorbs from then on; inf where it is too late."""

    def arc(y, span, Pc, *events):
        rates = lambda _, y: (y[1], float(p.acceleration(y[0], Pc)))  # noqa: E731
        return solve_ivp(rates, span, y, events=events, method="DOP853", rtol=1e-11, atol=1e-12)

    rest = lambda _t, y: y[1]  # noqa: E731
    rest.terminal = True
    y = (p.x1, p.x2) if at == 0 else arc((p.x1, p.x2), (0, at), p.Pc_min).y[:, -1]
    run = arc(y, (at, 3), p.Pc_max, rest)
    return run.t[-1] if run.status == 1 and run.y[0, -1] <= p.limit else math.inf


@pytest.mark.slow
@given(problems(-2.5))
@example(replace(TABLE2, x1=-1.53125, x2=0.5, Pm=0.072265625, Pc_min=0.0, Pc_max=0.0))
@settings(max_examples=6, deadline=None)
def test_shooting_fulfils_the_minimum_principle_and_is_never_beaten(p):
    found = by_shooting(p)
    assert found.feasible == (not math.isnan(stop_angle(p)))
    if not found.feasible:
        assert "cannot be brought to zero before the unstable equilibrium" in str(found)
        assert time_with_one_switch(p, 0) == math.inf
        return
    assert abs(found.hamiltonian).max() < 1e-12  # 4e-15
    assert abs(found.x1[0] - p.x1) < 1e-9
    assert abs(found.x2[0] / p.x2 - 1) < 1e-8
    if found.x1[-1] < p.limit - 1e-6:
        assert abs(found.lambda1[-1]) < 1e-9 * abs(found.lambda1).max()
    if p.Pc_min < p.Pc_max:
        assert (np.where(found.Pc == p.Pc_max, found.lambda2, -found.lambda2) >= -1e-12).all()  # (39)
    for at in (0.0, *np.linspace(0.01, 0.5, 5) * found.duration, *found.switches):
        assert found.duration <= time_with_one_switch(p, at) * (1 + 1e-8)


@pytest.mark.slow
@given(problems(-math.pi / 2))
@settings(max_examples=6, deadline=None)
def test_collocation_agrees_with_shooting(p):
    found, other = by_shooting(p), by_collocation(p)
    assert found.feasible == other.feasible
    if found.feasible:
        assert abs(found.duration / other.duration - 1) < 1e-8  # 2e-11
        assert len(found.switches) == len(other.switches)


def test_of_two_extremals_shooting_takes_the_shorter_one():
    near, best = by_collocation(TWO_EXTREMALS), by_shooting(TWO_EXTREMALS)
    assert near.switches == ()
    assert near.duration == pytest.approx(time_with_one_switch(TWO_EXTREMALS, 0), rel=1e-8)
    assert (near.lambda2 > 0).all()
    assert len(best.switches) == 1
    assert best.duration < 0.95 * near.duration


@pytest.mark.slow
@pytest.mark.parametrize("p", [TABLE2, SWITCHED, AT_LIMIT])
def test_a_mirrored_machine_has_the_mirrored_control(p):
    one, other = by_shooting(p), by_shooting(p.mirrored())
    assert one.duration == other.duration
    assert np.array_equal(one.Pc, -other.Pc)
    assert np.array_equal(one.lambda2, -other.lambda2)
    assert np.array_equal(one.hamiltonian, other.hamiltonian)
    assert by_collocation(p.mirrored()).duration == pytest.approx(one.duration, rel=1e-8)


def test_a_mirrored_result_says_its_own_numbers():
    found = by_shooting(SWITCHED)
    mirrored = found.mirrored()
    powers = f"from {mirrored.Pc[0]:g} to {mirrored.Pc[-1]:g} pu"
    assert f"at {mirrored.x1[-1]:.6f} rad, with one switch {powers}" in str(mirrored)
    assert mirrored.Pc[0] == -found.Pc[0] != found.Pc[0]
    assert str(mirrored.mirrored()) == str(found)


def test_table_2():
    assert TABLE2.x1 == pytest.approx(1.073377, abs=5e-7)  # 1.0733775
    assert TABLE2.x2 == pytest.approx(paper.TABLE_2["x2"].value, abs=5e-5)  # 10.995574
    for found in (by_shooting(TABLE2), by_collocation(TABLE2), by_collocation(TABLE2, paper.GUESS)):
        assert found.duration == pytest.approx(0.056597, abs=5e-7)  # 0.05659744
        assert found.lambda1[0] == pytest.approx(-0.016913, abs=5e-7)  # -0.01691316
        assert found.lambda2[0] == pytest.approx(0.0045847, abs=5e-8)  # 0.00458469
        assert found.x1[-1] == pytest.approx(1.390175, abs=5e-7)  # 1.3901748
        assert found.switches == ()
        assert (found.Pc == 0.5).all()
        assert (found.lambda2 > 0).all()
        assert abs(found.hamiltonian).max() < 1e-9  # 4e-15, collocation 2e-11


def test_duration_of_an_absorbing_pulse_by_quadrature():
    found = by_shooting(TABLE2)
    p, end = TABLE2, stop_angle(TABLE2)

    def speed(x1):
        drive = (p.Pm - p.Pc_max * p.M / p.M1) * (x1 - p.x1) + p.Pmax * (math.cos(x1) - math.cos(p.x1))
        return math.sqrt(p.x2**2 + 2 / p.M * drive)

    T = quad(lambda z: 2 * z / speed(end - z**2), 0, math.sqrt(end - p.x1), epsabs=1e-13)[0]
    assert abs(found.duration - T) < 1e-9  # 1e-12


def test_bang_bang_feedback_is_the_optimal_control_up_to_T():
    m, found = PAIR.omib, by_shooting(TABLE2)
    run = swing_curve(m, m.seconds(6), against_speed(PAIR.share * 0.5), until=1)
    t, angle = run.rests[0]
    assert abs(t - m.seconds(6) - found.duration) < 1e-12  # 2e-15
    assert abs(angle - found.x1[-1]) < 1e-10  # 5e-13
    on = (run.t > m.seconds(6)) & (run.t < t)
    assert (run.power[on] == PAIR.share * 0.5).all()
    x1 = np.interp(run.t[on] - m.seconds(6), found.t, found.x1)
    assert abs(x1 - run.angle[on]).max() < 1e-5  # 2e-6, of the interpolation


@pytest.mark.parametrize(("p", "switch"), [(SWITCHED, 0.023801), (AT_LIMIT, None)])
def test_a_switch_is_found_where_it_is_optimal(p, switch):
    found = by_shooting(p)
    assert len(found.switches) == 1
    assert switch is None or found.switches[0] == pytest.approx(switch, abs=1e-6)
    assert found.Pc[0] == p.Pc_min
    assert found.Pc[-1] == p.Pc_max
    assert found.duration < time_with_one_switch(p, 0) * (1 - 1e-4)
    assert by_collocation(p).switches[0] == pytest.approx(found.switches[0], abs=1e-7)
    if switch is None:
        assert found.x1[-1] == pytest.approx(p.limit, abs=1e-6)
        assert found.lambda1[-1] > 0


@pytest.mark.slow
def test_convex_program_finds_the_same_time_and_switch():
    for p in (TABLE2, SWITCHED):
        found = by_shooting(p)
        convex = by_convex_program(p)
        assert abs(convex.duration / found.duration - 1) < 1e-4  # 2.5e-6, 3.7e-5
        injects = (convex.Pc < 0).sum()
        assert injects == pytest.approx(100 * sum(found.switches) / found.duration, abs=1.5)  # 0 of 0, 10 of 10.04


def test_error_of_the_convex_program_is_of_second_order():
    exact = by_shooting(TABLE2).duration
    coarse, fine = (abs(by_convex_program(TABLE2, n, 1e-9).duration - exact) for n in (25, 100))
    assert coarse / fine == pytest.approx(16, rel=0.05)


def test_without_force_the_program_moves_as_a_body_that_is_pushed():
    """x1 = x0 + n z0 - P n^2 / 2 and z = z0 - P n with the largest power in all n steps."""
    one, n = SpeedProgram(TABLE2, 12), np.arange(13)
    one.motion.value, one.radius.value, one.force.value, one.slope.value = 0 * n, 1e3, 0 * n, 0 * n
    one.z0.value, one.push.value = 0.3, 0.02
    one.problem.solve(solver="CLARABEL")
    pushed = 0.02 * TABLE2.Pc_max
    assert one.x1.value == pytest.approx(TABLE2.x1 + 0.3 * n - pushed * n**2 / 2, abs=1e-6)
    assert one.z.value == pytest.approx(0.3 - pushed * n, abs=1e-6)


def test_convex_program_is_one_program_with_parameters():
    problem = SpeedProgram(TABLE2, 10).problem
    assert problem.is_dcp(dpp=True)
    assert len(problem.parameters()) == 6


def test_infeasible_is_an_outcome():
    p = PAIR.minimum_time_problem(10)
    for found in (by_shooting(p), by_collocation(p)):
        assert not found.feasible
        assert math.isnan(found.duration)
        assert found.t.size == 0
    assert str(found) == by_convex_program(p).outcome
    assert "at -2.6180 rad: the smallest absorbed power, -0.5 pu" in str(by_shooting(p.mirrored()))
    assert "before the unstable equilibrium at 2.6180 rad" in str(found)


def test_beyond_the_unstable_equilibrium_no_power_is_blamed():
    p = PAIR.minimum_time_problem(12, -900, 900)
    assert str(by_shooting(p)).endswith("2.6180 rad: the angle at clearing, 2.7227 rad, is already beyond it.")
    assert str(by_shooting(p.mirrored())).endswith(
        "-2.6180 rad: the angle at clearing, -2.7227 rad, is already beyond it."
    )


@pytest.mark.parametrize(("cycles", "low", "high"), [(3, -0.3, -0.1), (1, -0.3, -0.1), (2, -0.5, -0.2)])
def test_a_device_that_can_only_inject(cycles, low, high):
    """It stops the machine only where the network decelerates more than the device accelerates."""
    p = PAIR.minimum_time_problem(cycles, low, high)
    found, other = by_shooting(p), by_collocation(p)
    assert found.duration == pytest.approx(other.duration, rel=1e-8)
    assert len(found.switches) == len(other.switches)
    assert p.acceleration(found.x1[-1], high) < 0
    for at in (*np.linspace(0, 0.9, 7) * found.duration, *found.switches):
        assert found.duration <= time_with_one_switch(p, at) * (1 + 1e-8)


def test_feasible_up_to_the_critical_clearing_time():
    edge = PAIR.critical(0.5).cycles
    assert by_shooting(PAIR.minimum_time_problem(edge * (1 - 1e-6))).feasible
    assert not by_shooting(PAIR.minimum_time_problem(edge * (1 + 1e-6))).feasible


def test_clearing_time_against_power():
    assert PAIR.critical(0).cycles == pytest.approx(7.526, abs=5e-4)  # 7.52610
    assert PAIR.critical(0.5).cycles == pytest.approx(8.994, abs=5e-4)  # 8.99385
    assert simulated_critical_time(PAIR.omib, PAIR.share * 0.5) == pytest.approx(PAIR.critical(0.5).time, rel=1e-8)
    assert not PAIR.equal_area(8).stable
    assert PAIR.equal_area(8, Pc=0.5).stable


def test_equivalent_moves_like_the_difference_of_two_machines():
    e = Equivalent(H1=2, HCOI=5, X=0.8, Pm1=0.6)
    M1, MCOI = e.M1, 2 * e.HCOI / (2 * math.pi * e.fb)
    p = e.minimum_time_problem(5)

    def both(_t, y):  # (15), (16) with P_C at machine 1
        Pe = e.V1 * e.VCOI / e.X * math.sin(y[0] - y[1])
        return y[2], y[3], (e.Pm1 - Pe - 0.3) / M1, (-e.Pm1 + Pe) / MCOI

    run = solve_ivp(both, (0, 0.05), (p.x1, 0, p.x2, 0), method="DOP853", rtol=1e-11, atol=1e-12)
    law = against_speed(e.share * 0.3)
    one = swing_curve(e.omib, e.omib.seconds(5), law, until=e.omib.seconds(5) + 0.05)
    assert not one.rests
    assert abs(run.y[0, -1] - run.y[1, -1] - one.angle[-1]) < 1e-9  # 1e-11
    assert abs(run.y[2, -1] - run.y[3, -1] - one.speed[-1]) < 1e-8  # 1e-10


@pytest.mark.parametrize(
    "wrong", [{"x2": 0.0}, {"x1": math.nan}, {"Pc_min": 1.0}, {"Pm": 1.0}, {"M": 0.0}, {"Pc_max": math.inf}]
)
def test_impossible_problems_are_refused(wrong):
    with pytest.raises(StudyError):
        replace(TABLE2, **wrong)
