"""Controls that equal limits block, at the value of the operating point: the linear model is that without them."""

import numpy as np
import pytest
from systems import each, kind, small

import stabctl as st
from stabctl import devices
from stabctl._util.errors import StabctlError
from stabctl._util.schema import fields
from stabctl.dynamics import operating_point
from stabctl.dynamics.family import INPUTS, STATE
from stabctl.smallsignal import descriptor, linearize
from stabctl.smallsignal.nonlinear import Motion


def blocked(models):
    """Operating points at which a pair of limits ...max and ...min of a device of machine 1 is one value."""
    free = operating_point.solve(small(models))
    for table, par in models.items():
        names = {n[:-3] for n in fields(type(par)) if n.endswith("max")}
        pairs = [n for n in sorted(names) if f"{n}min" in fields(type(par))]
        f = free.system.family(table)
        w, first = f.w[0], f.w[0, STATE]
        near = np.r_[first : first + len(f.device.State._fields), w[INPUTS:]]
        for name in pairs if devices.every()[table].role != "load" else ():
            for value in (0.0, *free.s[near].tolist()):
                limits = {f"{name}max": value, f"{name}min": value}
                try:
                    yield name, operating_point.solve(small({**models, table: par._replace(**limits)}))
                except StabctlError:
                    continue
                break


@pytest.mark.parametrize("name", each())
def test_the_linear_model_is_the_motion_nearby(name):
    """But for the integral of a PI regulator that is blocked, which nothing reads."""
    with kind(name) as models:
        for limit, point in blocked(models):
            if np.abs(point.equations.at(point.s.copy()).rates).max() > 1e-8:
                continue  # DEGOV, whose delay is that much faster than the accuracy of the start
            d, A = descriptor(point), linearize(point).A
            move, h, u = Motion(d), 1e-6 * np.eye(len(A)), np.zeros(0)
            found = np.array([(move.rates(x, u) - move.rates(-x, u)) / 2e-6 for x in h]).T
            miss = np.abs(found - A)[A.any(axis=0)]
            assert miss.max() < 1e-6 * np.abs(A).max(), limit  # 1e-9


GOVERNORS = {
    "ieeeg1": {"K": 20.0, "T1": 0.2, "T2": 0.0, "T3": 0.1, "T4": 0.3, "K1": 0.3, "T5": 5.0, "K3": 0.7},
    "pidgov": {
        "feedback": 1, "Rperm": 0.05, "Treg": 0.05, "Kp": 4.0, "Ki": 1.0, "Kd": 0.2, "Ta": 0.1, "Tb": 0.3, "Dturb": 0.0,
        "G0": 0.1, "G1": 0.5, "P1": 0.3, "G2": 0.75, "P2": 0.55, "P3": 1.0,
    },
}  # fmt: skip


def swings(case):
    found = case.initialize().modes()
    return np.sort_complex(found.eigenvalues[found.electromechanical & (found.eigenvalues.imag > 0)])


@pytest.mark.parametrize("machines", [(4,), (1, 2, 3, 4)])
def test_a_stabilizer_without_limits_to_move_in_is_none(machines):
    case = st.load("two_area")
    held = case
    for machine in machines:
        held = held.set(f"pss.{machine}.Vmax", 0.0).set(f"pss.{machine}.Vmin", 0.0)
    assert np.abs(swings(held) - swings(case.without_device("pss", machines))).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(("table", "limits"), [("ieeeg1", "U"), ("ieeeg1", "P"), ("pidgov", "Vel")])
def test_a_governor_that_cannot_move_is_none(table, limits):
    case = st.load("two_area").without_device("tgov").with_device(table, (1, 2, 3, 4), **GOVERNORS[table])
    point = case.initialize()
    for machine in case.devices[table]:
        value = 0.0
        if limits == "P":
            value = float(point.s[point.layout.setpoint(machine - 1, "Pref")])
        case = case.set(f"{table}.{machine}.{limits}max", value).set(f"{table}.{machine}.{limits}min", value)
    assert np.abs(swings(case) - swings(case.without_device(table))).max() < 1e-9
