"""Powers that no machine of its rating can supply are named at the start; a nominal rating is not one of them."""

from dataclasses import replace

import numpy as np
import pytest
from systems import KINDS, small

from stabctl._util.errors import EquilibriumError
from stabctl.dynamics import operating_point


def rebased(case, number, base):
    """The same classical machine per unit of another rating (MVA)."""
    k = base / case.machine(number).base
    machines = tuple(m._replace(base=base) if m.machine == number else m for m in case.machines)
    par = case.devices["gencls"][number]
    par = par._replace(H=par.H / k, D=par.D / k, ra=par.ra * k, x1d=par.x1d * k)
    return replace(case, machines=machines, devices={"gencls": case.devices["gencls"] | {number: par}})


@pytest.mark.parametrize("classical", [False, True])
def test_the_machine_is_named_before_any_limit(cases, classical):
    case = cases("two_area").classical() if classical else cases("two_area")
    says = (
        r"^Machine 2 of two_area supplies 700 MW and 234\.6 Mvar, 7383 times its rating of 0\.1 MVA; correct its power"
    )
    with pytest.raises(EquilibriumError, match=says):
        operating_point.solve(case.set("machines.2.base", 0.1))


def test_the_worst_of_several_is_named(cases):
    case = cases("two_area").set({"machines.1.base": 5, "machines.2.base": 2, "machines.3.base": 5})
    with pytest.raises(EquilibriumError, match=r"^Machine 2 of two_area"):
        operating_point.solve(case)


def test_ten_times_the_rating(cases):
    """700 + j 234.6 MVA: 10.25 and 9.98 times the rating."""
    case = cases("two_area").classical()
    with pytest.raises(EquilibriumError, match=r"10 times its rating of 72 MVA"):
        operating_point.solve(case.set("machines.2.base", 72))
    assert operating_point.solve(case.set("machines.2.base", 74)).layout.nx == 8


def test_a_nominal_rating_with_its_reactance_is_as_good(cases):
    case = cases("two_area").classical()
    plain, nominal = (operating_point.solve(c) for c in (case, rebased(case, 2, 1.0)))
    assert np.abs(plain.s[: plain.layout.nx] - nominal.s[: plain.layout.nx]).max() < 1e-9
    assert nominal.inertia == pytest.approx(plain.inertia)


def test_a_converter_has_no_reactance_that_would_excuse_it():
    case = small(KINDS["converter"])
    with pytest.raises(EquilibriumError, match=r"^Machine 1 of small supplies .* times its rating of 0\.1 MVA"):
        operating_point.solve(case.set("machines.1.base", 0.1))
