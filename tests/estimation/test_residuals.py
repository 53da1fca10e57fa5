"""Bad data, beside the definitions: residuals of turned phasors, sets of PMUs that explain them, and the way back."""

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from uneven import uneven_point

from stabctl.estimation._bad_data import CENTERED, CLEAR, LIMIT, PARALLEL, RETURN, SAME, USUAL, PmuCheck, Residuals
from stabctl.estimation._network_model import AMPLIFIED, Computed, NetworkModel
from stabctl.estimation.pmu import Frame, Pmu
from stabctl.estimation.rotor_units import Terminals
from stabctl.model.network import UNSWITCHED
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

ROWS, PMUS, CLOCK, NOISE = 6, 4, 3e-4, 2e-3


def blamed(e, white, G, clock):
    """Sets of one and of two PMUs, best explanations, and the machines in all of them, by inverse matrices."""
    C = np.linalg.inv(white + clock**2 * G @ G.conj().T + 1e-12 * np.eye(len(e)))
    if (e.conj() @ C @ e).real <= LIMIT:
        return {}
    A, b = G.conj().T @ C @ G, G.conj().T @ C @ e

    def explained(*M):
        M = list(M)
        return (b[M].conj() @ np.linalg.inv(A[np.ix_(M, M)]) @ b[M]).real

    def alike(i, j):
        return abs(A[i, j]) ** 2 > PARALLEL * (A[i, i] * A[j, j]).real

    n = G.shape[1]
    T = {(i,): max(explained(j) for j in range(n) if alike(i, j)) for i in range(n)}
    T |= {(i, j): explained(i, j) - LIMIT for i, j in combinations(range(n), 2) if not alike(i, j)}
    best = max(T.values())
    if best <= LIMIT:
        return {}
    sets = [M for M, value in T.items() if value > best - CLEAR]
    M = list(sets[-1])
    a = dict(zip(M, np.linalg.inv(A[np.ix_(M, M)]) @ b[M], strict=True))
    return {c: -np.angle(1 - a[c]) for c in sorted(set.intersection(*map(set, sets)))}


def drawn(rng, *shape):
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def test_those_are_named_that_belong_to_every_good_explanation():
    """One or two turned PMUs, some with nearly parallel columns, some that are hardly seen."""
    rng, counts = np.random.default_rng(4), np.zeros(3, int)
    for _ in range(400):
        G = drawn(rng, ROWS, PMUS)
        if rng.random() < 0.4:
            G[:, 1] = G[:, 0] + rng.uniform(0.05, 0.6) * G[:, 1]
        if rng.random() < 0.2:
            G[:, 3] *= 1e-3
        root = drawn(rng, ROWS, ROWS) * NOISE / 3
        white = root @ root.conj().T + NOISE**2 / 9 * np.eye(ROWS)
        a, bad = np.zeros(PMUS, complex), rng.permutation(PMUS)[: rng.integers(0, 3)]
        a[bad] = 1 - np.exp(-1j * rng.normal(0, rng.choice([0.01, 0.05]), len(bad)))
        e = G @ a + root @ drawn(rng, ROWS) / 2**0.5
        found, wanted = Residuals(np.arange(ROWS), e, white, G).suspects(CLOCK), blamed(e, white, G, CLOCK)
        assert found == pytest.approx(wanted, rel=1e-6, abs=1e-9)
        counts[len(wanted)] += 1
    assert counts.min() > 30


def test_a_residual_is_normal_up_to_the_limit():
    """Of one PMU and one row T is |e|^2 over the variance, clocks included."""
    variance = NOISE**2 + CLOCK**2 * 4
    for share, named in ((0.999, False), (1.001, True)):
        e = np.array([1j * (share * LIMIT * variance) ** 0.5])
        found = Residuals(np.zeros(2, int), e, np.array([[NOISE**2]]), np.array([[2.0 + 0j]])).suspects(CLOCK)
        assert bool(found) is named


