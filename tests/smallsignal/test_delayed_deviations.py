"""Delayed loops whose outputs depend on one another, or whose roots lie close together: no crash, no root lost."""

from itertools import product

import numpy as np
import pytest

import stabctl as st
from stabctl.smallsignal.delayed_loop import DelayedLoop

GAINS = (5, 20, 50, 100)
DELAYS = (0.4, 0.55, 0.7, 0.85, 1.0, 1.5, 2.0)  # s
TOLERANCE = 1e-6  # of a root, relative to 1 + |s|
HIDDEN = 1e7  # exp(-s tau) above which rounding hides a root in the determinant of all outputs


@pytest.fixture(scope="module")
def bases(cases):
    return lambda name: cases(name).initialize(storage="50MW")


def proportional(base, gain, delay, kind="deviation"):
    sites = base.case.storage
    n = len(sites)
    none = np.zeros((0, 0)), np.zeros((0, n)), np.zeros((n, 0))
    names = [f"{kind}:{one.machine}" for one in sites], [f"order:{one.machine}@{one.bus}" for one in sites]
    return (st.Controller(*map(tuple, names), *none, gain * np.eye(n), delay=delay, name="proportional"),)


def washouts(base, gain, delay, kind="deviation"):
    A, B, C = np.array([[-1 / 3, 0.0], [-20 / 3, -20.0]]), np.array([[1.0], [20.0]]), np.array([[0.0, gain]])
    return [
        st.Controller(
            (f"{kind}:{one.machine}",), (f"order:{one.machine}@{one.bus}",), A, B, C, [[0.0]],
            delay=delay, name=f"damper {one.machine}",
        )
        for one in base.case.storage
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("gain", "delay"), [(5, 0.85), (20, 0.7), (20, 0.85), (50, 0.55)])
def test_deviations_of_all_machines_do_not_make_the_matrix_singular(bases, gain, delay):
    base = bases("two_area")
    assert base.closed_loop(*proportional(base, gain, delay)).modes().certified


def test_washouts_of_deviations_of_all_machines_do_not_make_the_matrix_singular(bases):
    base = bases("two_area")
    assert base.closed_loop(*washouts(base, 50, 0.7)).modes().certified


@pytest.mark.slow
@pytest.mark.parametrize(("name", "every"), [("two_area", 1), ("wscc9", 1), ("ieee39", 3)])
def test_deviations_of_all_machines_with_any_gain_and_delay(bases, name, every):
    """In the largest system, every third pair: each gain and each delay occurs."""
    base = bases(name)
    for gain, delay in [*product(GAINS, DELAYS)][::every]:
        modes = base.closed_loop(*proportional(base, gain, delay)).modes()
        assert modes.certified, (gain, delay, modes.counted, len(modes))


@pytest.mark.slow
def test_all_machines_of_the_western_system(bases):
    """34 equal governors: many real roots and pairs within 1e-5 of one another at -0.1."""
    base = bases("wnaps")
    modes = base.closed_loop(*proportional(base, 40, 0.1)).modes()
    assert modes.certified
    assert modes.counted == 430


@pytest.mark.parametrize("delay", [0.4, 0.7, 1.0])
def test_the_vectors_satisfy_their_equations_where_roots_decay_fast(bases, delay):
    """s x = A x + B v, v = E (C x + D v), and the same from the left; was 3,000 at 700 ms."""
    base = bases("two_area")
    modes = base.closed_loop(*proportional(base, 5, delay)).modes()
    loop, checked = modes.linear.opened, 0
    for s, right, left in zip(modes.eigenvalues[1:], modes.right.T[1:], modes.left.T[1:], strict=True):
        x, y = right[loop.places], left.conj()[loop.places]
        late = np.diag(np.exp(s * loop.delays)) - loop.D
        v, z = np.linalg.solve(late, loop.C @ x), np.linalg.solve(late.T, loop.B.T @ y)
        for size, error in ((s * x, s * x - loop.A @ x - loop.B @ v), (y * s, y * s - y @ loop.A - z @ loop.C)):
            assert np.abs(error).max() < 1e-4 * np.abs(size).max()  # 2e-5: rounding of the sum of deviations
        checked += s.real < -20
    assert checked > 3


def test_a_pair_close_to_the_real_axis_stays_a_pair():
    """Beside real roots within 1e-5, as in many equal governors."""
    a, w = -0.1, 3e-6
    A = np.diag([a, a + 2e-6, a - 2e-6, a, a, -1.0])
    A[3, 4], A[4, 3] = w, -w
    B, C = np.eye(6)[:, 5:], -2 * np.eye(6)[5:]
    T = np.linalg.qr(np.random.default_rng(1).normal(size=(6, 6)))[0]
    loop = DelayedLoop(T @ A @ T.T, T @ B, C @ T.T, np.zeros((1, 1)), np.array([0.3]))
    found = loop.roots()
    assert sum(1 + (root.s.imag > 0) for root in found.found) == found.counted
    near = [root.s for root in found.found if abs(root.s - a) < 1e-3]
    assert min(abs(s - complex(a, w)) for s in near) < 1e-9
    assert len(near) == 4


@pytest.mark.slow
def test_random_loops(bases):
    """Every root is one of the determinant, by its turns around a small circle; as many are found as counted."""
    rng = np.random.default_rng(2024)
    known = {name: bases(name) for name in ("wscc9", "two_area")}
    checked = 0
    for trial in range(500):
        base = known["two_area" if trial % 8 == 0 else "wscc9"]
        make = (proportional, washouts)[rng.integers(2)]
        kind = ("deviation", "speed")[rng.integers(2)]
        gain, delay = 10 ** rng.uniform(0, 2), rng.uniform(0.05, 1.5)
        modes = base.closed_loop(*make(base, gain, delay, kind)).modes()
        assert modes.counted == len(modes), (trial, base.case.name, make, kind, gain, delay)
        s = modes.eigenvalues
        s = s[(s.imag >= 0) & (s != 0) & (np.exp(-s.real * delay) < HIDDEN)]
        assert (turns(modes.linear.opened, s) >= 1).all(), (trial, base.case.name, make, kind, gain, delay)
        checked += len(s)
    assert checked > 5000


def turns(loop, s):
    """Roots of det(s - A - B (exp(s tau) - D)^-1 C) within the tolerance of each value."""
    circle = np.exp(2j * np.pi * np.arange(16) / 16)
    at = (s[:, None] + TOLERANCE * (1 + np.abs(s[:, None])) * circle)[:, :, None, None]
    late = np.exp(at * loop.delays[:, None]) * np.eye(len(loop.delays)) - loop.D
    phases = np.angle(np.linalg.slogdet(at * np.eye(len(loop.A)) - loop.A - loop.B @ np.linalg.solve(late, loop.C))[0])
    steps = np.diff(phases, axis=1, append=phases[:, :1])
    return np.round(((steps + np.pi) % (2 * np.pi) - np.pi).sum(axis=1) / (2 * np.pi))
