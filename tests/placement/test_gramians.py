"""Gramians of the critical swings, and a budget shared out by them: laws, python-control, brute force, optimality."""

import itertools
from dataclasses import replace

import control
import numpy as np
import pytest
from systems import CLASSICAL, doubled, small, with_shares

from stabctl._util.errors import StudyError
from stabctl.dynamics import operating_point
from stabctl.placement import _allocation
from stabctl.placement._allocation import AllocationProgram, critical_modes, gramians
from stabctl.placement.sensitivity import sensitivity
from stabctl.smallsignal import analyze, linearize, modal

OBJECTIVES = ["min-eigenvalue", "log-det"]


@pytest.fixture(scope="module")
def classical(cases):
    return operating_point.solve(cases("ieee39").classical())


@pytest.fixture(scope="module")
def found(classical):
    """Gramians of the classical ieee39, undamped."""
    return gramians(classical)


def allocate(g, budget_mw, cap=np.inf, objective="min-eigenvalue"):
    return _allocation.allocate(g, budget_mw, np.broadcast_to(cap, len(g.candidates)), objective)


def _objective(W, objective):
    values = np.linalg.eigvalsh(W)
    return values[0] if objective == "min-eigenvalue" else np.log(values).sum()


@pytest.mark.parametrize("decay", [0.0, 0.5])
def test_python_control_finds_the_same_gramian_of_the_reduced_model(points, decay):
    """Its Lyapunov equation of the modal model, in the coordinates of that model."""
    p = points("two_area")
    g = gramians(p, modes=3, decay=decay)
    m = analyze(linearize(p, [f"storage:{c.bus}" for c in g.candidates], "speed"))
    chosen = sorted(critical_modes(m, 3), key=lambda k: -m.eigenvalues[k].real)
    H = p.inertia * p.case.base_mva
    for first in range(3):
        reduced = modal(m, [chosen[first]]).to_control()
        scale = H @ np.abs(m.right[m.linear.speeds(), chosen[first]]) ** 2 / p.case.base_mva**2
        block = slice(2 * first, 2 * first + 2)
        for i in range(len(g.candidates)):
            B = reduced.B[:, [i]]
            W = scale * control.lyap(reduced.A - decay * np.eye(2), B @ B.T)
            assert np.abs(g.W[i, block, block] - W).max() < 1e-9 * np.abs(W).max()


def test_python_control_finds_the_same_gramian_of_all_swings_together(found):
    for i in range(len(found.candidates)):
        b = found.B[:, [i]]
        W = control.lyap(found.A - found.decay * np.eye(len(found.A)), b @ b.T)
        assert np.abs(found.W[i] - W).max() < 1e-12 * np.abs(W).max()  # 6e-16


def test_a_trace_is_the_energy_of_a_blow():
    """A blow of 1 MW s leaves undamped, lossless machines the energy sum H S a^2 against their COI; they keep it."""
    case = with_shares(doubled(small({"gencls": CLASSICAL})), p_power=1, q_power=1)
    rows = {n: par._replace(D=0.0, ra=0.0) for n, par in case.devices["gencls"].items()}
    case = replace(case, branches=tuple(k._replace(r=0.0) for k in case.branches), devices={"gencls": rows})
    p = operating_point.solve(case)
    g, s = gramians(p, [(1, 2), (2, 3)], decay=0.25), sensitivity(p, [(1, 2), (2, 3)])
    assert len(g.modes) == 2
    energy = (s.inertia * s.base_mva) @ s.acceleration**2
    assert np.trace(g.W, axis1=1, axis2=2) == pytest.approx(energy / 0.5, rel=1e-9)


def test_the_share_of_one_swing(found):
    """|c|^2 / (2 a - 2 Re s), as the trace of a block."""
    for k, mode in enumerate(found.modes):
        block = slice(2 * k, 2 * k + 2)
        c2 = (found.B[block] ** 2).sum(axis=0)
        there = np.trace(found.W[:, block, block], axis1=1, axis2=2)
        assert there == pytest.approx(c2 / (2 * found.decay - 2 * mode.eigenvalue.real), rel=1e-9)


