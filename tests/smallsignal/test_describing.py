"""Describing functions: against the Fourier integral of the output, and their inverse."""

import control
import numpy as np
import pytest

from stabctl.smallsignal.opened_loop import Nonlinearity, alone

SHAPES = {
    "deadband": Nonlinearity(0.2, np.inf, False),
    "deadband and limits": Nonlinearity(0.2, 0.5, False),
    "limits": Nonlinearity(0.0, 0.5, False),
    "relay": Nonlinearity(0.0, 0.5, True),
    "relay with deadband": Nonlinearity(0.2, 0.5, True),
}
each = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
T = 2 * np.pi * (np.arange(200_000) + 0.5) / 200_000


@each
def test_the_describing_function_is_the_fourier_integral(shape):
    for A in (0.1, 0.21, 0.3, 0.6, 1.0, 5.0):
        wanted = 2 * np.mean(shape.output(A * np.sin(T)) * np.sin(T)) / A
        assert float(shape.gain(A)) == pytest.approx(wanted, abs=1e-4)  # at most 2e-5: the integral of a step


@each
def test_the_describing_function_is_that_of_python_control(shape):
    """Which sums over 4,000 points of a period: the more exact without the steps of a relay."""
    A = np.array([0.1, 0.21, 0.3, 0.6, 1.0, 5.0])
    found = control.describing_function(lambda x: float(shape.output(x)), A, num_points=4000, zero_check=False)
    assert np.abs(shape.gain(A) - found.real).max() < (2e-3 if shape.relay else 1e-6)  # 1.1e-3; 6e-8


def test_limits_are_the_saturation_of_python_control():
    exact = control.saturation_nonlinearity(0.5)
    for A in (0.1, 0.5, 0.51, 0.6, 1.0, 5.0):
        assert float(SHAPES["limits"].gain(A)) == pytest.approx(exact.describing_function(A), rel=1e-12)


@each
def test_amplitudes_of_a_gain(shape):
    """Where N(A) is the gain: none above its maximum, two if it rises and falls; between them it has a slope."""
    A = shape.grid()
    gain = shape.gain(A)
    top = gain.max()
    assert shape.amplitudes(1.01 * top) == []
    twice = gain[0] < 0.3 * top and gain[-1] < 0.3 * top
    found = shape.amplitudes(0.3 * top)
    assert len(found) == 1 + twice
    assert shape.gain(np.array(found)) == pytest.approx(0.3 * top, rel=1e-9)
    for a in found:
        assert np.sign(shape.gain(1.001 * a) - shape.gain(0.999 * a)) == shape.slope(a)


def test_the_relay_just_above_its_deadband():
    """N(A) = g where A is 1e-9 above the deadband d: 4 M/(pi d) sqrt(2 (A/d - 1)) to first order."""
    d, M = 2e-4, 1.0
    gain = 4 * M / (np.pi * d) * np.sqrt(2e-9)
    first = Nonlinearity(d, M, True).amplitudes(gain)[0]
    assert first / d - 1 == pytest.approx(1e-9, rel=1e-5)


def test_the_third_harmonic_of_a_relay_without_deadband_is_a_third():
    assert SHAPES["relay"].third(1.0) == pytest.approx(1 / 3, rel=1e-5)


@pytest.mark.parametrize("above", [1e-4, 1e-9])
def test_of_narrow_pulses_all_harmonics_are_equal(above):
    """Just above a deadband; at 1e-9 they are narrower than a sample."""
    for shape in (Nonlinearity(0.2, 0.5, True), Nonlinearity(0.2, np.inf, False)):
        assert shape.third(0.2 * (1 + above)) == pytest.approx(1, rel=2e-3)  # 5e-4


def test_an_output_beside_others_of_unequal_gains_is_what_the_determinants_say():
    """1 - n_r alone_r = det(1 - G N) / det(1 - G_oo N_o), o the others, by the Schur complement."""
    rng = np.random.default_rng(7)
    G = rng.normal(size=(5, 4, 4)) + 1j * rng.normal(size=(5, 4, 4))
    gains = np.array([0.3, -0.7, 1.9, 0.11])
    whole = np.eye(4) - G * gains
    for r in range(4):
        rest = np.delete(np.arange(4), r)
        ratio = np.linalg.det(whole) / np.linalg.det(whole[:, rest][:, :, rest])
        assert np.abs(1 - gains[r] * alone(G, gains, r) - ratio).max() < 1e-12
