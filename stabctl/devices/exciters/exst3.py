"""EXST3: bus-fed static exciter with an inner field-voltage loop (IEEE ST3A).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> VI limits -> KJ (1+sTC)/(1+sTB) -> (+) -> [KA/(1+sTA)], held VRmin..VRmax -> x VE -> Efd
          VE = KP ve, Efd <= Emax                                 (-) min(VGmax, KG Efd)

The current source and the rectifier loading of ST3A are not represented.
Source: IEEE Std 421.5, type ST3A.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import SHORT, clip, lag, lag_rate, lead_lag
from stabctl.schema import NOT_NEGATIVE, POSITIVE

from .signals import Input, Output

NAME = "EXST3"
ROLE = "exciter"
LIMITS = {"vr": ("VRmin", "VRmax")}
__all__ = ["LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "derivatives", "output"]


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
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

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        if self.KG > 0 and self.TA < SHORT:
            yield "TA", f"must be at least {SHORT:g} s with an inner feedback KG = {self.KG:g}"


class State(NamedTuple):
    """Transducer, first stage and regulator."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged error of the first stage"]
    vr: Annotated[float, "pu", "regulator output"]


@inline
def demand(x, u, p):
    """Control error, and the signal after the first stage (pu)."""
    error = p.KJ * clip(u.Vref - lag(p.TR, u.vt, x.vm) + u.Vs, p.VImin, p.VImax)
    return error, lead_lag(p.TC, p.TB, error, x.va)


@inline
def output(x, u, p):
    """Field voltage Efd = min(VR KP VE, Emax) (pu)."""
    vr = clip(x.vr if p.TA >= SHORT else p.KA * demand(x, u, p)[1], p.VRmin, p.VRmax)
    return Output(clip(vr * p.KP * u.ve, -p.Emax, p.Emax))


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is this exciter's own output."""
    error, first = demand(x, u, p)
    drive = p.KA * (first - clip(p.KG * y.Efd, -p.VGmax, p.VGmax))
    return State(lag_rate(p.TR, u.vt, x.vm), lag_rate(p.TB, error, x.va), lag_rate(p.TA, drive, x.vr))
