"""Counts of roots of loops with delays: against known roots, simple and repeated, and against brute force."""

import numpy as np
import pytest
from scipy.special import lambertw

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.smallsignal._characteristic import growing
from stabctl.smallsignal.delayed_loop import DelayedLoop

BRANCHES = np.arange(-150, 151)


def lambert(a, k, tau):
    """Roots of x' = a x - k x(t - tau)."""
    return a + lambertw(-k * tau * np.exp(-a * tau), BRANCHES) / tau


def mixed(rng, blocks, defective=False):
    """A loop of scalar equations (a, k, tau) hidden by a change of the states and of outputs with one delay."""
    a, k, tau = (np.array(part, float) for part in zip(*blocks, strict=True))
    n = len(a)
    A, B, C = np.diag(a), -np.diag(k), np.eye(n)
    if defective:
        A[0, 1] = 1.0  # the first two are equal
    T = np.linalg.qr(rng.normal(size=(n, n)))[0] @ np.diag(rng.uniform(0.5, 2, n))
    Q = np.zeros((n, n))
    for value in np.unique(tau):
        own = np.flatnonzero(tau == value)
        Q[np.ix_(own, own)] = np.linalg.qr(rng.normal(size=(len(own),) * 2))[0]
    inverse = np.linalg.inv(T)
    loop = DelayedLoop(T @ A @ inverse, T @ B @ Q.T, Q @ C @ inverse, np.zeros((n, n)), tau)
    return loop, np.concatenate([lambert(*block) for block in blocks])


def check(loop, wanted, tolerance):
    found, region, counted, grow = loop.roots()
    inside = wanted[region.holds(wanted)]
    assert counted == len(inside)
    assert grow == (wanted.real > 1e-6).sum()
    roots = np.array([root.s for root in found])
    roots = np.r_[roots, roots[roots.imag > 0].conj()]
    assert len(roots) == len(inside)  # each as often as it counts
    for s in inside:
        radius = 1e-3
        assert (np.abs(roots - s) < radius).sum() == (np.abs(inside - s) < radius).sum()
        assert np.abs(roots - s).min() < tolerance


@pytest.mark.parametrize("seed", range(4))
def test_known_roots_are_counted_and_found(seed):
    """Scalar equations, two of them equal, so that their roots are double with two vectors each."""
    rng = np.random.default_rng(seed)
    draw = lambda tau: (rng.uniform(-3, 1), rng.choice([-1, 1]) * rng.uniform(0.5, 12), tau)  # noqa: E731
    first, second = rng.uniform(0.05, 0.9, 2)
    twice = draw(first)
    loop, wanted = mixed(rng, [twice, twice, draw(first), draw(second), draw(rng.uniform(0.02, 0.1))])
    check(loop, wanted, 1e-9)  # at most 2e-13


def test_double_roots_with_one_vector_are_counted_twice():
    rng = np.random.default_rng(7)
    loop, wanted = mixed(rng, [(-1.0, 3.0, 0.4), (-1.0, 3.0, 0.4), (-2.0, 1.0, 0.4)], defective=True)
    check(loop, wanted, 1e-5)  # at most 1e-7: half of the digits


@pytest.mark.parametrize("channels", [12, 24])
def test_many_outputs_with_long_delays(channels):
    """Outputs x delay of 4 to 8 s: hundreds of roots, many at one place."""
    rng = np.random.default_rng(channels)
    kinds = [(-1.0, 2.0, 0.35), (-0.5, -1.5, 0.35), (-3.0, 6.0, 0.35)]
    loop, wanted = mixed(rng, [kinds[k % 3] for k in range(channels)])
    check(loop, wanted, 1e-6)


@pytest.mark.parametrize(("k", "tau"), [(500, 0.1), (100, 0.02), (2000, 0.05)])
def test_what_grows_above_10_hz_is_counted_and_found(k, tau):
    """Roots of x' = -k x(t - tau), all beyond the circle of 10 Hz that grow."""
    one, none = np.ones((1, 1)), np.zeros((1, 1))
    loop = DelayedLoop(none, one, -k * one, none, np.array([tau]))
    check(loop, lambert(0, k, tau), 1e-8)
    assert growing(loop.characteristic()) > 0
    assert lambert(0, k, tau).real.max() > 1


