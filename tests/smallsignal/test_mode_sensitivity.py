"""Sensitivities: the derivative is that of eigenvalues found anew, whatever the device and the parameter."""

from dataclasses import replace

import numpy as np
import pytest
from systems import ALL_KINDS, OWN_KINDS, each, kind, small
from uneven import uneven_point

import stabctl as st
from stabctl._util.errors import StabctlError, StudyError
from stabctl.controllers import Controller
from stabctl.dynamics.operating_point import solve
from stabctl.model import powerflow
from stabctl.smallsignal import analyze, linearize
from stabctl.smallsignal._parameter_slopes import ParameterSlopes
from stabctl.smallsignal.analysis import modes as modes_of
from stabctl.smallsignal.sensitivity import equations_of

RNG = np.random.default_rng(2)


def changed(point, row, s):
    """Change of the eigenvalue s per step of a row, from eigenvalues of changed cases (central, extrapolated)."""

    def at(value):
        found = modes_of(solve(point.case.set(row.path, value), point.flow)).eigenvalues
        return found[np.abs(found - s).argmin()]

    h = 1e-3 * (abs(row.value) or 0.1)
    whole, half = ((at(row.value + h * k) - at(row.value - h * k)) / (2 * h * k) for k in (1, 0.5))
    return (4 * half - whole) / 3 * row.step


def agrees(point, mode=None, rows=None):
    """Check rows of the sensitivities of a mode against eigenvalues found anew; returns how many were checked."""
    modes = modes_of(point)
    k = min(modes.swings(), key=lambda k: modes.damping_ratio[k]) if mode is None else mode
    s, checked = modes.eigenvalues[k], 0
    found = modes.sensitivity(mode=k)
    tables = {row.model for row in found.rows}
    for table in sorted(tables):
        own = [row for row in found.rows if row.model == table]
        for row in own if rows is None else [own[i] for i in RNG.permutation(len(own))[:rows]]:
            try:
                expected = changed(point, row, s)
            except StabctlError:  # at the edge of what is allowed: one side only
                continue
            ds = complex(row.real, 2 * np.pi * row.frequency_hz)
            assert abs(ds - expected) < 1e-5 * max(abs(expected), 1e-4 * abs(s)), row  # 2e-6 (xl of machines)
            h = 1e-5 * abs(s) / (abs(ds) or 1.0)
            ratio = [-t.real / abs(t) for t in (s + h * ds, s - h * ds)]
            assert row.damping_ratio == pytest.approx((ratio[0] - ratio[1]) / (2 * h), abs=1e-8 * abs(ds / s)), row
            checked += 1
    return checked


@pytest.mark.parametrize("name", ["two_area", "two_area_thyristor", "two_area_pss", "wscc9"])
def test_derivatives_of_packaged_cases(point, name):
    assert agrees(point(name), rows=6) >= 10


@pytest.mark.slow
def test_derivatives_of_a_larger_case(point):
    assert agrees(point("ieee39"), rows=3) >= 10


@pytest.mark.parametrize("name", each(n for n in ALL_KINDS if n not in OWN_KINDS))
def test_derivatives_of_every_device(name):
    with kind(name) as models:
        of = solve(small(models))
        modes = modes_of(of)
        upper = [k for k in range(len(modes)) if modes.eigenvalues[k].imag > 1e-3]  # equal washouts are a double pole
        if upper:
            assert agrees(of, upper[0], rows=4)
        whole = modes.shares.sum(axis=0)
        assert ((np.abs(whole - 1) < 1e-9) | (whole == 0)).all()  # 0 of equal lags in a row, as in dera1


def test_all_inertias_together(point):
    """Undamped classical machines: s^2 is inversely proportional to all H, so that the sum per 1 % is -s / 200."""
    case = point("two_area").case.classical()
    case = case.set({f"gencls.{m.machine}.D": 0.0 for m in case.machines})
    modes = modes_of(solve(case))
    k = modes.swings()[0]
    total = sum(row.frequency_hz for row in modes.sensitivity("gencls.H", mode=k).rows)
    assert total == pytest.approx(-modes.frequency_hz[k] / 200, rel=1e-7)


def test_limits_that_are_not_reached_change_nothing(point):
    found = modes_of(point("two_area")).sensitivity("sexs")
    limits = [row for row in found.rows if row.parameter in ("Efdmax", "Efdmin")]
    assert limits
    assert all((row.real, row.frequency_hz, row.damping_ratio) == (0, 0, 0) for row in limits)


def test_the_largest_come_first_and_zeros_last(point):
    rows = modes_of(point("ieee39")).sensitivity().rows
    split = sum(row.value != 0 for row in rows)
    assert all(row.value == 0 for row in rows[split:])
    for part in (rows[:split], rows[split:]):
        sizes = [abs(row.damping_ratio) for row in part]
        assert sizes == sorted(sizes, reverse=True)
    assert all(row.step == pytest.approx(0.01 * row.value if row.value else 0.01) for row in rows)


def test_what_has_no_derivative_is_named(point):
    case = point("two_area").case.set({"sexs.2.TR": 0.0, "sexs.1.TR": 1e-3})
    found = modes_of(solve(case)).sensitivity("sexs.TR")
    left = {one.path: one.reason for one in found.left_out}
    assert left == {"sexs.2.TR": "0 s bypasses its block", "sexs.1.TR": "it has no derivative at 0.001, a threshold"}
    assert [row.place for row in found.rows if row.value] != []
    assert "left out: sexs.1.TR" in str(found)


