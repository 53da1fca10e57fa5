"""Variances of what is measured, against reports drawn at random."""

import numpy as np
import pytest

from stabctl.estimation._report_errors import angle_variance, current_variance, power_variance


def drawn(seed, sa, sm, n=200000):
    random = np.random.default_rng(seed)
    return sm * random.standard_normal((2, n)) + 1j * sa * random.standard_normal((2, n))


@pytest.mark.parametrize("psi", [0.0, -0.4, -0.8])
def test_variance_of_the_measured_angle(psi):
    V, ZI, sa, sm = 1.02 * np.exp(0.2j), 0.3 * np.exp(1.4j), 2e-3, 5e-3
    e, E = drawn(2, sa, sm), V + ZI
    seen = V * (1 + e[0]) + ZI * (1 + e[1])
    z = np.angle(seen / E) - np.arcsin(psi / np.abs(seen))
    expected = angle_variance(V, ZI, E, np.arcsin(psi / np.abs(E)), angle=sa, magnitude=sm)
    assert np.var(z) == pytest.approx(expected, rel=0.02)  # 0.008


def test_variance_of_the_measured_power_is_that_at_the_terminals():
    """The power of E = V + jx I is that of V; a reactance adds reactive power, but no variance."""
    V, I, x, sa, sm = 1.0 + 0j, 0.9 * np.exp(-0.6j), 0.3, 2e-3, 1e-3
    e = drawn(3, sa, sm)
    Vn, In = V * (1 + e[0]), I * (1 + e[1])
    P = ((Vn + 1j * x * In) * In.conj()).real
    assert np.var(P) == pytest.approx(power_variance(V * np.conj(I), sa, sm), rel=0.02)  # 0.003


def test_variance_of_the_measured_q_axis_current():
    I, sa, sm = 0.9 * np.exp(-0.6j), 2e-3, 1e-3
    e = drawn(6, sa, sm)
    assert np.var((I * (1 + e[0])).real) == pytest.approx(current_variance(I, sa, sm), rel=0.02)
