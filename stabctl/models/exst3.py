"""EXST3: bus-fed controlled rectifier (IEEE ST3; current source and rectifier loading left out).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> VI limits -> KJ (1+sTC)/(1+sTB) -> (+) -> [KA/(1+sTA)], held VRmin..VRmax -> x VE -> Efd
          VE = KP ve, Efd <= Emax                                 (-) min(VGmax, KG Efd)
"""

from typing import Annotated, NamedTuple

from stabctl.compiled import kernel
from stabctl.quantity import NOT_NEGATIVE, POSITIVE, Range

from .blocks import clip, lag, lag_rate, lead_lag
from .exciter import Input

NAME = "EXST3"
ROLE = "exciter"
HELD = {"vr": ("VRmin", "VRmax")}
__all__ = ["HELD", "NAME", "ROLE", "Input", "Par", "State", "flow", "output"]


class Par(NamedTuple):
    """Constants of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "regulator lag", Range(1e-3)]
    TB: Annotated[float, "s", "lag of the first stage", NOT_NEGATIVE]
    TC: Annotated[float, "s", "lead of the first stage", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "regulator limit"]
    VRmin: Annotated[float, "pu", "regulator limit"]
    VImax: Annotated[float, "pu", "error limit"]
    VImin: Annotated[float, "pu", "error limit"]
    KJ: Annotated[float, "pu", "gain of the first stage", POSITIVE] = 1.0
    KP: Annotated[float, "pu", "gain of the potential source", POSITIVE] = 1.0
    Emax: Annotated[float, "pu", "field voltage limit"] = 5.0
    KG: Annotated[float, "pu", "inner feedback gain", NOT_NEGATIVE] = 0.0
    VGmax: Annotated[float, "pu", "inner feedback limit"] = 5.0


class State(NamedTuple):
    """Transducer, first stage and regulator."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged error of the first stage"]
    vr: Annotated[float, "pu", "regulator output"]


@kernel
def output(x, u, p):
    """Field voltage Efd = min(VR KP VE, Emax) (pu)."""
    return clip(clip(x.vr, p.VRmin, p.VRmax) * p.KP * u.ve, -p.Emax, p.Emax)


@kernel
def flow(x, u, y, p):
    """State rates (1/s); y is this exciter's own output."""
    error = p.KJ * clip(u.vref - lag(p.TR, u.vt, x.vm) + u.vs, p.VImin, p.VImax)
    drive = p.KA * (lead_lag(p.TC, p.TB, error, x.va) - clip(p.KG * y, -p.VGmax, p.VGmax))
    return State(lag_rate(p.TR, u.vt, x.vm), lag_rate(p.TB, error, x.va), (drive - x.vr) / p.TA)
