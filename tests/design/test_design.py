"""Designed controllers: what they promise holds in the closed loop, and in the simulation."""

import json
from dataclasses import replace

import control
import numpy as np
import pytest
from ringdown import errors, ringdown

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.design import gep, lqr, pod, pss
from stabctl.design.pod import compensator
from stabctl.design.result import least


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area_thyristor").initialize(storage="50MW")


@pytest.fixture(scope="module")
def damper(base):
    return pod(base, "deviation:1", "order:1@5", damping=0.1, rate=60, delay="100ms")


def interarea(base, *controllers):
    modes = base.closed_loop(*controllers).modes()
    k = min(modes.swings(), key=lambda k: abs(modes.frequency_hz[k] - 0.61))
    return modes.damping_ratio[k], modes.eigenvalues[k]


@pytest.mark.parametrize("phase", np.deg2rad([-170, -90, -30, 0, 20, 75, 140]))
def test_a_compensator_has_the_phase_and_unit_gain(phase):
    H = compensator(phase, 3.8, 3.0)
    assert abs(complex(H(3.8j)) - np.exp(1j * phase)) < 1e-9
    assert (H.poles().real < 0).all()


def test_a_damper_reaches_the_damping_and_spares_the_other_modes(base, damper):
    assert damper.reached
    assert interarea(base)[0] == pytest.approx(-0.0087, abs=1e-4)
    assert interarea(base, damper.controller)[0] == pytest.approx(0.1, abs=2e-3)
    assert damper.worst_after > damper.worst_before
    assert damper.worst_after > 0.0861 - 0.002  # of machine 3 against 4, which this device hardly moves


def test_a_damper_keeps_damping_with_half_and_with_half_more_gain(base, damper):
    ratios = [interarea(base, damper.controller.scaled(k))[0] for k in (0.5, 1.0, 1.5)]
    assert ratios[0] > 0.04  # 0.046
    assert ratios[0] < ratios[1] < ratios[2]


def test_the_damper_in_the_simulation(base, damper):
    """The ring-down of the designed loop, and the clearing time that a growing mode did not have."""
    poles, _ = ringdown(base, damper.controller, bus=7)
    frequency, decay = errors(poles, interarea(base, damper.controller)[1])
    assert frequency < 1e-5
    assert decay < 5e-4


@pytest.mark.slow
def test_stabilizers_reach_the_damping_everywhere(base):
    found = pss(base, damping=0.13)
    assert found.reached
    assert found.worst_after == pytest.approx(0.13, abs=2e-3)
    assert [c.outputs for c in found.controllers] == [(f"vs:{i}",) for i in (1, 2, 3, 4)]


def test_the_gep_is_that_of_a_very_heavy_rotor(cases):
    """Two routes: rotor states removed, and a machine of large inertia, whose rotor stands still."""
    case = cases("two_area_thyristor")
    hz = np.array([0.3, 1.0, 2.0])
    heavy = case.set("genrou.2.H", 1e7)
    free, held = (gep(case, 2, others=others).response(hz) for others in ("free", "held"))
    assert np.abs(free / heavy.linearize("vs:2", "pe:2").response(hz) - 1).max() < 1e-4
    heavier = heavy.set({f"genrou.{i}.H": 1e7 for i in (1, 3, 4)})
    assert np.abs(held / heavier.linearize("vs:2", "pe:2").response(hz) - 1).max() < 1e-4


def test_a_regulator_is_optimal(base):
    """The gain of python-control for the same weights, on states without the angle reference; nothing else is moved."""
    found = lqr(base, speed=0.1)
    assert found.reached
    K = found.controller.D
    assert K.shape == (4, len(base.linearize().states))
    assert np.abs(K @ base.linearize().rotation()).max() < 1e-9 * np.abs(K).max()
    assert control.ss(base.closed_loop(found.controller).A, [[0.0]] * K.shape[1], [[0.0] * K.shape[1]], 0)
    cheaper, dearer = lqr(base, effort=2.0).worst_after, lqr(base, effort=0.5).worst_after
    assert dearer < found.worst_after < cheaper


@pytest.mark.slow
def test_commands(stabctl, tmp_path):
    out = tmp_path / "k.toml"
    words = ("two_area_thyristor", "--storage", "50MW", "--input", "deviation:1", "--output", "order:1@5")
    code, text, _ = stabctl("design", "pod", *words, "--rate", "60", "--delay", "100ms", "--out", out, "--json")
    found = json.loads(text)
    assert code == 0
    assert found["worst_damping_before"] == pytest.approx(-0.0087, abs=1e-4)
    assert found["mode_hz"] == pytest.approx(0.608, abs=1e-3)
    assert found["worst_damping_after"] > 0.08
    assert st.load_controller(out).rate == 60
    assert "4 controllers" in stabctl("design", "pss", "two_area_thyristor")[1]


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda b: pod(b, "deviation:1", "order"), "A damper has one output; give a single one"),
        (lambda b: pod(b, "deviation:9", "order:1@5"), "There is no machine 9"),
        (lambda b: pod(b, "absorbed:2", "order:1@5"), "is not seen in absorbed:2"),
        (lambda b: pss(b, [9]), "There is no machine 9"),
        (lambda b: lqr(st.load("two_area")), "has no storage devices; give storage"),
    ],
)
def test_mistakes(base, call, says):
    with pytest.raises(StudyError, match=says):
        call(base)


def test_without_oscillations_the_damping_is_1_and_of_no_mode(cases):
    modes = cases("two_area").modes()
    assert least(replace(modes, eigenvalues=-1.0 - np.arange(len(modes)) + 0j)) == (1.0, -1)
