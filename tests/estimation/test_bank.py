"""The filters: consistency with an exact model, the gate, losses, and the same numbers from both engines."""

import numpy as np
import pytest
from scipy.stats import chi2

from stabctl.estimation.bank import ENGINES, GATE, Batched, wrapped
from stabctl.estimation.noise import REJECTED, swing_model

T, R = 1 / 60, 4e-6
H = np.array([2.0, 4.0, 6.5])
MODEL = swing_model(H, np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 0.8]), hz=60.0, T=T, walk=0.05)
P0 = np.diag([1e-5, 1e-7, 1e-4, 0.0])


def process_noise(seeds):
    flux = np.zeros((3, 4, 4))
    flux[2, 3, 3] = 1e-5
    return np.broadcast_to(MODEL.walk + 1e-4 * MODEL.power + flux, (seeds, 3, 4, 4))


def draw(random, covariance):
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0))[..., None, :]
    return (root @ random.standard_normal((*covariance.shape[:-1], 1)))[..., 0]


def exact(engine, seeds, frames, loss=0.1):
    """Banks on truths that are their own model; the last NEES (three states) and every NIS."""
    random = np.random.default_rng(5)
    Q, F = process_noise(seeds), np.broadcast_to(MODEL.F, (seeds, 3, 4, 4))
    start = np.zeros((seeds, 3, 4))
    truth = start + draw(random, np.broadcast_to(P0, (seeds, 3, 4, 4)))
    bank, seen = ENGINES[engine](MODEL, start, np.broadcast_to(P0, (seeds, 3, 4, 4))), []
    for k in range(frames):
        u = np.zeros((seeds, 3, 4))
        u[..., 0], u[..., 1] = 0.2 * np.sin(k / 5), 0.05
        truth = (F @ truth[..., None] + MODEL.B @ u[..., None])[..., 0] + draw(random, Q)
        bank.predict(u, F, Q)
        z = truth[..., 0] + truth[..., 3] + np.sqrt(R) * random.standard_normal((seeds, 3))
        seen.append(bank.update(wrapped(z), np.full((seeds, 3), R), random.random((seeds, 3)) >= loss))
    e = (truth - bank.x)[..., :3]
    return np.einsum("...i,...i", e, np.linalg.solve(bank.P[..., :3, :3], e[..., None])[..., 0]), np.array(seen), bank


def test_nees_and_nis_lie_within_their_chi_square_bounds():
    seeds = 400
    nees, nis, _ = exact("batched", seeds, 60)
    for i in range(3):
        n = 3 * seeds
        low, high = chi2.ppf([0.005, 0.995], n) / n
        assert low < nees[:, i].mean() / 3 < high  # 1.00, 0.98, 1.01 in 0.90..1.11
        got = nis[:, :, i][np.isfinite(nis[:, :, i])]
        low, high = chi2.ppf([0.005, 0.995], len(got)) / len(got)
        assert low < got.mean() < high
    assert np.nanmean(nis > GATE) == pytest.approx(0.001, abs=4e-4)


def test_both_engines_give_the_same_numbers():
    one, two = exact("filterpy", 2, 80), exact("batched", 2, 80)
    for a, b in ((one[0], two[0]), (one[1], two[1])):
        assert np.nanmax(np.abs(a - b)) < 1e-7
    assert np.abs(one[2].x - two[2].x).max() < 1e-10
    assert np.abs(one[2].P - two[2].P).max() < 1e-10


@pytest.mark.parametrize("engine", ENGINES)
def test_a_lost_report_is_a_prediction_without_an_update(engine):
    bank = ENGINES[engine](MODEL, np.zeros((1, 3, 4)), np.broadcast_to(P0, (1, 3, 4, 4)))
    x, P = bank.x.copy(), bank.P.copy()
    nis = bank.update(np.full((1, 3), 1.0), np.full((1, 3), R), np.zeros((1, 3), bool))
    assert np.isnan(nis).all()
    assert (bank.x == x).all()
    assert (bank.P == P).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_the_gate_leaves_out_two_reports_and_opens_at_the_third(engine):
    bank = ENGINES[engine](MODEL, np.zeros((1, 3, 4)), np.broadcast_to(P0, (1, 3, 4, 4)))
    z, everywhere = np.full((1, 3), 0.5), np.ones((1, 3), bool)
    for _ in range(REJECTED):
        assert (bank.update(z, np.full((1, 3), R), everywhere) > GATE).all()
        assert np.abs(bank.x).max() == 0
    bank.update(z, np.full((1, 3), R), everywhere)
    assert np.abs(bank.x[..., 0] + bank.x[..., 3] - 0.5).max() < 1e-3  # 8e-6
    assert (bank.update(z, np.full((1, 3), R), everywhere) < GATE).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_single_wild_report_does_nothing(engine):
    bank = ENGINES[engine](MODEL, np.zeros((1, 3, 4)), np.broadcast_to(P0, (1, 3, 4, 4)))
    everywhere = np.ones((1, 3), bool)
    bank.update(np.full((1, 3), 1.0), np.full((1, 3), R), everywhere)
    bank.update(np.zeros((1, 3)), np.full((1, 3), R), everywhere)
    for _ in range(REJECTED):
        bank.update(np.full((1, 3), -1.0), np.full((1, 3), R), everywhere)
    assert np.abs(bank.x).max() == 0


def test_angles_are_unwrapped_around_the_prediction():
    start = np.zeros((1, 3, 4))
    start[..., 0] = 4 * np.pi + 3.1
    bank = Batched(MODEL, start, np.broadcast_to(P0, (1, 3, 4, 4)))
    bank.update(np.full((1, 3), 3.101), np.full((1, 3), R), np.ones((1, 3), bool))
    assert bank.x[..., 0] + bank.x[..., 3] == pytest.approx(np.full((1, 3), 4 * np.pi + 3.1007), abs=3e-4)
