"""What a turned clock of a PMU does to the states: it moves the input, which acts as it does in the prediction."""

from types import SimpleNamespace

import numpy as np
import pytest

from stabctl.estimation._filter_bank import Seen
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
                old, (new, current) = (
                    state[k, c].copy(),
                    (inputs[n, :, 0, k, c] if here[n][0, k] else (p[k, c], i[k, c])),
                )
                dp, di = new - p[k, c], current - i[k, c]
                moved = np.zeros(5)
                moved[:3] = known.B[k] @ [p[k, c], m * dp, m * m * dp]
                moved[3:] = known.drive[k, :, 0] * i[k, c] + known.ramp[min(m, LONGEST), k] * di
                state[k, c] = F[0, k] @ old + moved
                whole += np.outer(state[k, c], state[k, c]) - np.outer(F[0, k] @ old, F[0, k] @ old)
                p[k, c] = new
            assert added[0, k] == pytest.approx(variance * whole, rel=1e-9, abs=1e-15)
            assert clocks.C[0, k].T == pytest.approx(variance * state[k], rel=1e-9, abs=1e-15)


def test_a_report_counts_as_in_a_filter_that_has_the_clocks_as_states():
    """Such a filter knows their variance and never corrects them: the same innovation, gain and covariance follow."""
    rng, v = np.random.default_rng(12), 3e-6
    clocks, a = Clocks(SimpleNamespace(), v), rng.normal(size=(1, MACHINES, CLOCKS))
    clocks._of_angle = lambda *_: a
    clocks._of_input = lambda *_: (None, np.full(a.shape, 7.0))
    both = rng.normal(0, 1e-3, (MACHINES, 5 + CLOCKS, 30))
    both[:, 5:] *= (v / (both[:, 5:] ** 2).mean(-1))[..., None] ** 0.5
    whole = both @ both.swapaxes(-1, -2) / 30  # of the errors of the states, and of the clocks
    whole[:, 5:, 5:] = v * np.eye(CLOCKS)
    P, clocks.C = whole[None, :, :5, :5], -whole[None, :, :5, 5:].copy()  # the estimate errs the other way
    clocks.C[0, 2] = 0.0
    whole[2, :5, 5:], whole[2, 5:, :5] = 0.0, 0.0
    slope, R = rng.normal(size=(1, MACHINES, 5)), rng.uniform(1e-6, 2e-6, (1, MACHINES))
    none = np.zeros((1, MACHINES))
    seen = clocks.observe(Seen(none, none, slope, R, none == 0), None, None, P)
    gain, S = [], []
    for k in range(MACHINES):
        h = np.r_[slope[0, k], a[0, k]]
        S.append(h @ whole[k] @ h + R[0, k])
        gain.append(whole[k, :5] @ h / S[k])
        assert seen.slope[0, k] @ P[0, k] @ seen.slope[0, k] + seen.variance[0, k] == pytest.approx(S[k], rel=1e-8)
        assert P[0, k] @ seen.slope[0, k] / S[k] == pytest.approx(gain[k], rel=1e-7)
    before, i = clocks.C.copy(), np.zeros(a.shape)
    clocks._i = i.copy()
    received, computed = np.array([[True, True, False]]), np.array([[True, False, True]])
    frame = SimpleNamespace(received=received, parts=SimpleNamespace(computed=computed))
    clocks.settle(np.array(gain)[None] * received[..., None], SimpleNamespace(frame=frame), None)
    h, K = np.r_[slope[0, 0], a[0, 0]], np.r_[gain[0], np.zeros(CLOCKS)]
    left = (np.eye(5 + CLOCKS) - np.outer(K, h)) @ whole[0]
    assert -clocks.C[0, 0] == pytest.approx(left[:5, 5:], rel=1e-9, abs=1e-16)
    assert not clocks.C[0, 1].any()  # a report of its own: nothing is shared with a clock any more
    assert np.array_equal(clocks.C[0, 2], before[0, 2])
    assert np.array_equal(clocks._i[0, :, 0], [7.0, 7.0, 0.0])


def test_a_turned_clock_moves_angle_power_and_current_by_their_slopes():
    """Voltage and current of a machine have one clock, other reports their own; phasors are sums of what they turn."""
    rng, m, others, h = np.random.default_rng(13), MACHINES, 2, 1e-6
    mva = np.array([2.3, 0.7, 1.4])
    known = SimpleNamespace(impedance=np.array([0.01 + 0.2j, 0.3j, 0.002 + 0.15j]), mva=mva)

    def phasors(*shape):
        return rng.normal(size=shape) + 1j * rng.normal(size=shape)

    parts = SimpleNamespace(V=phasors(1, m, 2 * m + others) / 5, I=phasors(1, m, 2 * m + others) / 5)
    V, I = phasors(1, m) + 2, phasors(1, m)  # I of the system base
    delta, psi = rng.normal(size=(1, m)), rng.uniform(0.1, 0.4, (1, m))

    def said(clock, turned):
        r = [clock, m + clock] if clock < m else [m + clock]
        v, i = ((x + (np.exp(1j * turned) - 1) * part[..., r].sum(-1)) for x, part in ((V, parts.V), (I, parts.I)))
        E = v + known.impedance * i
        ahead = np.angle(E) - np.arcsin(psi / np.abs(E))
        return np.stack([ahead, (v * i.conj()).real / mva, (i / mva * np.exp(-1j * delta)).real])

    E = V + known.impedance * I
    seen = SimpleNamespace(V=V, I=I / mva, E=E, frame=SimpleNamespace(parts=parts))
    clocks, turn = Clocks(known, 1.0), np.arcsin(psi / np.abs(E))
    found = clocks._of_angle(seen, turn), *clocks._of_input(seen, delta)
    for clock in range(m + others):
        slopes = (said(clock, h) - said(clock, -h)) / (2 * h)
        for one, slope in zip(found, slopes, strict=True):
            assert one[..., clock] == pytest.approx(slope, rel=1e-6, abs=1e-8)
