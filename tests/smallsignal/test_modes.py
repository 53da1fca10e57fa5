"""Modes: both sets of vectors, participation, residues, names."""

import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.dynamics import operating_point
from stabctl.smallsignal import analyze, linearize
from stabctl.smallsignal.eigen import eigen

CASES = ["two_area", "two_area_manual", "two_area_pss", "ieee39", "wnaps"]


@pytest.mark.parametrize("name", CASES)
def test_both_sets_of_vectors_belong_together(modes, name):
    m = modes(name)
    n = len(m)
    assert np.abs(m.left.conj().T @ m.right - np.eye(n)).max() < 1e-8  # wnaps 2.6e-10
    proper = m.eigenvalues != 0
    V, s = m.right[:, proper], m.eigenvalues[proper]
    miss = np.linalg.norm(m.linear.A @ V - V * s, axis=0) / np.linalg.norm(V, axis=0)
    assert miss.max() < 1e-8  # 7e-10 (ieee39)
    pairs = m.eigenvalues[m.eigenvalues.imag > 0]
    assert np.array_equal(m.eigenvalues[m.eigenvalues.imag < 0], pairs.conj())


@pytest.mark.parametrize("name", CASES)
def test_participation_sums_to_one(modes, name):
    m = modes(name)
    assert np.abs(m.participation.sum(axis=0) - 1).max() < 1e-8  # over the states 6e-15
    assert np.abs(m.participation.sum(axis=1) - 1).max() < 1e-8  # over the modes 2e-13
    assert m.shares.sum(axis=0) == pytest.approx(1)


def test_participation_of_the_reference(modes, reference):
    """Share of angles and speeds in every listed mode."""
    for name in ("two_area", "wnaps"):
        m = modes(name)
        rotor = np.r_[m.linear.angles(), m.linear.speeds()]
        for row in reference(name, "participation"):
            s = complex(row["real_1_per_s"], row["imag_rad_per_s"])
            k = int(np.abs(m.eigenvalues - s).argmin())
            listed = row["angles_and_speeds"]
            assert m.shares[rotor, k].sum() == pytest.approx(listed, abs=1e-4), row  # 5e-5, rounding of the list


@pytest.mark.parametrize("name", CASES)
def test_there_is_a_swing_less_than_machines(modes, name):
    m = modes(name)
    assert len(m.swings()) == len(m.linear.point.case.machines) - 1


def test_swings_are_named_by_who_swings_against_whom(modes):
    labels = [modes("two_area").label(k) for k in modes("two_area").swings()]
    assert labels == ["1, 2 against 3, 4", "1 against 2", "3 against 4"]
    wnaps = modes("wnaps")
    assert wnaps.label(wnaps.swings()[0]) == "machine 34 against the rest"


def test_zeros_are_explained(modes, point):
    def zeros(m):
        return [m.label(k) for k in range(len(m)) if m.eigenvalues[k] == 0]

    assert zeros(modes("two_area")) == ["angle reference (rotating all angles together changes nothing)"]
    assert len(zeros(modes("ieee39"))) == 1
    case = point("ieee39").case
    q = {f"genrou.3.{name}": case.devices["genrou"][2].xq for name in ("x1q", "xq")}
    absent = zeros(case.set({"genrou.3.T1q": 0.0, **q}).modes())
    assert absent[1] == "constant state rotor flux q GENROU 3 (its circuit is open, or limits hold it)"
    classical = analyze(linearize(operating_point.solve(point("two_area").case.classical())))
    assert zeros(classical)[1].startswith("frequency reference (no governor or damping restores")
    assert classical.stable
    assert not modes("two_area_thyristor").stable


@pytest.mark.parametrize("name", ["two_area", "ieee39", "wscc9"])
def test_speeds_and_angles_that_only_refer_to_each_other_make_a_double_zero(point, name):
    """No governor and no infinite bus: A maps a common speed to a rotation of all angles, and that to zero."""
    m = analyze(linearize(operating_point.solve(point(name).case.classical())))
    A, angles, speeds = m.linear.A, m.linear.angles(), m.linear.speeds()
    turned, moving = np.zeros(len(A)), np.zeros(len(A))
    turned[angles] = moving[speeds] = 1
    size = np.abs(A).max()
    assert np.abs(A @ turned).max() < 1e-12 * size
    assert np.abs(A @ moving - size * turned).max() < 1e-9 * size  # size is the synchronous speed
    zero = np.flatnonzero(m.eigenvalues == 0)
    assert [m.label(k).split(" (")[0] for k in zero] == ["angle reference", "frequency reference"]
    assert m.stable
    assert "unstable" not in str(m)


