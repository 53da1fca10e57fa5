import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from reproduction import paper
from stabctl._util.errors import StudyError
from stabctl.theory.equal_area import (
    _least_area,
    accelerating,
    critical_clearing,
    equal_area,
    simulated_critical_time,
)
from stabctl.theory.omib import OMIB, TIGHT, against_speed, bolted_fault, during_fault, stops, swing_curve, table1
from stabctl.theory.phase_plane import energy, inside, portrait, potential, separatrix

PAPER = OMIB()


@st.composite
def machines(draw, faults=False, mild=False):
    H = draw(st.floats(0.5, 20))
    X = draw(st.floats(0.2, 2))
    share = draw(st.floats(0.05, 0.95))
    Xpost = draw(st.none() | st.floats(X, X * (1 + 0.5 * (1 - share))))
    Pm = share / max(X, Xpost or X)
    least = 1.2 * share if mild else 2.0  # a mild fault brakes the machine on its way
    Xfault = draw(st.none() | st.floats(least, 10).map(lambda k: k * X / share)) if faults else None
    Pfault = draw(st.just(0.0) | st.floats(-2, 0.3).map(lambda k: k * Pm)) if faults else 0.0
    return OMIB(H, Pm, X, Xpost=Xpost, Xfault=Xfault, Pfault=Pfault)


@pytest.mark.slow
@given(machines(faults=True), st.floats(0, 1))
@settings(max_examples=20, deadline=None)
def test_energy_is_conserved_after_clearing(m, part):
    try:
        t = (0.05 + 0.85 * part) * critical_clearing(m).time
    except StudyError:
        t = 0.1
    run = swing_curve(m, t, until=t + 2)
    after = run.t > t
    U = energy(m, run.angle[after], run.speed[after])
    assert np.ptp(U) < 1e-10 * (m.Pmax_post + m.Pm * run.angle.max())  # 1e-11


@given(machines(), st.floats(0.01, 1))
@settings(max_examples=20, deadline=None)
def test_kinetic_energy_at_clearing_is_the_accelerating_area(m, part):
    clearing = m.start + part * (critical_clearing(m).angle - m.start)
    speed = math.sqrt(2 * m.Pm / m.M * (clearing - m.start))
    area = equal_area(m, clearing)
    assert abs(area.A1 - m.M / 2 * speed**2) < 1e-12  # (11): 2e-16
    assert abs(area.A2 - area.A1) < 1e-12


@given(machines(faults=True, mild=True), st.floats(0.01, 0.99), st.floats(0, 3))
@example(OMIB(Pm=0.5, X=0.5, Xpost=0.7), 0.003, 1.0)
@settings(max_examples=30, deadline=None)
def test_the_machine_stops_where_the_areas_are_equal(m, part, power):
    """The clearing angle and the stop may be below the stable equilibrium after the fault."""
    clearing = m.start + part * (m.unstable - m.start)
    try:
        area = equal_area(m, clearing, power * m.Pm)
    except StudyError:  # the fault is so mild that the machine returns before
        return
    if not area.stable:
        return

    def rates(_t, y):
        return y[1], (m.Pm - m.Pmax_post * np.sin(y[0]) - power * m.Pm) / m.M

    def rest(_t, y):
        return y[1]

    stops(rest, -1)
    state = clearing, math.sqrt(2 * area.A1 / m.M)
    run = solve_ivp(rates, (0, 1e3 * math.sqrt(m.M / m.Pmax_post)), state, events=rest, **TIGHT)
    assert run.status == 1
    assert run.y[0, -1] == pytest.approx(area.stop, abs=1e-6)


@pytest.mark.slow
@given(machines(faults=True), st.floats(0, 2))
@settings(max_examples=10, deadline=None)
def test_simulated_critical_time_is_the_equal_area_one(m, power):
    try:
        expected, reason = critical_clearing(m, power * m.Pm).time, ""
    except StudyError as refusal:
        expected, reason = 0.0, str(refusal)
    if reason:
        assert "at once" in reason
        unit = math.sqrt(m.M / m.Pmax_post)
        assert not swing_curve(m, 1e-6 * unit, against_speed(power * m.Pm), until=1e3 * unit, decide=True).stable
        return
    assert simulated_critical_time(m, power * m.Pm, 1e-8) == pytest.approx(expected, rel=1e-7)  # 3e-9


@pytest.mark.parametrize("t", [0.01, 0.1, 0.25, 1.0])
def test_bolted_fault_in_closed_form_is_the_simulation(t):
    run = swing_curve(PAPER, t, until=t + 0.1)
    i = np.flatnonzero(run.t == t)[0]
    assert abs(np.subtract((run.angle[i], run.speed[i]), bolted_fault(PAPER, t))).max() < 1e-12  # 1e-14


def test_partial_fault_agrees_with_its_simulation():
    m = OMIB(Xfault=3.0, Pfault=-0.2)
    run = swing_curve(m, 0.2, until=0.3)
    i = np.flatnonzero(run.t == 0.2)[0]
    assert abs(np.subtract((run.angle[i], run.speed[i]), during_fault(m, 0.2))).max() < 1e-10  # 1e-12


