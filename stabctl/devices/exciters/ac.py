"""What the exciters with an alternator and a rectifier share: the exciter, and the regulator of most of them.

The regulator has a lead-lag and a lag, and a stabilizing feedback of the field of the exciter.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import derivative, field_demand, lag, lead_lag, rectified

from .shared import Output


class State(NamedTuple):
    """Transducer, first stage, regulator, exciter and stabilizing feedback."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged control error"]
    vr: Annotated[float, "pu", "regulator output"]
    ve: Annotated[float, "pu", "exciter voltage"]
    vf: Annotated[float, "pu", "lagged field of the exciter"]


@inline
def load(x, u, p):
    """VFE = (KE + SE(VE)) VE + KD Ifd, what the exciter needs at its field (pu)."""
    return field_demand(x.ve, p.KE, p.SA, p.SB) + p.KD * u.Ifd


@inline
def regulated(x, u, p):
    """Regulator output before its limits and VFE (pu), and state derivatives (1/s) of vm, va, vr and vf."""
    vfe = load(x, u, p)
    vf, d_vf = derivative(p.KF, p.TF, vfe, x.vf)
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    va, d_va = lead_lag(p.TC, p.TB, u.Vref - vm + u.Vs - vf, x.va)
    vr, d_vr = lag(p.TA, p.KA * va, x.vr)
    return vr, vfe, (d_vm, d_va, d_vr, d_vf)


@inline
def excited(x, u, drive, vfe, d, p):
    """Field voltage Efd = VE FEX(KC Ifd/VE) (pu), and derivatives (1/s) with `drive` at the field of the exciter."""
    d_vm, d_va, d_vr, d_vf = d
    rates = State(vm=d_vm, va=d_va, vr=d_vr, ve=(drive - vfe) / p.TE, vf=d_vf)
    return Output(rectified(x.ve, p.KC, u.Ifd)), rates


def guess(V, I, p):
    """Initial guess: a voltage at which the rectifier is not overloaded."""
    return State(1.0, 1.0, 1.0, 10.0, 10.0)
