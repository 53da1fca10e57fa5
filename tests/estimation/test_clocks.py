"""What a turned clock of a PMU does to the states: it moves the input, which acts as it does in the prediction."""

from types import SimpleNamespace

import numpy as np
import pytest

from stabctl.estimation.estimators import Clocks

MACHINES, CLOCKS, LONGEST = 3, 2, 4


def test_clocks_act_as_the_power_and_the_current_that_they_turn():
    """B of power, its change over all frames and that times the frames; drive of the current, ramp of its change."""
    rng = np.random.default_rng(11)
    known = SimpleNamespace(
        B=rng.normal(size=(MACHINES, 3, 3)), drive=rng.normal(size=(MACHINES, 2, 2)),
        ramp=rng.normal(size=(LONGEST + 1, MACHINES, 2)),
    )  # fmt: skip
    clocks, variance = Clocks(known, 3e-6), 3e-6
    inputs = rng.normal(size=(4, 2, 1, MACHINES, CLOCKS))  # p and i at four frames
    clocks._of_angle = lambda *_: angles
    angles = rng.normal(size=(1, MACHINES, CLOCKS))
    here = [np.ones((1, MACHINES), bool), *(rng.random((3, 1, MACHINES)) < 0.6)]
    missing = np.array([[0, 2, 7]])
    frames = [SimpleNamespace(frame=SimpleNamespace(received=h)) for h in here]
    clocks._of_input = lambda *_: inputs[0]
    added = clocks.begin(frames[0], None, None, np.ones((1, MACHINES), bool))
    state = np.zeros((MACHINES, CLOCKS, 5))  # moved by each clock, per rad
    state[..., 0], state[..., 2] = angles[0], inputs[0, 0, 0]
    assert added[0] == pytest.approx(variance * np.einsum("mca,mcb->mab", state, state))
    (p, i), F = inputs[0][:, 0], rng.normal(size=(1, MACHINES, 5, 5))
    for n in (1, 2, 3):
        clocks._of_input = lambda *_, n=n: inputs[n]
        added = clocks.predict(F, frames[n], None, SimpleNamespace(missing=missing))
        for k in range(MACHINES):
            m, whole = missing[0, k] + 1, np.zeros((5, 5))
            for c in range(CLOCKS):
                old, (new, current) = state[k, c].copy(), (inputs[n, :, 0, k, c] if here[n][0, k] else (p[k, c], i[k, c]))
                dp, di = new - p[k, c], current - i[k, c]
                moved = np.zeros(5)
                moved[:3] = known.B[k] @ [p[k, c], m * dp, m * m * dp]
                moved[3:] = known.drive[k, :, 0] * i[k, c] + known.ramp[min(m, LONGEST), k] * di
                state[k, c] = F[0, k] @ old + moved
                whole += np.outer(state[k, c], state[k, c]) - np.outer(F[0, k] @ old, F[0, k] @ old)
                p[k, c] = new
            assert added[0, k] == pytest.approx(variance * whole, rel=1e-9, abs=1e-15)
            assert clocks.C[0, k].T == pytest.approx(variance * state[k], rel=1e-9, abs=1e-15)
