"""Root loci: followed without a jump, ending where a fresh solution ends."""

from dataclasses import replace

import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.dynamics import operating_point
from stabctl.smallsignal import analyze, feedback_locus, linearize, parameter_locus


def test_storage_damping_at_both_ends_of_the_tie(point):
    """P = k w damps; the start of every branch is the residue."""
    model = linearize(point("two_area_thyristor"), ["storage:5"], ["speed:1"])
    gains = np.linspace(0, 60, 61)
    locus = feedback_locus(model, "speed GENROU 1", "P storage bus 5", gains)
    inter = locus.start.swings()[0]
    assert locus.eigenvalues[0, inter].real > 0
    assert locus.eigenvalues[-1, inter].real < 0
    slope = (locus.eigenvalues[1] - locus.eigenvalues[0]) / gains[1]
    first = analyze(model).residues()
    assert slope[inter] == pytest.approx(first[inter], rel=2e-3)  # 7e-4: the curvature over one unit of gain
    end = np.linalg.eigvals(model.A + 60 * model.B @ model.C / (1 - 60 * model.D[0, 0]))
    assert np.abs(np.sort_complex(locus.eigenvalues[-1]) - np.sort_complex(end)).max() < 1e-10  # 3e-13


def test_a_gain_around_an_output_that_the_input_reaches_at_once(point):
    """u = k y with y = C x + D u, D = 0.07: u = k C x/(1 - D k)."""
    model = linearize(point("two_area"), ["storage:5"], ["voltage:5"])
    C, d = model.C, model.D[0, 0]
    assert abs(d) > 1e-3
    gains = np.array([0.0, 0.2, 0.4, 0.6]) / d
    locus = feedback_locus(model, 0, 0, gains)
    for k, found in zip(gains, locus.eigenvalues, strict=True):
        u = k * np.linalg.solve(np.eye(1) - k * model.D, C)  # of the states
        end = np.linalg.eigvals(model.A + model.B @ u)
        assert np.abs(np.sort_complex(found) - np.sort_complex(end)).max() < 1e-4
    with pytest.raises(StudyError, match="algebraic loop"):
        feedback_locus(model, 0, 0, [0.0, 1 / d])


@pytest.mark.slow
def test_branches_do_not_jump(point):
    model = linearize(point("two_area"), ["storage:5"], ["speed:1"])
    coarse = feedback_locus(model, 0, 0, np.linspace(0, 40, 11))
    fine = feedback_locus(model, 0, 0, np.linspace(0, 40, 201))
    swings = coarse.start.swings()
    assert np.abs(coarse.eigenvalues[-1, swings] - fine.eigenvalues[-1, swings]).max() < 1e-6  # 0


def test_stabilizer_gain(point):
    """From no gain to Kundur's 20 the inter-area mode goes from growing to well damped."""
    case = point("two_area_pss").case
    locus = parameter_locus(case, "pss", "K", np.linspace(0.01, 20, 12))
    inter = locus.start.swings()[0]
    ratio = locus.damping_ratio()[:, inter]
    assert ratio[0] < 0 < 0.1 < ratio[-1]
    assert (np.diff(ratio) > 0).all()
    end = analyze(linearize(operating_point.solve(case)))
    assert locus.eigenvalues[-1, inter] == pytest.approx(end.eigenvalues[end.swings()[0]], abs=1e-8)


def test_one_machine_only(point):
    locus = parameter_locus(point("two_area_pss").case, "pss", "K", [20.0, 25.0], machines=[2])
    rows = dict(point("two_area_pss").case.devices["pss"])
    rows[2] = rows[2]._replace(K=25.0)
    case = point("two_area_pss").case
    changed = analyze(linearize(operating_point.solve(replace(case, devices={**case.devices, "pss": rows}))))
    found, wanted = np.sort_complex(locus.eigenvalues[-1]), np.sort_complex(changed.eigenvalues)
    assert np.abs(found - wanted).max() < 1e-6  # 0


def test_loads_are_chosen_by_their_buses_and_machines_by_their_names(point):
    case = point("two_area").case
    case = replace(case, machines=tuple(m._replace(name=f"1/{m.machine}") for m in case.machines))
    loads = case.with_device("exponential", [7, 9], a=1.5, b=2.0)
    found = [parameter_locus(loads, "exponential", "a", [1, 2], machines=at).eigenvalues[-1] for at in ([7], None)]
    assert np.abs(found[0] - found[1]).max() > 1e-3
    both = [parameter_locus(case, "sexs", "KA", [100, 150], machines=at).eigenvalues for at in (["1/2"], [2])]
    assert np.array_equal(*both)


def test_mistakes_are_named(point):
    case = point("two_area").case
    with pytest.raises(StudyError, match="no table 'exst3'"):
        parameter_locus(case, "exst3", "KA", [1, 2])
    with pytest.raises(StudyError, match="no parameter 'KX'"):
        parameter_locus(case, "sexs", "KX", [1, 2])
    with pytest.raises(StudyError, match="two_area has no pss at 7"):
        parameter_locus(case, "pss", "K", [1, 2], machines=[7])
    with pytest.raises(StudyError, match="at least two"):
        parameter_locus(case, "pss", "K", [1])
    with pytest.raises(StudyError, match="adds or removes states"):
        parameter_locus(case, "sexs", "TA", [0.05, 0.0])
