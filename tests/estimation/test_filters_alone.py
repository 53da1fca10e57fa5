"""Both engines of the filters beside the equations, report by report: gate, doubts, gains, and the opening at last."""

import numpy as np
import pytest

from stabctl.estimation._filter_bank import ENGINES, GATE, Seen

SEEDS, MACHINES, N, ALLOWED = 2, 3, 5, 2


class Plain:
    def __init__(self, x, P, reset):
        self.x, self.P, self.reset, self.rejected, self.doubt = x.copy(), P.copy(), reset, 0, 0.0

    def predict(self, x, F, Q):
        self.x, self.P = x, F @ self.P @ F.T + Q

    def update(self, z, expected, h, R, received):
        """NIS, variance of the innovation and gain."""
        if not received:
            self.rejected = min(self.rejected + 1, ALLOWED)
            return np.nan, np.nan, np.zeros(N)
        y = (z - expected + np.pi) % (2 * np.pi) - np.pi
        S = h @ self.P @ h + R
        nis = y * y / S
        if nis > GATE:
            if self.rejected < ALLOWED:
                self.rejected, self.doubt = self.rejected + 1, y * y
                return nis, S, np.zeros(N)
            self.P = self.P + np.diag(y * y * self.reset)
            S = h @ self.P @ h + R
        self.rejected, self.doubt = 0, 0.0
        K = self.P @ h / S
        self.x = self.x + K * y
        left = np.eye(N) - np.outer(K, h)
        self.P = left @ self.P @ left.T + R * np.outer(K, K)
        return nis, S, K


@pytest.mark.parametrize("engine", ENGINES)
def test_a_bank_is_its_filters(engine):
    rng = np.random.default_rng(6)
    root = rng.normal(size=(SEEDS, MACHINES, N, N)) * 1e-2
    x, P = rng.normal(size=(SEEDS, MACHINES, N)), root @ root.swapaxes(-1, -2)
    reset = rng.uniform(0.1, 1.0, (MACHINES, N))
    bank = ENGINES[engine](x, P, reset, ALLOWED)
    at = list(np.ndindex(SEEDS, MACHINES))
    plain = {a: Plain(x[a], P[a], reset[a[1]]) for a in at}
    counts = np.zeros(4, int)
    for k in range(60):
        x = bank.x + rng.normal(0, 1e-2, bank.x.shape)
        F = np.eye(N) + rng.normal(0, 0.03, (SEEDS, MACHINES, N, N))
        root = rng.normal(size=(SEEDS, MACHINES, N, N)) * 3e-3
        Q = root @ root.swapaxes(-1, -2)
        bank.predict(x, F, Q)
        h = rng.normal(size=(SEEDS, MACHINES, N))
        expected = (h * x).sum(-1)
        wild = rng.choice([1e-2, 0.6], (SEEDS, MACHINES), p=[0.6, 0.4])
        z = expected + rng.normal(0, wild) + 2 * np.pi * rng.integers(-1, 2, (SEEDS, MACHINES))
        R, here = rng.uniform(1e-5, 1e-4, (SEEDS, MACHINES)), rng.random((SEEDS, MACHINES)) < 0.8
        nis = bank.update(Seen(z, expected, h, R, here))
        for a in at:
            one, before = plain[a], plain[a].rejected
            one.predict(x[a], F[a], Q[a])
            wanted, S, K = one.update(z[a], expected[a], h[a], R[a], here[a])
            assert nis[a] == pytest.approx(wanted, rel=1e-6, nan_ok=True)
            assert bank.gain[a] == pytest.approx(K, rel=1e-6, abs=1e-12)
            assert bank.doubt[a] == pytest.approx(one.doubt, rel=1e-9)
            assert bank.x[a] == pytest.approx(one.x, rel=1e-8)
            assert bank.P[a] == pytest.approx(one.P, rel=1e-6, abs=1e-11)
            if engine == "batched" and here[a]:
                assert bank.S[a] == pytest.approx(S, rel=1e-6)
            opened = here[a] and wanted > GATE and not one.doubt
            counts += not here[a], one.doubt > 0, opened, before == ALLOWED
        if k == 30:
            bank.restart(bank.x + 0.5, 2 * bank.P)
            for a in at:
                plain[a].x, plain[a].P = plain[a].x + 0.5, 2 * plain[a].P
    assert counts.min() > 5
