"""The filters: consistency with an exact model, the gate, losses, and the same numbers from both engines."""

import numpy as np
import pytest
from scipy.stats import chi2

from stabctl.estimation._filter_bank import ENGINES, GATE, Seen, wrapped
from stabctl.estimation._swing import STATES, rejections, swing

T, R = 1 / 60, 4e-6
REJECTED = rejections(T)
H = np.array([2.0, 4.0, 6.5])
FLUX = np.array([0.0, 0.0, 1.0])
MODEL = swing(H, np.array([0.0, 1.0, 0.0]), hz=60.0, T=T, walk=0.05, flux=FLUX)
P0 = np.diag([1e-5, 1e-7, 1e-4, 0.0, 0.0])
SLOPE = np.stack([1 + 0 * H, 0 * H, 0 * H, 0.2 * FLUX, 0.8 * FLUX], -1)
TRANSITION = np.zeros((3, STATES, STATES))
TRANSITION[:, :3, :3], TRANSITION[:, 3, 3], TRANSITION[:, 4, 4] = MODEL.F, 0.9, 0.7


def process_noise(seeds):
    Q = np.zeros((3, STATES, STATES))
    Q[:, 0, 0], Q[:, 0, 1], Q[:, 1, 0], Q[:, 1, 1] = MODEL.c**2, MODEL.c * MODEL.d, MODEL.c * MODEL.d, MODEL.d**2
    Q[2, 3:, 3:] = 0.1 * np.array([[1.0, 0.5], [0.5, 1.0]])
    return np.broadcast_to(MODEL.walk + 1e-4 * Q, (seeds, 3, STATES, STATES))


def draw(random, covariance):
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0))[..., None, :]
    return (root @ random.standard_normal((*covariance.shape[:-1], 1)))[..., 0]


def seen(bank, angle, received=True, R=R):
    expected = (SLOPE * bank.x).sum(-1)
    shape = expected.shape
    slope = np.broadcast_to(SLOPE, bank.x.shape)
    return Seen(np.full(shape, angle), expected, slope, np.full(shape, R), np.full(shape, received))


def begun(engine, seeds=1, x=0.0):
    start = np.zeros((seeds, 3, STATES))
    start[..., 0] = x
    return ENGINES[engine](start, np.broadcast_to(P0, (seeds, 3, STATES, STATES)), MODEL.reset, REJECTED)


def exact(engine, seeds, frames, loss=0.1):
    """Banks on truths that are their own model; the last NEES (three states) and every NIS."""
    random, bank, every = np.random.default_rng(5), begun(engine, seeds), []
    Q, F = process_noise(seeds), np.broadcast_to(TRANSITION, (seeds, 3, STATES, STATES))
    truth = draw(random, np.broadcast_to(P0, (seeds, 3, STATES, STATES)))
    for k in range(frames):
        pushed = np.zeros((seeds, 3, STATES))
        pushed[..., :3] = MODEL.B @ [0.2 * np.sin(k / 5), 0.05, 0.0]
        truth = (F @ truth[..., None])[..., 0] + pushed + draw(random, Q)
        bank.predict((F @ bank.x[..., None])[..., 0] + pushed, F, Q)
        z = (SLOPE * truth).sum(-1) + np.sqrt(R) * random.standard_normal((seeds, 3))
        every.append(bank.update(seen(bank, wrapped(z), random.random((seeds, 3)) >= loss)))
    e = (truth - bank.x)[..., :3]
    return np.einsum("...i,...i", e, np.linalg.solve(bank.P[..., :3, :3], e[..., None])[..., 0]), np.array(every), bank


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
    bank = begun(engine)
    x, P = bank.x.copy(), bank.P.copy()
    nis = bank.update(seen(bank, 1.0, False))
    assert np.isnan(nis).all()
    assert (bank.x == x).all()
    assert (bank.P == P).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_the_gate_leaves_out_two_reports_and_opens_at_the_third(engine):
    bank = begun(engine)
    for _ in range(REJECTED):
        assert (bank.update(seen(bank, 0.5)) > GATE).all()
        assert np.abs(bank.x).max() == 0
    bank.update(seen(bank, 0.5))
    assert np.abs((SLOPE * bank.x).sum(-1) - 0.5).max() < 8e-5  # 8e-6
    assert (bank.update(seen(bank, 0.5)) < GATE).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_single_wild_report_does_nothing(engine):
    bank = begun(engine)
    bank.update(seen(bank, 1.0))
    bank.update(seen(bank, 0.0))
    for _ in range(REJECTED):
        bank.update(seen(bank, -1.0))
    assert np.abs(bank.x).max() == 0


def test_angles_are_unwrapped_around_the_prediction():
    bank = begun("batched", x=4 * np.pi + 3.1)
    bank.update(seen(bank, 3.101))
    assert (SLOPE * bank.x).sum(-1) == pytest.approx(np.full((1, 3), 4 * np.pi + 3.1007), abs=3e-4)
