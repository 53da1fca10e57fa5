"""What the exciters with an alternator and a rectifier share: the exciter, and the regulator of most of them.

The regulator has a lead-lag and a lag, and a stabilizing feedback of the field of the exciter.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import derivative, field_demand, lag, lag_rate, lead_lag, rectified

from .shared import Output


class State(NamedTuple):
    """Transducer, first stage, regulator, exciter and stabilizing feedback."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged control error"]
    vr: Annotated[float, "pu", "regulator output"]
    ve: Annotated[float, "pu", "exciter voltage"]
    vf: Annotated[float, "pu", "lagged field of the exciter"]


@inline
def output(x, u, p):
    """Field voltage Efd = VE FEX(KC Ifd/VE) (pu)."""
    return Output(rectified(x.ve, p.KC, u.Ifd))


@inline
def load(x, u, p):
    """VFE = (KE + SE(VE)) VE + KD Ifd, what the exciter needs at its field (pu)."""
    return field_demand(x.ve, p.KE, p.SA, p.SB) + p.KD * u.Ifd


@inline
def demand(x, u, p, vfe):
    """Control error, and the regulator output it demands (pu)."""
    error = u.Vref - lag(p.TR, u.vt, x.vm) + u.Vs - derivative(p.KF, p.TF, vfe, x.vf)
    return error, p.KA * lead_lag(p.TC, p.TB, error, x.va)


@inline
def rates(x, u, p, error, wanted, vr, vfe):
    """State derivatives (1/s): regulator output `wanted`, voltage `vr` at the field of the exciter."""
    return State(
        lag_rate(p.TR, u.vt, x.vm),
        lag_rate(p.TB, error, x.va),
        lag_rate(p.TA, wanted, x.vr),
        (vr - vfe) / p.TE,
        lag_rate(p.TF, vfe, x.vf),
    )


def guess(V, I, p):
    """Initial guess: a voltage at which the rectifier is not overloaded."""
    return State(1.0, 1.0, 1.0, 10.0, 10.0)