def test_the_mean_forgets_exponentially_and_its_variance_is_that_of_a_weighted_sum():
    rng, share, of = np.random.default_rng(5), 0.2, np.arange(3)
    parts = [Residuals(of, drawn(rng, 3), drawn(rng, 3, 3), drawn(rng, 3, 2)) for _ in range(4)]
    mean = None
    for part in parts:
        mean = part.mean(mean, share)
    weights = np.array([0.8**3, 0.2 * 0.8**2, 0.2 * 0.8, 0.2])
    assert mean.e == pytest.approx(sum(w * p.e for w, p in zip(weights, parts, strict=True)))
    assert mean.turns == pytest.approx(sum(w * p.turns for w, p in zip(weights, parts, strict=True)))
    assert mean.white == pytest.approx(sum(w**2 * p.white for w, p in zip(weights, parts, strict=True)))
    other = parts[0]._replace(of=of + 1)
    assert other.mean(mean, share) is other


@pytest.fixture(scope="module")
def phasors():
    point = uneven_point()
    simulation, network = Simulation(setup(point)), NetworkModel(point)
    V, I = Terminals(simulation).phasors(point.V)
    return network, V, I, network.other_currents(point.V, I, simulation.switching)


def test_turned_and_scaled_phasors_leave_exactly_their_column_and_noise_its_covariance(phasors):
    network, V, I, others = phasors
    check, m = PmuCheck(network, Pmu(angle=2e-3, magnitude=3e-3), 50.0, (1, len(V))), len(V)
    known = np.ones(m, bool)
    at, L = network.each_from_the_rest(UNSWITCHED, known)
    assert len(at) == m

    def residuals(factors):
        told = np.r_[V, I, others] * factors
        return check._residuals((at, np.flatnonzero(known)), L, told[:m], told)

    for j in range(m):
        factors, wrong = np.ones(2 * m + len(others), complex), 1.02 * np.exp(0.1j)
        factors[[j, m + j]] = wrong
        found = residuals(factors)
        assert found.e == pytest.approx(found.turns[:, j] * (1 - 1 / wrong), abs=1e-9)
        assert found.of.tolist() == [*range(m), *range(m)]
    found, h = residuals(np.ones(2 * m + len(others))), 1e-6
    slopes = np.array([residuals(1 + h * row).e / h for row in np.eye(2 * m + len(others))]).T
    assert found.white == pytest.approx(3e-3**2 * slopes @ slopes.conj().T, rel=1e-4, abs=1e-12)
    assert check._clock == pytest.approx(2 * np.pi * 50 * 1e-6)
    assert check._share == pytest.approx(1 - np.exp(-1 / (0.5 * 60)))


class Plain:
    """The way back of one PMU that was left out."""

    def __init__(self, rate, noise, clock):
        self.rate, self.noise, self.clock, self.seen = rate, noise, clock, []

    def step(self, own, machines, stuck):
        e = 1 - own.sum()
        v = own[:machines] + own[machines : 2 * machines]
        of_clocks = self.clock**2 * (1 + (np.abs(v) ** 2).sum())
        white = self.noise**2 * (1 + (np.abs(own) ** 2).sum())
        T = abs(e) ** 2 / (white + of_clocks)
        if stuck or T > LIMIT:
            self.seen = []
            return False
        self.seen.append((e, T, white))
        if len(self.seen) < RETURN * self.rate:
            return False
        e, T, white = map(np.array, zip(*self.seen, strict=True))
        self.seen = []
        n = len(e)
        return T.mean() < USUAL and abs(e.mean()) ** 2 < CENTERED * (white.sum() / n**2 + of_clocks)


