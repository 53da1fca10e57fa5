"""Ranked pairs of signals and inputs: residues of the linear model, weighed."""

import json

import numpy as np
import pytest
from labels import crowded

from stabctl._util.errors import StudyError
from stabctl.design import pairs, pod


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area_thyristor").initialize(storage="50MW")


@pytest.fixture(scope="module")
def ranked(base):
    return pairs(base)


def test_the_residues_are_the_derivatives_of_the_eigenvalue(base, ranked):
    """Against the closed loop with a small gain; the device's own lag and the network are part of it."""
    import control

    import stabctl as st

    i, j = ranked.inputs.index("deviation:1"), ranked.outputs.index("order:3@11")
    gain = 1e-3
    one = st.Controller.from_control(control.tf([gain], [1]), "deviation:1", "order:3@11")
    before, after = (base.closed_loop(*c).modes() for c in ((), (one,)))
    s = [m.eigenvalues[min(m.swings(), key=lambda k: abs(m.frequency_hz[k] - 0.608))] for m in (before, after)]
    assert (s[1] - s[0]) / gain == pytest.approx(ranked.residues[i, j], rel=1e-3)


def test_scores_do_not_depend_on_units_and_follow_the_weights(base, ranked):
    """A signal of two parallel circuits is the same; halving an availability or a range halves the score."""
    a, b = (ranked.inputs.index(name) for name in ("flow:7-8", "flow:7-8#2"))
    assert ranked.scores[a] == pytest.approx(ranked.scores[b], rel=1e-6)
    halved = pairs(base, availability={"flow": 0.5, "order:3@11": 0.8}, ranges={"order:3@11": 0.5})
    j = halved.outputs.index("order:3@11")
    assert halved.scores[a, j] == pytest.approx(ranked.scores[a, j] / 5)
    assert halved.weights[a] == pytest.approx([0.4 if k == j else 0.5 for k in range(len(halved.outputs))])
    assert halved.scores[ranked.inputs.index("deviation:1"), 0] == pytest.approx(
        ranked.scores[ranked.inputs.index("deviation:1"), 0]
    )


def test_the_score_is_the_documented_one_whatever_the_scale_of_the_eigenvectors(base, ranked):
    modes = base.closed_loop(inputs=ranked.outputs, outputs=ranked.inputs).modes()
    swings = modes.swings()
    seen = modes.observability()[:, swings] / np.abs(modes.speeds[:, swings]).max(axis=0)
    a = np.sqrt((np.abs(seen) ** 2).sum(axis=1))
    assert ranked.scores == pytest.approx(np.abs(ranked.residues) / a[:, None], abs=1e-11)


def test_a_late_signal_counts_by_what_of_it_damps(base, ranked):
    late = pairs(base, delay="100ms")
    assert late.scores == pytest.approx(ranked.scores * np.cos(2 * np.pi * late.mode_hz * 0.1))
    assert pairs(base, delay={"deviation": "0.5s"}).scores.min() == 0.0  # more than a quarter of a period


def test_the_best_pair_is_taken(base, ranked):
    assert (ranked.df.input[0], ranked.df.output[0]) == ranked.best
    found = pod(base, rate=60, delay="100ms")
    assert (*found.controller.inputs, *found.controller.outputs) == ranked.best
    assert pod(base, "deviation:1").controller.outputs == pairs(base, "deviation:1").best[1:]


def test_the_figure_shows_the_best_first(ranked):
    ax = ranked.plot()
    assert ax.get_yticklabels()[0].get_text() == " to ".join(ranked.best)
    assert ax.containers[0][0].get_width() == ranked.scores.max()
    assert crowded(ax) == []


def test_the_command_ranks(stabctl):
    code, text, _ = stabctl("design", "pod", "two_area_thyristor", "--storage", "50MW", "--rank", "--json")
    found = json.loads(text)
    assert code == 0
    assert found["mode_hz"] == pytest.approx(0.608, abs=1e-3)
    assert found["pairs"][0]["score"] >= found["pairs"][1]["score"]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"mode": 5.0}, "no electromechanical mode near 5 Hz"),
        ({"availability": {"flow": -1}}, "flow = -1 is not allowed"),
        ({"availability": {"flwo": 0.9}}, "availability names 'flwo', which is not among the signals; did you mean"),
        ({"delay": {"flwo": "0.1s"}}, "delay names 'flwo', which is not among the signals; did you mean flow"),
        ({"delay": {"order": "0.1s"}}, "delay names 'order'"),
        ({"ranges": {"deviation:1": 0.9}}, "ranges names 'deviation:1'"),
        ({"inputs": "speeds"}, "is not an output"),
    ],
)
def test_mistakes(base, given, says):
    with pytest.raises(StudyError, match=says):
        pairs(base, **given)


def test_without_any_score_there_is_no_best_pair(base):
    for call in (lambda: pairs(base, delay="500ms").best, lambda: pod(base, delay="500ms")):
        with pytest.raises(StudyError, match=r"No pair has a score above 0 for the mode at 0\.608 Hz"):
            call()
