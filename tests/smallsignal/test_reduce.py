"""Reduced models keep labels, the modes of interest, and the transfer function where it matters."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sl
from mixed import second

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.smallsignal import analyze, balanced, linearize, modal
from stabctl.smallsignal.eigen import eigen
from stabctl.smallsignal.modes import Modes


@pytest.fixture(scope="module")
def whole(point):
    return analyze(linearize(point("wnaps"), ["storage:33", "storage:31"], ["speed:14", "speed:13", "rest_speed:14"]))


def _response(model, s):
    return model.C @ np.linalg.solve(s * np.eye(len(model.A)) - model.A, model.B) + model.D


def test_modal_truncation_keeps_its_modes(whole):
    keep = [0, *whole.swings()[:6]]
    small = modal(whole, keep)
    assert len(small.states) == 13
    assert (small.inputs, small.outputs) == (whole.linear.inputs, whole.linear.outputs)
    assert small.states[1] == "machine 34 against the rest, 0.207 Hz, cosine"
    found = np.sort_complex(np.linalg.eigvals(small.A))
    wanted = np.r_[whole.eigenvalues[keep], whole.eigenvalues[whole.swings()[:6]].conj()]
    assert np.abs(found - np.sort_complex(wanted)).max() < 1e-8  # 4e-14
    assert small.to_control().nstates == 13


def test_all_modes_give_the_whole_model(whole):
    same = modal(whole, range(len(whole)))
    s = 3j
    full = _response(whole.linear, s)
    assert np.abs(_response(same, s) - full).max() < 1e-9 * np.abs(full).max()  # 2e-13


@pytest.mark.slow
def test_balanced_reduction_meets_its_bound(whole):
    small = balanced(whole, 30)
    assert len(small.states) == 30
    bound = 2 * small.hankel[29:].sum()
    worst = 0.0
    for f in np.geomspace(1e-3, 10, 60):
        s = 2j * np.pi * f
        worst = max(worst, np.linalg.norm(_response(small, s) - _response(whole.linear, s), 2))
    assert worst <= bound  # 4e-7 against 2e-6
    peak = max(np.linalg.norm(_response(whole.linear, 2j * np.pi * f), 2) for f in np.geomspace(0.1, 2, 60))
    assert worst < 1e-3 * peak  # 1.2e-4


@pytest.mark.parametrize("order", [4, 6, 9])
def test_repeated_eigenvalues_leave_the_bound(order):
    """Lags and filters of the storage devices have the same eigenvalue, whose vectors rounding decides."""
    point = second().initialize()
    inputs = ["order", *dict.fromkeys(f"storage:{m.storage_bus}" for m in point.case.machines)]
    full = analyze(linearize(point, inputs, "deviation, flow:2-5"))
    assert (np.abs(full.eigenvalues[:, None] - full.eigenvalues) < 1e-6).sum() > len(full)
    small = balanced(full, order)
    at = 2j * np.pi * np.geomspace(1e-3, 30, 60)
    highest = max(np.linalg.norm(_response(full.linear, s), 2) for s in at)
    assert small.hankel[0] < highest  # 0.16 of it
    worst = max(np.linalg.norm(_response(small, s) - _response(full.linear, s), 2) for s in at)
    assert worst < 2 * small.hankel[order - 1 :].sum()  # 0.24 to 0.53 of it


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_eigenvalues_that_repeat_in_any_way(whole, seed):
    """Several groups, some of them in Jordan blocks, real and complex, beside others; singular values by SciPy."""
    rng = np.random.default_rng(seed)
    n, blocks = len(whole.linear.states), []
    while sum(map(len, blocks)) < n:
        one = np.array([[-rng.uniform(0.5, 50.0)]])
        if rng.random() < 0.5:
            w = rng.uniform(0.5, 20.0)
            one = np.array([[one[0, 0] / 10, w], [-w, one[0, 0] / 10]])
        times, chained = rng.integers(1, 4), rng.random() < 0.3
        blocks.append(np.kron(np.eye(times), one) + chained * np.kron(np.eye(times, k=1), np.eye(len(one))))
    A = sl.block_diag(*blocks)[:n, :n]
    turn, B, C = sl.qr(rng.normal(size=(n, n)))[0], rng.normal(size=(n, 3)), rng.normal(size=(2, n))
    names = {"inputs": ("a", "b", "c"), "outputs": ("d", "e")}
    linear = replace(whole.linear, A=turn @ A @ turn.T, B=turn @ B, C=C @ turn.T, D=np.zeros((2, 3)), **names)
    small = balanced(Modes(linear, *eigen(linear.A, np.zeros((n, 0)))), 10)
    reach, seen = (sl.solve_continuous_lyapunov(M, -K @ K.T) for M, K in ((A, B), (A.T, C.T)))
    found = np.sqrt(np.sort(np.linalg.eigvals(reach @ seen).real)[::-1][:10])
    assert np.abs(small.hankel[:10] / found - 1).max() < 1e-9  # 4e-12
    at = 2j * np.pi * np.geomspace(1e-3, 30, 60)
    worst = max(np.linalg.norm(_response(small, s) - _response(linear, s), 2) for s in at)
    assert worst < 2 * small.hankel[10:].sum()


@pytest.mark.slow
def test_hankel_singular_values_are_those_of_scipys_gramians(whole):
    """Of the model without its angle reference, from Lyapunov equations solved by SciPy."""
    rest = modal(whole, np.flatnonzero(np.abs(whole.eigenvalues) > 1e-6), static=False)
    reach, seen = (sl.solve_continuous_lyapunov(A, -B @ B.T) for A, B in ((rest.A, rest.B), (rest.A.T, rest.C.T)))
    found = np.sqrt(np.sort(np.abs(np.linalg.eigvals(reach @ seen)))[::-1])
    hankel = balanced(whole, 30).hankel[:20]
    assert np.abs(hankel / found[:20] - 1).max() < 1e-7  # 2e-9


def test_balanced_keeps_the_zero(whole):
    small = balanced(whole, 10)
    assert small.states[0] == "angle reference (rotating all angles together changes nothing)"
    assert np.abs(np.linalg.eigvals(small.A)).min() < 1e-9


def test_impossible_orders_are_refused(whole, modes):
    with pytest.raises(StudyError, match="cannot be reduced to 1 state"):
        balanced(whole, 1)
    with pytest.raises(StudyError, match="inputs and outputs"):
        balanced(modes("two_area"), 10)
    with pytest.raises(StudyError, match="at least one mode"):
        modal(whole, [])
    with pytest.raises(StudyError, match="at least one mode"):
        modal(whole, [1.5])
    with pytest.raises(StudyError, match="at least one mode"):
        modal(whole, 1.5)


def test_undamped_modes_are_kept_whole(cases):
    """Rounding decided which of them were kept: the response was wrong by 96 %."""
    base = cases("ieee39").classical().initialize(storage="5%mva")
    model = linearize(base, "order", "deviation")
    small, whole = model.reduce(20).response([0.7]), model.response([0.7])
    assert np.abs(small - whole).max() < 1e-9 * np.abs(whole).max()  # 2e-13
    with pytest.raises(StudyError, match="undamped or zero modes must be kept; choose an order from 20 to 20"):
        model.reduce(10)


@pytest.mark.parametrize("options", [{"rate": 50}, {"delay": "20ms"}])
def test_loops_with_frames_or_delays_are_not_reduced(cases, options):
    base = cases("two_area").initialize(storage="50MW")
    law = st.Controller("deviation:1", "order:1@5", [], [], [], [[10.0]], **options)
    loop = base.closed_loop(law, inputs="order", outputs="deviation")
    modes = loop.modes()
    for call in (lambda: balanced(modes, 5), lambda: modal(modes, [3]), lambda: loop.reduce(5)):
        with pytest.raises(StudyError, match="has sampled or delayed controllers"):
            call()
