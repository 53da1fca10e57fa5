"""A sampled controller with everything at once, frame by frame: states, delay, ramp, limits, deadband, relay, gate."""

import numpy as np
import pytest

from stabctl.dynamics.family import FRAME, OUTPUT
from stabctl.simulation import frame

N, M, P = 2, 3, 2
RELAY, LINEAR = (-0.4, 0.7, 0.3, 1.0), (-0.6, 0.5, 0.05, 0.0)  # low, high, deadband, relay


def shaped(u, levels):
    low, high, dead, relay = levels
    if relay:
        return high if u > dead else low if u < -dead else 0.0
    return float(np.clip(np.sign(u) * max(abs(u) - dead, 0.0), low, high))


class Plain:
    """With a closed gate, or the unit off, nothing is read and nothing goes out; what is on its way goes on."""

    def __init__(self, matrices, rest, levels, L, delay, reach):
        self.matrices, self.rest, self.levels, self.L, self.reach = matrices, rest, levels, L, reach
        self.x, self.line, self.held = np.zeros(N), [np.zeros(P)] * delay, np.zeros(P)

    def frame(self, y, acts, off):
        A, B, C, D = self.matrices
        dy = np.where(off, 0.0, y - self.rest)
        u, x = (C @ self.x + D @ dy, A @ self.x + B @ dy) if acts else (np.zeros(P), np.zeros(N))
        self.line.append(u)
        u = self.line.pop(0)
        out = np.array([shaped(one, self.levels) for one in u])
        if self.reach:
            out = np.clip(out, self.held - self.reach, self.held + self.reach)
        self.held, self.x = out, x + self.L @ (out - u)


@pytest.mark.parametrize("levels", [LINEAR, RELAY])
@pytest.mark.parametrize(("delay", "reach"), [(0, 0.0), (1, 0.2), (3, 0.0), (3, 0.15), (0, 0.1)])
def test_every_option_beside_every_other(levels, delay, reach):
    rng = np.random.default_rng(delay)
    matrices = [rng.normal(0, 0.5, shape) for shape in ((N, N), (N, M), (P, N), (P, M))]
    matrices[3][0, 1] = 0.0
    rest, L = rng.normal(size=M), rng.normal(0, 0.2, (N, P))
    units = np.array([-1, 0, 1])
    k = np.concatenate(
        [[N, M, P], *(one.ravel() for one in matrices), rest, units, levels, L.ravel(), [delay, reach, 0]]
    )
    inputs, added, gates, outputs, memory = np.split(np.arange(M + P + 2 + P + 40), np.cumsum([M, P, 2, P]))
    w = np.concatenate([[0, 0, 0, 2], inputs, added, gates, [memory[0], outputs[0]]])
    s, plain = np.zeros(M + P + 2 + P + 40), Plain(matrices, rest, levels, L, delay, reach)
    acted = []
    for _ in range(80):
        y, extra, on = rng.normal(size=M), rng.normal(size=P), np.where(rng.random(3) < 0.9, 0, -1)
        gate = (rng.random(2) < 0.85).astype(float)
        s[inputs], s[added], s[gates] = y, extra, gate
        acts = bool(gate.all() and on[2] >= 0)
        off = (units >= 0) & (on[units] < 0)
        frame.family(FRAME, 1, w, k, s, np.zeros(1), on)
        plain.frame(y, acts, off)
        frame.family(OUTPUT, 1, w, k, s, np.zeros(1), on)
        assert s[outputs] == pytest.approx(extra + acts * plain.held, abs=1e-12)
        assert s[memory[:N]] == pytest.approx(plain.x, abs=1e-12)
        assert (s[inputs] == y).all()
        acted.append(acts)
    assert 0.3 < np.mean(acted) < 0.9
    assert not s[memory[2 * N + P * (delay + 2) :]].any()