def test_stability_region_is_where_simulations_return():
    border = separatrix(PAPER)
    assert np.ptp(energy(PAPER, border.angle, border.speed)) < 1e-14  # 4e-16
    for part, returns in ((0.999, True), (1.001, False)):
        t = part * critical_clearing(PAPER).time
        assert inside(PAPER, *bolted_fault(PAPER, t)) == returns == swing_curve(PAPER, t, until=20, decide=True).stable
    assert not inside(PAPER, PAPER.unstable + 0.1, 0)
    assert not inside(PAPER, border.angle[0] - 0.1, 0)


def test_machine_held_where_the_law_jumps_across_zero_speed():
    run = swing_curve(PAPER, 0.25, against_speed(0.8), until=3)
    assert run.stable
    t, angle = run.rests[-1]
    assert abs(PAPER.Pm - PAPER.Pmax * math.sin(angle)) < 0.8
    assert run.t[-1] == 3
    assert (run.speed[run.t > t] == 0).all()
    assert (run.angle[run.t > t] == angle).all()


def test_more_absorbed_power_never_shortens_the_critical_time():
    times = [critical_clearing(PAPER, p).time for p in np.linspace(0, 5, 21)]
    assert (np.diff(times) > 0).all()


def test_table_1():
    assert PAPER.start == pytest.approx(paper.OMIB_START.value, abs=5e-5)  # 0.49497
    for row in table1(PAPER):
        angle, speed = (printed.value for printed in paper.TABLE_1[row.cycles][:2])
        assert row.angle == pytest.approx(angle, rel=2e-3)  # 2.2e-4, 4.3e-4, 9.6e-4
        assert row.speed == pytest.approx(speed, rel=2e-3)  # 1.3e-3 to 1.5e-3
        assert row.speed == pytest.approx(math.pi * row.cycles / 6, rel=1e-14)


def test_critical_clearing_of_the_paper():
    found = critical_clearing(PAPER)
    assert found.angle == pytest.approx(1.42826, abs=5e-6)  # 1.4282593
    assert found.time == pytest.approx(0.243753, abs=5e-7)  # 0.24375279
    assert found.cycles == pytest.approx(14.625, abs=5e-4)  # 14.62517
    assert abs(simulated_critical_time(PAPER) - found.time) < 1e-8  # 1e-10


def test_the_paper_s_three_faults():
    faults = portrait(PAPER)
    assert [run.stable for run in faults.curves] == [True, True, False]
    assert "15 cycles: 1.4767 rad, 7.8540 rad/s, unstable" in str(faults)
    lost = equal_area(PAPER, faults.cleared[2].angle)
    assert not lost.stable
    assert lost.A1 > lost.A2
    assert abs(lost.A2 - potential(PAPER, PAPER.unstable) + potential(PAPER, lost.clearing)) < 1e-14  # 1e-16


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"H": 0}, "H = 0 s"),
        ({"H": math.nan}, "H = nan s"),
        ({"X": -1}, "X = -1 pu"),
        ({"Pm": math.inf}, "Pm = inf pu"),
        ({"Pm": 2.0}, "before the fault"),
        ({"Xpost": 2.0}, "after the fault"),
        ({"Pfault": 0.5}, "nothing to accelerate"),
    ],
)
def test_impossible_machines_are_refused_in_one_sentence(wrong, says):
    with pytest.raises(StudyError, match=says) as refusal:
        OMIB(**wrong)
    assert "\n" not in str(refusal.value)


def test_impossible_studies_are_refused():
    with pytest.raises(StudyError, match=r"does not reach 2 rad during the fault"):
        equal_area(OMIB(Xfault=1.5), 2.0)
    with pytest.raises(StudyError, match="however long"):
        critical_clearing(OMIB(Xfault=0.95))
    with pytest.raises(StudyError, match="at once"):
        critical_clearing(OMIB(Pm=0.9, Xpost=1.1))
    with pytest.raises(StudyError, match="absorbed power"):
        critical_clearing(PAPER, -0.1)
    with pytest.raises(StudyError, match="clearing angle"):
        equal_area(PAPER, 3.0)
    with pytest.raises(StudyError, match="must be cleared"):
        swing_curve(PAPER, 6.0)
    with pytest.raises(StudyError, match="not possible"):
        during_fault(PAPER, math.nan)


def test_synchronism_is_lost_backward_at_the_unstable_equilibrium_a_turn_below():
    run = swing_curve(PAPER, 0.05, lambda *_: 5.0, until=3)
    assert not run.stable
    assert np.interp(run.lost, run.t, run.angle) == pytest.approx(PAPER.unstable - 2 * math.pi, abs=1e-4)
    assert swing_curve(PAPER, 0.05, until=3).lost == math.inf


@given(machines(), st.floats(1.05, 5), st.floats(-1, 0.9), st.floats(0.05, 1))
@example(OMIB(Pm=1.5, X=0.5), 1.3, 0.1, 1.0)
@example(OMIB(Pm=0.3, X=1.5), 1.3, 0.1, 1.0)
@settings(max_examples=50, deadline=None)
def test_a_fault_in_which_the_machine_returns_is_told_by_the_least_area_on_the_way(m, mild, share, part):
    """The machine reaches an angle if A1 is positive on the whole way to it; a mild fault brakes it on the way."""
    m = replace(m, Xfault=mild * m.X, Pfault=share * m.Pm)
    angle = m.start + part * (m.unstable - m.start)
    way = np.linspace(m.start, angle, 4001)
    if _least_area(m, angle) > 1e-6:
        assert min(accelerating(m, d) for d in way[1:]) > 0
    elif _least_area(m, angle) < -1e-6:
        assert min(accelerating(m, d) for d in way) < 0