def test_sides_of_the_equilibrium():
    """At rest, a droop for falling and one for rising frequency meet; a change of one alone has no derivative."""
    with kind("repc_a, voltage") as models:
        modes = modes_of(solve(small(models)))
        found = modes.sensitivity(["repc_a.Dup", "repc_a.Ddn"], mode=10)
    assert {one.path for one in found.left_out} == {"repc_a.1.Dup", "repc_a.1.Ddn"}


def test_names_and_modes(point):
    modes = modes_of(point("two_area"))
    every, one = modes.sensitivity("pss.K"), modes.sensitivity(["pss.2.K"])
    assert sorted(row.place for row in every.rows) == [1, 2, 3, 4]
    assert one.rows[0] in every.rows
    assert modes.sensitivity("pss.K", mode="0.61Hz").rows == modes.sensitivity("pss.K", mode=0.61).rows == every.rows
    assert list(every.df["parameter"]) == ["K"] * 4
    assert len(every.plot().patches) == 4
    signals = analyze(linearize(point("two_area"), ["load_p:7"], ["frequency:7"]))
    assert signals.sensitivity("pss.K").rows[0].real == pytest.approx(every.rows[0].real, rel=1e-9)


def test_the_modes_of_a_band(point):
    few = modes_of(point("two_area"), (0.1, 0.8), sparse=True).sensitivity("pss")
    every = {row.path: row for row in modes_of(point("two_area")).sensitivity("pss").rows}
    for row in few.rows:
        assert row.real == pytest.approx(every[row.path].real, rel=1e-6, abs=1e-12)


def test_a_band_without_electromechanical_modes_is_named(point):
    with pytest.raises(StudyError, match=r"no electromechanical mode from 3 to 4 Hz .*; search a wider band"):
        modes_of(point("two_area"), (3, 4), sparse=True).sensitivity()


def test_changes_by_rounding_are_not_told():
    """Without damping anywhere, only dampings, which are 0, change the damping ratio; no other parameter does."""
    modes = modes_of(solve(st.load("two_area").classical()))
    first = "largest changes of its damping ratio, 0.0000: gencls.3.D +4.6e-05, gencls.4.D +3.4e-05, gencls.1.D"
    assert first in str(modes.sensitivity())
    assert "per 0.01 of their unit, as they are 0." in str(modes.sensitivity())
    assert str(modes.sensitivity("gencls.H")).endswith("; none changes its damping ratio, 0.0000.")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"parameters": "exst3.KA"}, "two_area has no rows in exst3"),
        ({"parameters": "sexs.KB"}, "sexs has no column 'KB'"),
        ({"parameters": "sexs.9.KA"}, "two_area has no sexs at 9"),
        ({"parameters": "branches.7-8.x"}, "at a given power flow"),
        ({"parameters": 3}, "are no parameters"),
        ({"mode": 99}, "There is no mode 99"),
        ({"mode": "40Hz"}, "There is no mode near 40 Hz"),
        ({"mode": 0}, "is zero"),
        ({"mode": "fast"}, "not a frequency"),
    ],
)
def test_mistakes(point, arguments, message):
    with pytest.raises(StudyError, match=message):
        modes_of(point("two_area")).sensitivity(**arguments)


def test_loops_with_controllers_are_refused(point):
    pod = Controller(("speed:1",), ("vs:1",), [[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    for one in (pod, replace(pod, rate=50)):
        with pytest.raises(StudyError, match=r"take base\.modes"):
            st.closed_loop(point("two_area"), one).modes().sensitivity()


def test_equal_eigenvalues_have_no_derivative():
    case = st.load("two_area_manual")
    modes = modes_of(solve(st.replicate(case, 2)))
    s = modes.eigenvalues
    twice = [k for k in range(len(s)) if s[k] != 0 and (np.abs(np.delete(s, k) - s[k]) < 1e-10).any()]
    for k in twice[:1]:
        with pytest.raises(StudyError, match="coincides"):
            modes.sensitivity(mode=k)


def test_the_power_flow_stays(point):
    """The flow of a case does not depend on its devices, so that `case.set` and the derivative mean the same."""
    of = point("two_area")
    assert np.array_equal(powerflow.solve(of.case.set("genrou.1.xd", 2.0)).V, of.flow.V)


def test_the_step_of_a_parameter_is_relative_to_its_value_and_to_its_unit_at_zero():
    """So it is as small for 120 pu as for 40 ms; on one side only where the other is not allowed."""
    modes = uneven_point().modes()
    of = ParameterSlopes(equations_of(modes), complex(modes.eigenvalues[0]), modes.right[:, 0], modes.left[:, 0])
    par = modes.linear.point.case.devices
    for model, name, key, sides in (
        ("sexs", "KA", 3, (-1, 0, 1)), ("sexs", "TA", 3, (-1, 0, 1)), ("genrou", "D", 3, (-1, 0, 1)),
        ("genrou", "xd", 7, (-1, 0, 1)), ("gencls", "ra", 12, (-1, 0, 1)), ("sexs", "KA", 7, (-1, 0, 1)),
    ):  # fmt: skip
        value = getattr(par[model][key], name)
        for step in (1e-3, 2e-4):
            found = of._steps(model, name, key, step)
            assert found.points == pytest.approx(step * (abs(value) or 1.0) * np.array(sides), rel=1e-9)
            assert found.weights @ found.points == pytest.approx(1.0)
            assert found.weights.sum() == pytest.approx(0.0, abs=1e-9 / step)
            place = list(of.point.system.family(model).device.Par._fields).index(name)
            assert np.ptp(found.k, axis=0)[place] == pytest.approx(np.ptp(found.points), rel=1e-6)
