"""The linear model: exact, named, and refused where there is none."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.optimize import linear_sum_assignment
from scipy.sparse.linalg import splu
from systems import FORMING, LIBRARY, doubled, each, kind, small

from stabctl import io
from stabctl._util.errors import LinearizationError, StudyError
from stabctl.dynamics import operating_point
from stabctl.dynamics.family import TINY
from stabctl.dynamics.jacobian import array
from stabctl.dynamics.perform import evaluate
from stabctl.model.tables import Storage
from stabctl.smallsignal import INPUTS, OUTPUTS, descriptor, linearize


@pytest.mark.parametrize("name", ["two_area", "wnaps"])
def test_every_eigenvalue_of_the_reference_is_found_once(modes, reference, name):
    rows = reference(name, "eigenvalues")
    listed = rows["real_1_per_s"] + 1j * rows["imag_rad_per_s"]
    found = modes(name).eigenvalues
    assert len(found) == len(listed)
    distance = np.abs(found[:, None] - listed)
    pairs = linear_sum_assignment(distance)
    assert distance[pairs].max() < 1e-5  # two_area 3.4e-9, wnaps 3.5e-8


def test_ieee39_has_140_states(modes):
    assert len(modes("ieee39").linear.states) == 140


def test_blocks_of_devices_equal_one_place_at_a_time(point):
    """Derivatives put together from local blocks are those of the whole system, perturbed place by place."""
    p = point("two_area")
    d, equations, lay = p.equations.at(p.s.copy()), p.equations, p.layout
    found = np.vstack([array(part) for part in (d.of_rates, d.of_outputs, d.of_currents)])
    one = np.array([_along(equations, p.s, place) for place in range(lay.step)]).T
    scale = np.abs(one).max(axis=1, keepdims=True) + 1e-30
    assert np.abs((found - one) / scale).max() < 1e-14
    assert np.count_nonzero(one) > 600


def _along(equations, s, place):
    """Derivatives of rates, outputs and currents along one place, by complex step through the outputs."""
    pattern = equations.pattern
    z, f = s.astype(complex), np.zeros(pattern.starts[-1], complex)
    z[place] += 1j * TINY
    evaluate(equations.program, pattern.starts, z, f, equations._on)
    slopes = np.zeros(pattern.total)
    slopes[pattern.answers] = f.imag[pattern.values] / TINY
    first = equations.system.layout.nx + equations.system.layout.outputs
    return np.r_[slopes[:first], equations._gather @ slopes[first:]]


def test_the_states_follow_the_algebra_of_the_descriptor_form(point):
    """inv(s E - J) of the sparse form and inv(s I - A) give the same transfer function."""
    names = ["storage:5", "vref:1"], ["speed:2", "voltage:8", "flow:7-8#2", "frequency:9"]
    d, m = descriptor(point("two_area"), *names), linearize(point("two_area"), *names)
    s = 0.3 + 5j
    v = -splu(d.gv.astype(complex).tocsc()).solve(np.hstack([d.gx.toarray(), d.gu.toarray()]).astype(complex))
    n = len(d.rows)
    whole = np.linalg.solve(s * np.eye(n) - (d.fx + d.fv @ v[:, :n]), d.fu + d.fv @ v[:, n:])
    sparse = (d.hx + d.hv @ v[:, :n]) @ whole + d.hu + d.hv @ v[:, n:]
    dense = m.C @ np.linalg.solve(s * np.eye(n) - m.A, m.B) + m.D
    assert np.abs(sparse - dense).max() < 1e-10 * np.abs(dense).max()  # 4e-15


def test_a_turn_of_all_angles_changes_nothing(modes):
    m = modes("wnaps").linear
    r = np.zeros(len(m.A))
    r[m.angles()] = 1
    assert np.abs(m.A @ r).max() < 1e-9  # 1e-12


def test_power_balance_at_a_storage_bus(point):
    """Absorbed power enters the bus through its circuits: dP of the lines into bus 8 sums to the power drawn there."""
    lines = ["flow:7-8", "flow:7-8#2", "flow:9-8", "flow:9-8#2", "flow:8-7", "flow:8-7#2", "flow:8-9", "flow:8-9#2"]
    m = linearize(point("two_area"), ["storage:8"], lines)
    assert m.D[4:].sum() == pytest.approx(-1.0, abs=1e-9)  # 6e-16
    assert m.D[:4].sum() != pytest.approx(1.0, abs=1e-3)  # the losses of the lines change too: 0.94


def test_labels_reach_python_control(point):
    m = linearize(point("wnaps"), ["storage:33", "vref:14"], ["speed:14", "voltage:33"])
    s = m.to_control()
    assert s.input_labels == ["P storage bus 33", "reference EXST3 14"]
    assert s.output_labels == ["speed GENROU 14", "voltage bus 33"]
    assert "speed GENROU 14" in s.state_labels
    assert len(set(s.state_labels)) == s.nstates == 437
    assert np.array_equal(s.A, m.A)


def test_every_kind_of_signal_has_a_place_in_some_case(point):
    case = point("two_area").case.with_storage([Storage(1, 5, 50.0, lag=0.05, energy=10.0)])
    outputs = [k if k != "state" else "state:field flux GENROU 2" for k in OUTPUTS]
    m = linearize(operating_point.solve(case), [k for k in INPUTS if k not in ("field", "power", "order_v")], outputs)
    assert "order ESD 1@5" in m.inputs
    assert "power ESD 1@5" in m.states
    assert "energy ESD 1@5" in m.states
    assert "energy ESD 1@5" not in linearize(operating_point.solve(case), "order", "absorbed").states
    forming = point("two_area").case.with_storage([Storage(1, 5, 50.0, storage_model="regfm")])
    assert linearize(operating_point.solve(forming), "order_v", "absorbed").inputs == ("voltage order ESD 1@5",)
    free = linearize(point("two_area_manual"), ["field", "power"], ["speed"])
    assert free.inputs[0] == "field voltage GENROU 1"
    assert free.inputs[4] == "mechanical power GENROU 1"
    assert free.B[free.speeds()[0], 4] == pytest.approx(1 / (2 * 6.5))  # w = 1


@pytest.mark.parametrize(
    ("inputs", "outputs", "words"),
    [
        (["valve:1"], [], "'valve' is not an input"),
        ([], ["speed:99"], "no machine 99"),
        ([], ["speed:a"], "give its number"),
        ([], ["voltage:77"], "no bus 77"),
        ([], ["flow:1-2"], "There is no branch 1-2"),
        ([], ["flow:7-8#3"], "has 2 circuits, but no circuit 3"),
        ([], ["coi_speed:1"], "one signal for the whole system"),
        (["field:1"], [], "has an exciter; use vref:1"),
        (["order:1"], [], "has no storage devices"),
        (["storage:8", "storage:8"], [], "appears twice"),
    ],
)
def test_a_wrong_signal_is_named(point, inputs, outputs, words):
    with pytest.raises(StudyError, match=words):
        linearize(point("two_area"), inputs, outputs)


def test_a_point_that_moves_is_refused_by_its_worst_state(point):
    p = point("two_area")
    s = p.s.copy()
    s[[(k.table, k.row, k.name) for k in p.layout.states].index(("sexs", 2, "vm"))] += 1e-3
    with pytest.raises(LinearizationError, match="not an equilibrium: field voltage SEXS 3 changes at -4 per second"):
        linearize(replace(p, s=s))


def test_currents_that_do_not_balance_are_refused_by_their_bus(point):
    p = point("two_area")
    s = p.s.copy()
    s[p.layout.nx + 2 * p.net.place[8]] += 1e-4
    with pytest.raises(LinearizationError, match=r"current mismatch at bus \d+"):
        linearize(replace(p, s=s))


def _with(case, table, machine, **changed):
    rows = dict(case.devices[table])
    rows[machine] = rows[machine]._replace(**changed)
    return replace(case, devices={**case.devices, table: rows})


def test_a_stabilizer_limit_at_the_operating_point_is_named(point):
    case = _with(point("two_area").case, "pss", 2, Vmax=0.0)
    with pytest.raises(
        LinearizationError, match="PSS of machine 2 at bus 2 is exactly at its limit Vmax = 0 pu"
    ) as caught:
        linearize(operating_point.solve(case))
    assert "widen Vmax in pss.csv (--set pss.2.Vmax=...)" in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("level", ["VCU", "VCL"])
def test_a_voltage_at_which_a_stabilizer_goes_out_is_named(level):
    models = LIBRARY["ieeest"]
    p = operating_point.solve(small(models))
    exactly = {level: float(p.s[p.layout.signals[0, "vt"]])}
    at = small(models | {"ieeest": models["ieeest"]._replace(**exactly)})
    with pytest.raises(LinearizationError, match=f"IEEEST of machine 1 at bus 1 is exactly at its limit {level} = "):
        linearize(at)


def test_a_governor_at_full_gate_is_named(point):
    p = point("two_area")
    reference = float(p.s[p.layout.setpoint(1, "Pref")])
    with pytest.raises(LinearizationError, match="TGOV of machine 2 at bus 2 is exactly at its limit Pmax"):
        linearize(operating_point.solve(_with(p.case, "tgov", 2, Pmax=reference)))


def test_a_limit_near_by_does_no_harm(point):
    p = point("two_area")
    near = linearize(operating_point.solve(_with(p.case, "pss", 2, Vmax=1e-5)))
    assert np.abs(near.A - linearize(p).A).max() < 1e-9  # 0


@pytest.mark.parametrize("kip", [0.0, 1e-3, 0.1, 10.0])
def test_a_limit_that_is_not_reached_changes_no_eigenvalue_however_slow_its_controller(kip):
    forming = FORMING._replace(kip=kip)
    wanted = eigenvalues(small({"regfm_a1": forming._replace(Pmax=2.0)}, p=200.0))
    for above in (1e-2, 1e-4, 1e-6):
        found = eigenvalues(small({"regfm_a1": forming._replace(Pmax=0.5 + above)}, p=200.0))
        assert np.abs(found - wanted).max() < 1e-9  # measured 0
    with pytest.raises(LinearizationError, match="REGFM_A1 of machine 1 at bus 1 is exactly at its limit Pmax"):
        eigenvalues(small({"regfm_a1": forming._replace(Pmax=0.5)}, p=200.0))


def eigenvalues(case):
    return np.sort_complex(np.linalg.eigvals(linearize(case).A))


def test_a_full_store_is_refused(point):
    case = point("two_area").case.with_storage([Storage(1, 5, 50.0, energy=10.0, charge=1.0)])
    with pytest.raises(LinearizationError, match=r"storage device 1@5 of .* is full"):
        linearize(operating_point.solve(case))


def test_efficiency_does_not_stand_in_the_way(point):
    case = point("two_area").case.with_storage([Storage(1, 5, 50.0, energy=10.0, efficiency=0.8)])
    assert len(linearize(operating_point.solve(case), ["order:1"]).states) == 56


def test_classical_machines(point):
    m = linearize(operating_point.solve(io.load("wnaps").classical()))
    assert len(m.states) == 68


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_saved_matrices_come_back_with_their_names(point, tmp_path, ending):
    m = linearize(point("two_area"), ["storage"], ["speed", "coi_speed"])
    path = m.save(tmp_path / f"model.{ending}")
    back = np.load(path) if ending == "npz" else loadmat(path, squeeze_me=True)
    for k in "ABCD":
        assert np.array_equal(back[k], getattr(m, k))
    for k in ("states", "inputs", "outputs"):
        assert tuple(str(s) for s in back[k]) == getattr(m, k)


def test_an_unknown_ending_is_refused(point, tmp_path):
    with pytest.raises(StudyError, match=r"\.npz or \.mat"):
        linearize(point("two_area")).save(tmp_path / "model.txt")


@pytest.mark.parametrize("name", each())
def test_a_turn_of_all_angles_changes_nothing_with_any_device(name):
    """Angles that devices track and phasors that they keep turn too."""
    with kind(name) as models:
        m = linearize(operating_point.solve(doubled(small(models))))
    r = m.rotation()
    assert np.abs(m.A @ r).max() < 1e-7 * np.abs(m.A).max()