def test_the_bound_of_growing_roots_is_one():
    """Nothing grows beyond it, and it is no more than twice as far as the fastest that could."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        k, tau = rng.uniform(1, 100), rng.uniform(0.05, 1)
        loop, wanted = mixed(rng, [(-1.0, k, tau), (0.5, -k / 3, tau)])
        bound = loop.characteristic().bound()
        assert np.abs(wanted[wanted.real > 0]).max(initial=0) < bound < 3 * k


def brute(loop, region, points):
    """Roots in a region from a fine polygon: zeros of det(s - A) det(1 - E H), without any step control."""
    A, B, C, D, tau = loop.A, loop.B, loop.C, loop.D, loop.delays
    total = 0.0
    for path in region.paths():
        s = path(np.linspace(0, 1, points))
        sign = []
        for one in s:
            E = np.exp(-one * tau)[:, None]
            M = np.block([[one * np.eye(len(A)) - A, -B], [-E * C, np.eye(len(D)) - E * D]])
            sign.append(np.linalg.slogdet(M)[0])
        steps = np.angle(np.array(sign[1:]) / np.array(sign[:-1]))
        assert np.abs(steps).max() < 1.5
        total += steps.sum()
    return round(total / np.pi)


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area").initialize(storage="200MW")


def proportional(gain, delay, machines="1234"):
    names = [f"deviation:{m}" for m in machines], [f"order:{m}" for m in machines]
    n = len(machines)
    none = np.zeros((0, 0)), np.zeros((0, n)), np.zeros((n, 0))
    return st.Controller(*map(tuple, names), *none, gain * np.eye(n), delay=delay, name="proportional")


@pytest.mark.parametrize("delay", ["100ms", "450ms"])
def test_the_count_of_a_power_system_is_that_of_brute_force(base, delay):
    """Four outputs, whose deviations add up to zero."""
    loop = base.closed_loop(proportional(40, delay)).opened
    region, counted = loop.counted(loop.characteristic())
    assert counted == brute(loop, region, 3000)


@pytest.mark.slow
def test_ten_outputs_of_ieee39_with_300_ms(cases):
    """3 s of delay in all, and the poles of ten equal washouts nearly at one place."""
    point = cases("ieee39").initialize(storage="200MW")
    loop = point.closed_loop(*(washout(one.machine, one.bus) for one in point.case.storage))
    modes = loop.modes()
    region, counted = loop.opened.counted(loop.opened.characteristic(loop.rotation()))
    assert modes.certified
    assert modes.counted == counted + 1 == brute(loop.opened, region, 1500) > 150  # 186


def washout(machine, bus):
    """40 * 3 s / (1 + 3 s) / (1 + 0.05 s)."""
    A, B, C = np.array([[-1 / 3, 0.0], [-20 / 3, -20.0]]), np.array([[1.0], [20.0]]), np.array([[0.0, 40.0]])
    names = (f"deviation:{machine}",), (f"order:{machine}@{bus}",)
    return st.Controller(*names, A, B, C, np.zeros((1, 1)), delay="300ms", name=f"damper {machine}")


@pytest.mark.parametrize("delay", ["700ms", "1.5s"])
def test_deviations_of_all_machines_with_long_delays_are_certified(base, delay):
    modes = base.closed_loop(proportional(40, delay)).modes()
    assert modes.certified
    assert modes.counted == len(modes) > 60
    A = modes.linear.opened.discretized(40.0)  # four times the nodes that the search begins with
    fine = np.linalg.eigvals(A)
    holds = (np.abs(fine) < modes.radius) & (fine.real > -modes.decay)
    assert modes.counted == holds.sum()


def test_a_loop_that_grows_above_10_hz_is_unstable(base):
    """At 13.9 Hz; the roots below 10 Hz all decay."""
    loop = base.closed_loop(proportional(16000, "20ms", "1"))
    modes = loop.modes()
    fastest = modes.eigenvalues[modes.eigenvalues.real.argmax()]
    assert modes.certified
    assert modes.growing == 2
    assert not modes.stable
    assert fastest.real == pytest.approx(13.96, abs=0.01)
    assert abs(fastest.imag) / (2 * np.pi) == pytest.approx(13.92, abs=0.01)
    assert loop.eigenvalues().real.max() == pytest.approx(fastest.real)
    slow = modes.eigenvalues[np.abs(modes.eigenvalues.imag) < 20 * np.pi]
    assert slow.real.max() < 1e-6
    assert "unstable" in str(modes)
    with pytest.raises(StudyError, match="unstable, so it has no margins"):
        base.margins(proportional(16000, "20ms", "1"))


def test_gain_margins_include_frequencies_above_10_hz(base):
    """The loop that is unstable at 16,000: its limit is that of the loop gain, and roots cross there."""
    found = base.margins(proportional(500, "20ms", "1"))
    (loop,) = found.loops
    assert found.gain_up == pytest.approx(loop.gain_up, rel=1.1e-4)  # 21.7
    assert loop.gain_up_hz > 10
    for part, stable in ((0.999, True), (1.001, False)):
        assert base.closed_loop(proportional(500 * part * found.gain_up, "20ms", "1")).modes().stable == stable


@pytest.mark.parametrize("d", [0.6, -0.9, 1.2])
def test_a_direct_path_bounds_the_growing_roots_only_below_1(d):
    """x' = -x + v, w = 2 x + d v, v = w after 0.3 s: a neutral equation."""
    one = np.ones((1, 1))
    loop = DelayedLoop(-one, one, 0.3 * one, d * one, np.array([0.3]))
    found = loop.roots()
    if abs(d) < 1:
        assert found.counted == brute(loop, found.region, 4000)
        for root in found.found:
            assert abs(np.exp(0.3 * root.s) - d - 0.3 / (root.s + 1)) < 1e-9
    else:
        assert found.counted is None
        assert found.growing is None


@pytest.mark.slow
def test_what_rounding_hides_is_not_claimed():
    """Two equal outputs with 10 s of delay: one part of 1 - E H is exactly 1, beside numbers of exp(600)."""
    one, none = np.ones((2, 1)), np.zeros((2, 2))
    loop = DelayedLoop(-np.eye(1), one.T, one, none, np.full(2, 10.0))
    _, region, _, _ = loop.roots()
    assert region.left < 4  # exp(-40) in a delay
    check(loop, lambert(-1.0, -2.0, 10.0), 1e-9)
