"""Loops with continuous delays: exact roots, all of them, against the Lambert W function and python-control."""

from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.special import lambertw

import stabctl as st
from stabctl.dynamics.named import named
from stabctl.smallsignal.delayed_loop import DelayedLoop
from stabctl.smallsignal.interconnection import plant_of

S = control.tf("s")
WASHOUT = 40 * 3 * S / (1 + 3 * S) / (1 + 0.05 * S)


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area_thyristor").initialize(storage="50MW")


def damper(delay):
    return st.Controller.from_control(WASHOUT, "deviation:1", "order:1@5", delay=delay, name="damper")


def stabilizer(delay):
    return st.Controller.from_control(5 * WASHOUT / 40, "speed:3", "vs:3", delay=delay, name="stabilizer")


@pytest.mark.parametrize("tau", [0.1, 0.5, 1.0])
def test_the_roots_of_a_scalar_law_are_those_of_the_lambert_function(tau):
    """x' = -x(t - tau): s = W(-tau) / tau on every branch."""
    one, none = np.ones((1, 1)), np.zeros((1, 1))
    loop = DelayedLoop(none, one, -one, none, np.array([tau]))
    found, region, counted, growing = loop.roots()
    wanted = np.array([lambertw(-tau, k) / tau for k in range(-40, 40)])
    inside = wanted[(np.abs(wanted) < region.radius) & (wanted.imag > -1e-12)]
    assert len(found) == len(inside)
    assert max(np.abs(inside - root.s).min() for root in found) < 1e-12  # at most 9e-16
    assert counted == (np.abs(wanted) < region.radius).sum()
    assert growing == 0


@pytest.mark.parametrize("delay", ["100ms", "1s"])
def test_every_root_closes_the_loop_and_none_is_missing(base, delay):
    """Two routes: K(s) exp(-s tau) P(s) = 1 with the transfer functions of python-control."""
    one = damper(delay)
    modes = base.closed_loop(one).modes()
    assert modes.certified
    assert modes.eigenvalues[0] == 0
    assert modes.label(0).startswith("angle reference")
    plant = base.linearize("order:1@5", "deviation:1").to_control()
    open_loop = np.linalg.eigvals(plant.A)
    for s in modes.eigenvalues:
        if s.real > -10 and s != 0 and np.abs(open_loop - s).min() > 1e-3:  # where P(s) is not infinite
            assert abs(plant(s) * WASHOUT(s) * np.exp(-s * one.delay) - 1) < 1e-10  # at most 1.9e-12
    sums = modes.participation[:, modes.swings()].sum(axis=0)
    assert np.abs(sums - 1).max() < 1e-2  # 7e-5 of the slowest: Pade in the rows of the delay


def test_the_direct_path_of_a_delayed_loop_is_in_its_roots(base):
    """Line power and terminal power follow orders at once: det(1 - K P exp(-s tau)) = 0 with two delays."""
    gains = np.array([[4.0, -1.0], [1.5, 3.0]])
    reads, drives, delays = ("flow:7-8", "pe:3"), ("order:1@5", "order:3@11"), (0.12, 0.23)
    slow, into, out = np.array([-5.0, -8.0]), np.array([[3.0, -2.0], [1.0, 4.0]]), np.array([2.0, -1.5])
    parts = [(slow[k : k + 1, None], into[k : k + 1], out[k : k + 1, None], gains[k : k + 1]) for k in range(2)]
    own = [st.Controller(reads, (drives[k],), *parts[k], delay=delays[k]) for k in range(2)]
    modes = base.closed_loop(*own).modes()
    plant = base.linearize(drives, reads).to_control()
    assert np.abs(plant.D).min() > 1e-3
    assert modes.certified
    one, checked = np.eye(2), 0
    for s in modes.eigenvalues:
        if s.real > -10 and np.abs(np.linalg.eigvals(plant.A) - s).min() > 1e-2:
            K = gains + (out / (s - slow))[:, None] * into
            loop = one - np.exp(-s * np.array(delays))[:, None] * (K @ plant(s))
            assert np.linalg.svd(loop, compute_uv=False)[-1] < 1e-9
            checked += 1
    assert checked > 10


def test_several_delays(base):
    """With all delays short, the modes are those without; the correction grows with the delay."""
    loop = base.closed_loop(damper("100ms"), stabilizer("50ms"), stabilizer(0.0))
    assert loop.modes().certified
    none, short = (base.closed_loop(damper(tau), stabilizer(tau / 2)).modes().eigenvalues for tau in (0.0, 2e-6))
    swings = none[(np.abs(none.imag) > 3) & (np.abs(none.imag) < 8)]
    assert max(np.abs(short - s).min() for s in swings) < 1e-4
    moved = [base.closed_loop(damper(tau)).modes().correction for tau in (0.1, 0.3, 1.0)]
    assert moved[0] < 1e-9  # 2.2e-11
    assert moved[1] < 1e-5  # 4.2e-7
    assert 1e-3 < moved[2] < 1e-1  # 7.1e-3


def test_residues_are_the_slopes_of_exact_roots(base):
    """The residue from stabilizer input to speed, and the root with that feedback added, without delay."""
    signals = {"inputs": "vs:3", "outputs": "speed:3"}
    modes = base.closed_loop(damper("400ms"), **signals).modes()
    k = modes.swings()[0]
    gain = 1e-4 / abs(modes.residues()[k])
    ends = []
    for g in (gain, -gain):
        more = st.Controller(("speed:3",), ("vs:3",), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[g]])
        found = base.closed_loop(damper("400ms"), more).modes().eigenvalues
        ends.append(found[np.abs(found - modes.eigenvalues[k]).argmin()])
    slope = (ends[0] - ends[1]) / (2 * gain)
    assert abs(slope / modes.residues()[k] - 1) < 1e-5


def test_the_delay_margin_of_a_continuous_controller_is_exact(base):
    """At the margin an exact root crosses the imaginary axis, also where the approximation is far off."""
    one = replace(damper("0s").scaled(5), name="strong")
    margin = base.margins(one).delay
    found = base.closed_loop(one.delayed(margin)).modes().eigenvalues
    assert abs(found[1:].real.max()) < 1e-4


def test_a_delayed_controller_that_gives_nothing_adds_no_roots(base):
    """Within a deadband, also where its input follows its output at once."""
    one = st.Controller(
        ("flow:7-8",),
        ("order:1@5",),
        np.zeros((0, 0)),
        np.zeros((0, 1)),
        np.zeros((1, 0)),
        [[400.0]],
        delay="100ms",
        deadband=0.1,
    )
    own = [named(base, one)]
    plant = plant_of(base, own)
    assert abs(plant.model.D[0, 0]) > 1e-3
    loop = DelayedLoop.of(plant, own)
    assert not loop.D.any()
    half = DelayedLoop.of(plant, [replace(own[0], equivalent=(0.5,))])
    assert half.D[0, 0] == pytest.approx(200 * plant.model.D[0, 0])
    assert half.C == pytest.approx(200 * plant.model.C[:1])
