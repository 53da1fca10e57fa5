"""What a design is reported with: each number against another route to it."""

from dataclasses import replace

import control
import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.design import pod, pss
from stabctl.design.evidence import Check, compared, evidence, step_responses
from stabctl.design.tuning.robustness import shorter
from stabctl.view.pages import design_page


@pytest.fixture(scope="module")
def damper(cases):
    base = cases("two_area_thyristor").initialize(storage="3@11=50MW")
    inputs = "deviation:1, deviation:1+2, deviation:3"
    return pod(base, inputs, "order:3@11", damping=0.1, rate=60, delay="100ms", order=1)


@pytest.fixture(scope="module")
def found(damper):
    return evidence(damper)


@pytest.mark.slow
def test_the_loop_gain_is_minus_one_at_the_gain_margins(found):
    """Sampled and six frames late: the eigenvalues of the closed loop and the frequency response, within 2 %."""
    (loop,) = found.loops
    assert loop.name == "pod: order:3@11"
    inverse = np.interp(np.linspace(0.3, 4, 40000), loop.hz, 1 / loop.response)  # smooth at the mode
    for gain in (found.margins.gain_up, found.margins.gain_down):
        assert np.abs(1 + inverse / gain).min() < 0.02
    for gain in (1.0, 0.9 * found.margins.gain_up):
        assert np.abs(1 + inverse / gain).min() > 0.05
    assert loop.distance <= 2 * np.sin(np.deg2rad(loop.phase_margin) / 2) + 0.01


@pytest.mark.slow
def test_a_narrow_resonance_is_seen(cases):
    """A mode of damping 0.001: the loop gain on a grid of its own, 1/100 of its width, and the frequencies drawn."""
    base = cases("two_area_thyristor").initialize(storage="50MW")
    design = pod(base, "deviation:1", "order:1@5", damping=0.001)
    (loop,) = evidence(design).loops
    system = -control.series(base.linearize("order:1@5", "deviation:1").to_control(), design.controller.to_control())
    hz = np.linspace(0.5, 0.8, 60001)
    L = system(2j * np.pi * hz)
    assert loop.distance == pytest.approx(np.abs(1 + L).min(), rel=1e-4)
    crossing = np.abs(np.diff(np.abs(L) > 1))
    assert loop.phase_margin == pytest.approx(np.abs(np.angle(-L[:-1][crossing], deg=True)).min(), abs=0.1)
    assert np.abs(loop.response).max() > 0.9 * np.abs(L).max()
    assert np.diff(loop.hz).min() < 1e-3


def test_the_root_locus_begins_at_the_open_loop_and_passes_the_closed_one(damper, found):
    factors, values = found.locus.factors, found.locus.eigenvalues
    assert (factors[0], factors[20]) == (0.0, 1.0)
    for k, modes in ((0, damper.before[0]), (20, damper.after[0])):
        for s in modes.eigenvalues[modes.swings()]:
            assert np.abs(values[k] - s).min() < 1e-6


def test_the_step_is_that_of_a_simulation_with_a_small_load(damper, found):
    """A load step of 1 % of the largest load: speeds of the linear model within 2 % (1.0) of the largest swing."""
    steps = found.steps
    assert steps.mw == pytest.approx(17.67)
    run = damper.base.simulate([st.LoadStep(steps.bus, "1s", p=steps.mw)], "5s", control=damper.controller)
    H = damper.base.inertia
    speed = run.speed.values
    deviation = np.array(
        [speed[:, k] - np.delete(speed, k, 1) @ np.delete(H, k) / np.delete(H, k).sum() for k in range(4)]
    )
    t, y = steps.after
    now = t < 3.9
    simulated = np.array([np.interp(t[now] + 1, run.time, row) for row in deviation])
    assert np.abs(simulated.T - y[now]).max() < 0.02 * np.abs(y).max()


