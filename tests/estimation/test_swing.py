"""The swing equation over a frame, and the covariances of what it leaves out, against their definitions."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stabctl.estimation._swing import JUMP, process_covariance, rejections, swing

H, D, HZ, T = np.array([2.0, 6.5]), np.array([0.0, 1.0]), 60.0, 1 / 60
SWING = swing(H, D, hz=HZ, T=T, walk=0.05, flux=np.array([0.0, 1.0]))


def covariance(jump, frames, power, flux=(0.0, 0.0)):
    """Process covariance of the first machine."""
    Q = np.empty((1, 2, 5, 5))
    process_covariance(0, 0, SWING, Q, jump, frames, power, flux, (0.0, 0.0), 5 * (0.0,))
    return Q[0, 0]


def rates(i, power):
    wb = 2 * np.pi * HZ
    return lambda t, x: (wb * x[1], (x[2] - power(t) - D[i] * x[1]) / (2 * H[i]), 0.0)


@pytest.mark.parametrize("i", [0, 1])
def test_a_frame_is_the_integral_of_the_swing_equation_with_a_ramp_of_power(i):
    x, P0, dP = np.array([0.3, 0.002, 0.9]), 0.7, 0.4
    end = solve_ivp(rates(i, lambda t: P0 + dP * t / T), (0, T), x, rtol=1e-11, atol=1e-13).y[:, -1]
    stepped = SWING.F[i] @ x + SWING.B[i] @ [P0, dP, dP]
    assert np.abs(stepped - end).max() < (1e-12 if D[i] == 0 else 2e-6)  # 1e-15, 1.1e-6


def test_a_jump_after_lost_reports_has_the_mean_of_a_ramp_over_all_of_them():
    P0, dP, m = 0.7, 0.4, 3
    end = solve_ivp(rates(0, lambda t: P0 + dP * t / (m * T)), (0, m * T), [0, 0, 0.9], rtol=1e-11, atol=1e-13).y[:, -1]
    x = np.array([0, 0, 0.9])
    for k in range(m):
        x = SWING.F[0] @ x + SWING.B[0] @ ([P0, m * dP, m * m * dP] if k == m - 1 else [P0, 0, 0])
    assert np.abs(x - end).max() < 1e-12


def test_moments_of_a_jump_at_an_unknown_instant():
    u = (np.arange(100000) + 0.5) / 100000
    assert np.abs(np.cov([u * u, u, 0 * u, u, u], bias=True) - JUMP).max() < 1e-9


def test_process_covariance_is_that_of_jumps_of_power_and_current():
    dP, f = 0.5, np.array([0.03, -0.02])
    Q = covariance(dP, 2, 0.0, f)
    u, wb = (np.arange(10000) + 0.5) / 10000, 2 * np.pi * HZ
    late = 2 * T * u
    moved = [-wb * dP * late**2 / (4 * H[0]), -dP * late / (2 * H[0]), 0 * u, f[0] * u, f[1] * u]
    assert np.allclose(Q - SWING.walk[0], np.cov(moved, bias=True), rtol=1e-6, atol=1e-15)


def test_a_report_of_power_acts_in_two_frames_and_its_noise_counts_in_full():
    """Speed after n frames: the mean of every two reports, so that n reports of variance v give n d^2 v."""
    n, seeds, size = 50, 20000, 0.003
    noise = size * np.random.default_rng(4).standard_normal((n + 1, seeds))
    x = np.zeros((3, seeds))
    for k in range(n):
        dP = noise[k + 1] - noise[k]
        x = SWING.F[0] @ x + SWING.B[0] @ np.array([noise[k], dP, dP])
    Q = covariance(0.0, 1, size**2) - SWING.walk[0]
    assert Q[1, 1] == pytest.approx((size * T / (2 * H[0])) ** 2)
    assert np.var(x[1]) == pytest.approx(n * Q[1, 1], rel=0.03)  # 0.99: half of the first and the last are missing


def test_walk_is_the_covariance_of_an_integrated_random_walk():
    fine, n = 200, 20000
    random = np.random.default_rng(1)
    F = swing(H, D, hz=HZ, T=T / fine, walk=0.0, flux=D).F[0]
    x = np.zeros((n, 3))
    for _ in range(fine):
        x = x @ F.T
        x[:, 2] += 0.05 * np.sqrt(T / fine) * random.standard_normal(n)
    assert np.allclose(np.cov(x.T), SWING.walk[0, :3, :3], rtol=0.05)  # 0.02


def test_each_state_gets_the_variance_that_explains_an_innovation_alone():
    """After the rejected reports an angle is off by as much as the innovation, here 1 rad."""
    flux = np.array([0.0, 0.8])
    found = swing(H, np.zeros(2), hz=HZ, T=T, walk=0.05, flux=flux)
    angle, speed, power, *fluxes = np.sqrt(found.reset).T
    later = np.linalg.matrix_power(found.F, rejections(T) + 1)
    assert angle == pytest.approx(1)
    assert (later @ np.stack([0 * speed, speed, 0 * speed], -1)[..., None])[:, 0, 0] == pytest.approx(1)
    assert not power.any()  # it is measured
    assert np.array(fluxes) == pytest.approx(np.array([flux, flux]))