@pytest.mark.parametrize(
    ("scatter", "offset", "right"), [(1.0, 0.0, 2), (3.2, 0.0, 0), (1.0, 1.5, 0), (1.7, 0.3, 2), (6.0, 0.0, 0)]
)
def test_a_pmu_is_used_again_after_five_normal_seconds(scatter, offset, right):
    """Errors as wide as said or wider, around 0 or beside it; reports of two machines of four, some lost."""
    rng, m, others, pmu = np.random.default_rng(6), 4, 2, Pmu(rate=10, angle=1e-3, magnitude=2e-3, clock=1e-7)
    parts = drawn(rng, 2, 2 * m + others) / 4
    parts[:, [0, 2, 4, 6]] = 0  # of machines 0 and 2, whose reports are not used
    parts /= parts.sum(-1, keepdims=True)
    network = SimpleNamespace()
    check, clock = PmuCheck(network, pmu, 50.0, (1, m)), 2 * np.pi * 50 * 1e-7
    used, left_out = np.array([[False, True, False, True]]), np.array([[True, False, True, False]])
    plain, found, wanted = {0: Plain(10, 2e-3, clock), 2: Plain(10, 2e-3, clock)}, [], []
    sizes = 2e-3 * np.sqrt(1 + (np.abs(parts) ** 2).sum(-1))
    ones, none = np.ones((1, m), complex), np.zeros((1, m))
    for k in range(120):
        e = sizes * (scatter * drawn(rng, 2) / 2**0.5 + offset)
        own, asked = np.ones((m, 2 * m + others), complex), []
        own[[0, 2]] = parts * (1 - e)[:, None]
        check._same[0, 0] = k == 20
        here = np.array([[k % 7 > 0, True, k % 5 > 0, k % 11 > 0]])
        rows = own[~(here & used)[0]]
        given = Computed(rows.sum(-1), 0 * rows.sum(-1), rows, 0 * rows)
        network.computed = lambda *args, given=given, asked=asked, **more: asked.append((args, more)) or given
        frame = Frame(ones, ones, none, none, here, none)
        back = check.recovered(frame, np.zeros((1, others)), [UNSWITCHED], used=used, left_out=left_out)
        assert all(type(one) is int for pair in back for one in pair)
        found += [(k, row) for _, row in back]
        if asked:
            assert asked[0][1]["known"].tolist() == (here & used)[0].tolist()
        for place, row in enumerate((0, 2)):
            if here[0, row] and plain[row].step(parts[place] * (1 - e[place]), m, row == 0 and k == 20):
                wanted.append((k, row))
    assert check._clock == pytest.approx(clock)
    assert found == wanted
    assert (len(found) >= 2) == (right > 0)


def test_repeated_reports_are_told_after_three_and_are_no_part_of_the_mean():
    """A lost report begins the count anew; the same phasors are no wonder of a PMU without noise."""
    m, asked = 3, []
    for noise in (1e-3, 0.0):
        check = PmuCheck(SimpleNamespace(), Pmu(angle=noise, magnitude=noise), 60.0, (1, m))
        check._turned = lambda k, frame, others, **more: asked.append(more) or []
        check._mean[0], asked[:] = "something", []
        for k in range(8):
            V = np.full((1, m), k + 1.0 + 0j)
            V[0, 1] = 7.0 if k > 1 else k
            here = np.array([[True, k != 3, k != 5]])
            frame = Frame(V, V, V.real, V.real, here, V.real)
            found = check(frame, np.zeros((1, 0)), [UNSWITCHED], np.array([[True, True, True]]))
            told = noise > 0 and k >= 3 + SAME
            assert found == ([(0, 1, "it repeats the same phasors")] if told else [])
            if told:
                assert check._mean[0] is None
                continue
            fresh = [True, k != 3 and not (noise and k > 3), k != 5]
            assert asked[-1]["known"].tolist() == fresh
            assert bool(asked[-1]["complete"]) is all(fresh)


def test_no_voltage_is_used_that_amplifies_the_errors_of_reports(phasors):
    network, V, I, others = phasors
    parts = np.full((1, 8 + len(others)), AMPLIFIED / (8 + len(others)) ** 0.5, complex)
    assert len(V) == 4
    for factor, counted in ((0.999, 1), (1.001, 0)):
        check = PmuCheck(SimpleNamespace(), Pmu(), 50.0, (1, 4))
        given = Computed(V[:1], I[:1], factor * parts, parts)
        check.network.computed = lambda *_, given=given, **__: given
        check._noise = 10.0  # nothing is beyond the limit
        left_out = np.array([[True, False, False, False]])
        frame = Frame(V[None], I[None], np.zeros((1, 4)), np.zeros((1, 4)), ~left_out | left_out, np.zeros((1, 4)))
        check.recovered(frame, others[None], [UNSWITCHED], used=~left_out, left_out=left_out)
        assert check._return[0, 0, 0].real == counted