def test_a_controller_gives_its_step_after_its_delay(damper, found):
    name, t, y = found.steps.own[0]
    assert name == "pod: deviation:1"
    assert t[0] == 0
    assert (y[t < 0.1] == 0).all()
    assert y[t == 0.1].tolist() == [[0.0], damper.controller.D[:, 0].tolist()]


def test_a_continuous_controller_gives_its_exact_step(cases):
    """A lead with a time constant of 2 ms, 7 ms late, against its formula: 1e-9 of the largest value."""
    base = cases("two_area_thyristor").initialize(storage="50MW")
    s = control.tf("s")
    one = st.Controller.from_control(3 * (1 + 0.2 * s) / (1 + 0.002 * s), "deviation:1", "order:1@5", delay="7ms")
    ((_, t, y),) = step_responses(base, [one]).own
    assert (y[t < 0.007] == 0).all()
    late = t[2:] - 0.007
    assert y[2, 0] == pytest.approx(300)
    assert y[2:, 0] == pytest.approx(3 + 297 * np.exp(-late / 0.002), abs=3e-7)
    assert np.diff(t).max() < 0.007 + 1e-9
    assert y[1:3, 0].tolist() == pytest.approx([0.0, 300.0])


@pytest.mark.slow
def test_checks_are_clearing_times_without_and_with(cases):
    stabilizers = pss(cases("two_area_thyristor"), damping=0.13)
    assert not stabilizers.before[0].stable
    (check,) = evidence(stabilizers, ["7-8@0.4"]).checks
    assert check.before.cycles == stabilizers.base.clearing_time("7-8@0.4").cycles
    assert check.after.cycles > check.before.cycles + 5


def test_a_python_function_has_no_page(damper):
    law = st.Controller.from_function(lambda seen: 10 * seen["deviation:1"], "deviation:1", "order:3@11", rate=60)
    with pytest.raises(StudyError, match="is a Python function"):
        evidence(replace(damper, controllers=(law,)))


@pytest.mark.slow
def test_checks_compare_with_the_stabilizers_that_are_replaced(cases):
    """Of the case itself, by the clearing times of three systems; medians and counts by hand."""
    case = cases("two_area")
    found = evidence(pss(case, damping=0.1), ["7-8@0.4", "5"])
    own = [case.clearing_time(fault).cycles for fault in ("7-8@0.4", "5")]
    assert [c.replaced.cycles for c in found.checks] == own
    changes = [c.after.cycles - cycles for c, cycles in zip(found.checks, own, strict=True)]
    assert [c.change for c in found.checks] == changes
    shorter, longer = sum(x < 0 for x in changes), sum(x > 0 for x in changes)
    assert f"{shorter} of 2 clearing times are shorter and {longer} longer" in found.summary
    assert f"median {np.median(changes):+g} cycles, worst {min(changes):+g} cycles" in str(found)


def test_beyond_the_search_is_the_longest_clearing_time_of_all(cases):
    """With every answer of a search on either side: nothing, a number, and beyond."""
    found = cases("two_area").clearing_time("7-8@0.4")
    never = replace(found, status="unstable_at_zero", cycles=None)
    always = replace(found, status="stable_at_limit", cycles=None)
    assert [one.shown for one in (never, found, always)] == ["0", f"{found.cycles:g}", "60 or more"]
    rises = [Check(never, found), Check(found, always), Check(never, always)]
    falls = [Check(b.after, b.before) for b in rises]
    assert all(c.change > 0 for c in rises)
    assert [c.change for c in falls] == [-c.change for c in rises]
    assert shorter(rises) == []
    assert shorter(falls) == falls
    assert [c.gained.endswith(" cycles or more") for c in rises] == [False, True, True]
    assert Check(always, always).gained == "+0 cycles"
    assert compared(rises[1:2]).endswith(f"worst +{60 - found.cycles:g} cycles or more (7-8@0.4).")
    assert design_page._check(rises[1])[1:3] == (f"{found.cycles:g}", "60 or more")