def test_the_swings_that_decay_slowest_are_critical(points, found):
    m = analyze(linearize(points("two_area")))
    assert critical_modes(m, 1) == [min(m.swings(), key=lambda k: -m.eigenvalues[k].real)]
    assert critical_modes(m, 9) == sorted(m.swings(), key=lambda k: -m.eigenvalues[k].real)
    undamped = [mode.frequency_hz for mode in found.modes]
    assert undamped == sorted(undamped)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_no_pair_of_a_fine_grid_is_better(classical, objective):
    g = gramians(classical, [(2, 6), (3, 10)])
    a = allocate(g, 100.0, 80.0, objective)
    grid = np.linspace(20, 80, 601)
    values = np.array([_objective(g.of(np.array([x, 100 - x])), objective) for x in grid])
    assert a.value >= values.max() * (1 - 1e-7 * np.sign(values.max()))
    assert a.sizes[0] == pytest.approx(grid[values.argmax()], abs=0.11)  # 0.03, 0.01


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_no_three_of_a_grid_are_better(classical, objective):
    g = gramians(classical, [(2, 6), (3, 10), (9, 29)])
    a = allocate(g, 100.0, objective=objective)
    shares = [(i, j, 100 - i - j) for i, j in itertools.product(range(101), repeat=2) if i + j <= 100]
    values = np.array([_objective(g.of(np.array(s, float)), objective) for s in shares])
    assert a.value >= values.max() * (1 - 1e-7 * np.sign(values.max()))
    assert a.value == pytest.approx(values.max(), rel=1e-3)  # 1.4e-4, 2.8e-6
    assert np.abs(a.sizes - shares[values.argmax()]).max() < 2  # 0.8, 0.5


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_a_megawatt_is_worth_the_same_wherever_it_could_move(found, objective):
    """Karush-Kuhn-Tucker: one price between the caps, not less at a cap, not more where there is nothing."""
    a = allocate(found, 400.0, 60.0, objective)
    assert a.sizes.sum() == pytest.approx(400, rel=1e-6)
    full, none = a.sizes > 59.99, a.sizes < 1e-3
    inside = ~full & ~none
    assert full.any()
    assert inside.sum() > 1
    assert none.any()
    price = a.gain[inside].mean()
    assert a.gain[inside] == pytest.approx(price, rel=1e-5)  # 6e-9, 1e-6
    assert (a.gain[full] >= price * (1 + 1e-3)).all()  # 1.02, 1.01 times
    assert (a.gain[none] <= price * (1 - 1e-3)).all()  # 0.97, 0.62 times
    assert 0 <= a.bound - a.value < 1e-7 * abs(a.value)  # 1e-10, 1.4e-8
    even = _objective(found.of(np.full(10, 40.0)), objective)
    assert a.value > even
    assert a.value == pytest.approx(_objective(found.of(a.sizes), objective), rel=1e-9)


def test_worth_is_the_slope_of_the_objective(found):
    """The gradient of log det, by central differences."""
    a = allocate(found, 400.0, 60.0, "log-det")
    for i in range(10):
        step = 1e-3 * np.eye(10)[i]
        above, below = (_objective(found.of(a.sizes + k * step), "log-det") for k in (1, -1))
        assert a.gain[i] == pytest.approx((above - below) / 2e-3, rel=1e-5)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_shares_do_not_depend_on_the_unit(found, objective):
    shares = [allocate(found, b, 0.2 * b, objective).sizes / b for b in (1e-6, 100.0, 1e9)]
    assert np.abs(np.diff(shares, axis=0)).max() < 1e-6


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_a_program_is_built_once(found, objective):
    once, W = AllocationProgram(found.W, objective), found.W
    for cap in (0.5, 0.15):
        limit = np.full(10, cap)
        assert once.solve(limit) == pytest.approx(AllocationProgram(W, objective).solve(limit), abs=1e-4)
    assert once.problem.is_dcp(dpp=True)


def test_caps_that_are_the_budget_are_filled(found):
    a = allocate(found, 100.0, 10.0)
    assert a.sizes == pytest.approx(10.0, rel=1e-6)


def test_two_machines_on_one_bus_are_worth_the_same():
    p = operating_point.solve(doubled(small({"gencls": CLASSICAL})))
    a = allocate(gramians(p, [(1, 2), (101, 2), (2, 3)], modes=1), 50.0, objective="log-det")
    assert a.gain[0] == pytest.approx(a.gain[1], rel=1e-12)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"budget_mw": 101.0, "cap": 10.0}, "101 MW exceeds the caps of the 10 candidates, 100 MW"),
        ({"cap": 0.0}, "candidates, 0 MW"),
        ({"cap": [100.0] + 9 * [0.0]}, "no accurate solution"),
    ],
)
def test_what_cannot_be_shared_out_is_said(found, given, words):
    with pytest.raises(StudyError, match=words):
        allocate(found, **{"budget_mw": 100.0, **given})


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"decay": 0.0}, r"does not decay, so it has no Gramian with a decay of 0 1/s; choose one above 1e-06"),
        ({"candidates": [(1, 40)]}, "no bus 40"),
    ],
)
def test_what_has_no_gramian_is_said(classical, given, words):
    with pytest.raises(StudyError, match=words):
        gramians(classical, **given)