def test_an_unstable_point_names_its_eigenvalue_and_mode(modes):
    m = modes("two_area_thyristor")
    k = int(m.eigenvalues.real.argmax())
    s = m.eigenvalues[k]
    assert s.real > 0.01
    said = f"the operating point is unstable: eigenvalue {s.real:.4g} +- {abs(s.imag):.4g}j 1/s ({m.label(k)})."
    assert str(m).endswith(said)


def test_a_double_zero_keeps_its_accuracy():
    """Two masses on a spring, free to move: a zero of order two, where a plain solver gives +-1e-8."""
    k, H = 3.0, np.array([1.0, 2.0])
    A = np.zeros((4, 4))
    A[0, 1] = A[2, 3] = 1
    A[1, [0, 2]], A[3, [0, 2]] = np.array([-k, k]) / H[0], np.array([k, -k]) / H[1]
    found = eigen(A, np.isin(np.arange(len(A)), [0, 2]) * 1.0)
    assert np.array_equal(found.values[:2], [0, 0])
    assert found.values[2] == pytest.approx(1j * np.sqrt(4.5), abs=1e-12)
    assert np.abs(found.left.conj().T @ found.right - np.eye(4)).max() < 1e-12


def test_twin_machines_share_an_eigenspace():
    """Two equal blocks: eigenvalues coincide, the vectors still belong together."""
    block = np.array([[0.0, 1.0], [-4.0, -0.2]])
    A = np.zeros((6, 6))
    A[:2, :2] = A[2:4, 2:4] = A[4:, 4:] = block
    mean = np.eye(6)
    mean[0::2, 0::2] -= 1 / 3
    A[1::2, 0::2] = A[1::2, 0::2] @ mean[0::2, 0::2]
    found = eigen(A, np.isin(np.arange(len(A)), [0, 2, 4]) * 1.0)
    assert np.abs(found.left.conj().T @ found.right - np.eye(6)).max() < 1e-10
    assert np.abs(A @ found.right[:, 2:] - found.right[:, 2:] * found.values[2:]).max() < 1e-10


def test_mode_shapes_lead_with_one(modes):
    m = modes("wnaps")
    assert np.abs(m.shapes[:, m.swings()]).max(axis=0) == pytest.approx(1)
    mode = m.mode(m.swings()[0])
    assert len(mode.participation) == 10
    assert {p.machine: p.magnitude for p in mode.shape}[34] == pytest.approx(1)


def test_residues_are_derivatives_of_the_eigenvalues(point):
    """The loop is really closed: u = k y with a small k of both signs, every eigenvalue followed."""
    model = linearize(point("two_area"), ["storage:5", "vref:3"], ["speed:1", "voltage:8"])
    m = analyze(model)
    for i, output in enumerate(model.outputs):
        for j, input in enumerate(model.inputs):
            residues = m.residues(output, input)
            k = 1e-4 / np.abs(residues).max()
            ends = []
            for gain in (k, -k):
                closed = model.A + np.outer(model.B[:, j], model.C[i]) * gain / (1 - model.D[i, j] * gain)
                values = np.linalg.eigvals(closed)
                ends.append(values[np.abs(m.eigenvalues[:, None] + gain * residues[:, None] - values).argmin(axis=1)])
            derivative = (ends[0] - ends[1]) / (2 * k)
            worst = np.abs(derivative - residues)[m.swings()].max()
            assert worst < 1e-6 * np.abs(residues).max()  # 2e-8


def test_residues_sum_to_the_transfer_function(point):
    model = linearize(point("two_area"), ["storage:5"], ["speed:1"])
    m = analyze(model)
    s = 2j
    direct = (model.C @ np.linalg.solve(s * np.eye(len(m)) - model.A, model.B) + model.D)[0, 0]
    assert (m.residues() / (s - m.eigenvalues)).sum() + model.D[0, 0] == pytest.approx(direct, rel=1e-9)  # 3e-14


def test_unknown_labels_and_bands_are_refused(modes):
    with pytest.raises(StudyError, match="is not an output"):
        modes("two_area").residues("speed GENROU 9", 0)
    with pytest.raises(StudyError, match="band"):
        modes("two_area").within(2, 1)
