"""Modes of a band from the sparse descriptor: all of them, and the very ones that the dense matrix has."""

import numpy as np
import pytest
from systems import KINDS, small

from stabctl import io
from stabctl._util.errors import StudyError
from stabctl.dynamics import operating_point
from stabctl.model.replicate import replicate
from stabctl.smallsignal import Selected, analyze, areas, descriptor, linearize, modal
from stabctl.smallsignal._band_search import Box


@pytest.fixture(scope="module")
def sparse(point):
    """Electromechanical modes of wnaps, and some signals."""
    return analyze(descriptor(point("wnaps"), ["storage:33"], ["speed:14", "voltage:33"]), (0.1, 2.5))


def matched(few, every, band, damping):
    """Places among all modes of those in a band; asserts that they are as many as the few."""
    inside = [k for k in every.within(*band) if damping[0] <= every.damping_ratio[k] <= damping[1]]
    assert len(few) == len(inside)
    return [inside[int(np.abs(every.eigenvalues[inside] - s).argmin())] for s in few.eigenvalues]


@pytest.mark.slow
def test_every_electromechanical_mode_is_found(sparse, modes):
    every = modes("wnaps")
    places = matched(sparse, every, sparse.band, sparse.damping)
    assert len(set(places)) == len(sparse)
    assert set(every.swings()) <= set(places)
    assert np.abs(sparse.eigenvalues - every.eigenvalues[places]).max() < 1e-9  # 6e-14
    assert np.array_equal(sparse.electromechanical, every.electromechanical[places])
    assert np.abs(sparse.participation - every.participation[:, places]).max() < 1e-8  # 1e-13
    assert [sparse.label(k) for k in range(len(sparse))] == [every.label(k) for k in places]


def test_both_sets_of_vectors_belong_together(sparse, modes):
    A = modes("wnaps").linear.A
    V, W, s = sparse.right, sparse.left, sparse.eigenvalues
    assert np.abs(W.conj().T @ V - np.eye(len(s))).max() < 1e-8  # 1e-13, over all shifts
    for vectors, miss in ((V, A @ V - V * s), (W, A.T @ W - W * s.conj())):
        assert (np.linalg.norm(miss, axis=0) / np.linalg.norm(vectors, axis=0)).max() < 1e-8  # 7e-13


def test_residues_are_those_of_all_modes(sparse, point):
    every = analyze(linearize(point("wnaps"), ["storage:33"], ["speed:14", "voltage:33"]))
    places = matched(sparse, every, sparse.band, sparse.damping)
    for output in range(2):
        left = sparse.observability()[output] * sparse.controllability()[:, 0]
        assert np.abs(left - every.residues(output, 0)[places]).max() < 1e-9 * np.abs(left).max()  # 1e-13


@pytest.mark.parametrize("name", ["two_area", "two_area_manual", "two_area_pss", "two_area_thyristor", "ieee39"])
def test_small_systems_too(modes, point, name):
    few, every = analyze(descriptor(point(name)), (0.05, 4), (-0.2, 0.6)), modes(name)
    places = matched(few, every, few.band, few.damping)
    assert len(set(places)) == len(few) >= 3
    assert np.abs(few.eigenvalues - every.eigenvalues[places]).max() < 1e-8
    assert len(analyze(descriptor(point(name)), (20, 25))) == 0


@pytest.mark.slow
def test_three_copies_have_three_of_each(sparse):
    """Copies tied at one bus: the modes of local swings nearly coincide, and none of them is lost."""
    point = operating_point.solve(replicate(io.load("wnaps"), 3))
    few = analyze(descriptor(point), (0.25, 0.6), (-0.1, 0.2))
    every = analyze(linearize(point))
    places = matched(few, every, few.band, few.damping)
    assert len(set(places)) == len(few) > 5
    assert np.abs(few.eigenvalues - every.eigenvalues[places]).max() < 1e-9  # 8e-14


def test_large_systems_are_given_modes_of_a_band(point, monkeypatch):
    d = descriptor(point("ieee39"))
    assert not isinstance(analyze(d), Selected)
    monkeypatch.setattr("stabctl.smallsignal.analysis.LARGE", 100)
    found = analyze(d)
    assert isinstance(found, Selected)
    assert found.band == (0.1, 2.5)
    assert str(found).startswith("ieee39, 140 states, only modes from 0.1 to 2.5 Hz with damping ratios ")
    assert areas(found, 3).groups == areas(analyze(linearize(point("ieee39"))), 3).groups


def test_what_is_not_possible_is_said(point, sparse):
    d = descriptor(point("two_area"))
    for band in ((0, 1), (2, 1), (1, np.inf)):
        with pytest.raises(StudyError, match="band"):
            analyze(d, band)
    with pytest.raises(StudyError, match="damping ratios"):
        analyze(d, (0.1, 1), (0.3, 0.2))
    with pytest.raises(StudyError, match="needs all its modes"):
        modal(sparse, [0])
    with pytest.raises(StudyError, match="descriptor"):
        analyze(linearize(point("two_area")), (0.1, 1))


def test_halves_of_a_box_make_the_box():
    box, s = Box(-2.0, 1.0, 1.0, 2.0), np.random.default_rng(0).uniform(-3, 3, (500, 2)) @ [1, 1j]
    a, b = box.halves()
    assert np.array_equal(a.holds(s) ^ b.holds(s), box.holds(s))
    assert not (a.holds(s) & b.holds(s)).any()
    assert box.fitted(-0.5, 0.1) == Box(-1.0, 0.2, 1.0, 2.0)
    assert box.fitted(1.0, 2.0) is None


def test_set_points_of_a_machine_without_controls_are_inputs_and_outputs():
    model = operating_point.solve(small(KINDS["bare"])).linearize(inputs="power:1,field:1", outputs="pm:1,efd:1")
    assert model.D.tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert not model.C.any()


def test_a_converter_has_outputs_and_no_speed():
    point = operating_point.solve(small(KINDS["converter"]))
    assert point.linearize(outputs="pe:1,qe:1,vt:1").C.shape[0] == 3
    assert point.linearize(outputs="speed").C.shape[0] == 1
    with pytest.raises(StudyError, match="without a rotor"):
        point.linearize(outputs="speed:1")


def test_a_swing_that_grows_fast_is_found(cases):
    """With the wrong sign of all stabilizers the damping ratios are -0.36, -0.35 and -0.27."""
    case = cases("two_area").set({f"pss.{k}.K": -20.0 for k in (1, 2, 3, 4)})
    every, found = case.modes(), case.modes(sparse=True)
    inside = [k for k in every.within(0.1, 2.5) if -0.5 < every.damping_ratio[k] < 0.3]
    assert sorted(every.damping_ratio[inside]) == pytest.approx([-0.363, -0.345, -0.274], abs=5e-4)
    assert np.sort(every.eigenvalues[inside]) == pytest.approx(np.sort(found.eigenvalues), rel=1e-9)
    assert not found.stable
    assert (every.references, found.references) == (1, 0)  # the band begins above 0 Hz
