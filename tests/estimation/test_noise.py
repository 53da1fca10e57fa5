"""Covariances against what they are the covariances of."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stabctl.estimation.noise import JUMP, angle_variance, power_variance, process_covariance, swing_model

H, D, HZ, T = np.array([2.0, 6.5]), np.array([0.0, 1.0]), 60.0, 1 / 60
SWING = swing_model(H, D, np.zeros(2), hz=HZ, T=T, walk=0.05)


def rates(i, power):
    wb = 2 * np.pi * HZ
    return lambda t, x: (wb * x[1], (x[2] - power(t) - D[i] * x[1]) / (2 * H[i]), 0.0)


@pytest.mark.parametrize("i", [0, 1])
def test_a_frame_is_the_integral_of_the_swing_equation_with_a_ramp_of_power(i):
    x, P0, dP = np.array([0.3, 0.002, 0.9]), 0.7, 0.4
    end = solve_ivp(rates(i, lambda t: P0 + dP * t / T), (0, T), x, rtol=1e-11, atol=1e-13).y[:, -1]
    stepped = SWING.F[i] @ [*x, 0] + SWING.B[i] @ [P0, dP, dP, 0]
    assert np.abs(stepped[:3] - end).max() < (1e-12 if D[i] == 0 else 2e-6)  # 1e-15, 1.1e-6


def test_a_jump_after_lost_reports_has_the_mean_of_a_ramp_over_all_of_them():
    P0, dP, m = 0.7, 0.4, 3
    end = solve_ivp(rates(0, lambda t: P0 + dP * t / (m * T)), (0, m * T), [0, 0, 0.9], rtol=1e-11, atol=1e-13).y[:, -1]
    x = np.array([0, 0, 0.9, 0])
    for k in range(m):
        u = [P0, m * dP, m * m * dP, 0] if k == m - 1 else [P0, 0, 0, 0]
        x = SWING.F[0] @ x + SWING.B[0] @ u
    assert np.abs(x[:3] - end).max() < 1e-12


def test_moments_of_a_jump_at_an_unknown_instant():
    u = (np.arange(100000) + 0.5) / 100000
    assert np.abs(np.cov([u * u, u, 0 * u, u], bias=True) - JUMP).max() < 1e-9


def test_process_covariance_is_that_of_jumps_of_power():
    dP, f = 0.5, 0.03
    given = {"jump": dP, "frames": 2, "flux": f}
    Q = process_covariance(SWING, power=np.zeros((1, 2)), **{k: np.full((1, 2), v) for k, v in given.items()})[0, 0]
    u, wb = (np.arange(10000) + 0.5) / 10000, 2 * np.pi * HZ
    late = 2 * T * u
    moved = [-wb * dP * late**2 / (4 * H[0]), -dP * late / (2 * H[0]), 0 * u, f * u]
    assert np.allclose(Q - SWING.walk[0], np.cov(moved, bias=True), rtol=1e-6, atol=1e-15)


def test_walk_is_the_covariance_of_an_integrated_random_walk():
    fine, n = 200, 20000
    random = np.random.default_rng(1)
    F = swing_model(H, D, np.zeros(2), hz=HZ, T=T / fine, walk=0.0).F[0, :3, :3]
    x = np.zeros((n, 3))
    for _ in range(fine):
        x = x @ F.T
        x[:, 2] += 0.05 * np.sqrt(T / fine) * random.standard_normal(n)
    assert np.allclose(np.cov(x.T), SWING.walk[0, :3, :3], rtol=0.05)  # 0.02


@pytest.mark.parametrize("psi", [0.0, -0.4, -0.8])
def test_variance_of_the_measured_angle(psi):
    random = np.random.default_rng(2)
    V, ZI, sa, sm = 1.02 * np.exp(0.2j), 0.3 * np.exp(1.4j), 2e-3, 5e-3
    e = sm * random.standard_normal((2, 200000)) + 1j * sa * random.standard_normal((2, 200000))
    E, seen = V + ZI, V * (1 + e[0]) + ZI * (1 + e[1])
    z = np.angle(seen / E) - np.arcsin(psi / np.abs(seen))
    expected = angle_variance(V, ZI, E, np.arcsin(psi / np.abs(E)), angle=sa, magnitude=sm)
    assert np.var(z) == pytest.approx(expected, rel=0.02)  # 0.008


def test_variance_of_the_measured_power():
    random = np.random.default_rng(3)
    V, I, sa, sm = 1.0 + 0j, 0.9 * np.exp(-0.6j), 2e-3, 1e-3
    e = sm * random.standard_normal((2, 200000)) + 1j * sa * random.standard_normal((2, 200000))
    P = (V * (1 + e[0]) * (I * (1 + e[1])).conj()).real
    assert np.var(P) == pytest.approx(power_variance(V * I.conj(), sa, sm), rel=0.02)  # 0.003
