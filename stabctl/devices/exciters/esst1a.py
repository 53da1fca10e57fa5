"""ESST1A: bus-fed static exciter with two lead-lags and a limit of the field current (IEEE type ST1A).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> VImin..VImax -> [(1+sTC)/(1+sTB)] -> [(1+sTC1)/(1+sTB1)] -> [KA/(1+sTA)], held VAmin..VAmax
       (-) [sKF/(1+sTF)] <- VA'
VA' = VA - max(0, KLR (Ifd - ILR));  Vt VRmin <= Efd = VA' <= Vt VRmax - KC Ifd

The stabilizer acts at the input (VOS = 1). The gates for excitation limiters are not represented.
Source: IEEE Std 421.5, type ST1A; PSS/E Model Library, ESST1A.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import SHORT, at_least, at_most, clip, derivative, lag, lead_lag

from .shared import LoadedInput as Input
from .shared import Output

NAME = "ESST1A"
ROLE = "exciter"
LIMITS = {"vr": ("VAmin", "VAmax")}
LEVELS = ("ILR",)
DYR = {
    "ESST1A": "+UEL +VOS TR VImax VImin TC TB TC1 TB1 KA TA VAmax VAmin VRmax VRmin KC KF TF KLR ILR",
}
__all__ = ["DYR", "LEVELS", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations", "from_record"]


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    VImax: Annotated[float, "pu", "error limit"]
    VImin: Annotated[float, "pu", "error limit"]
    TC: Annotated[float, "s", "lead of the first stage", NOT_NEGATIVE]
    TB: Annotated[float, "s", "lag of the first stage", NOT_NEGATIVE]
    TC1: Annotated[float, "s", "lead of the second stage", NOT_NEGATIVE]
    TB1: Annotated[float, "s", "lag of the second stage", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
    VAmax: Annotated[float, "pu", "regulator limit"]
    VAmin: Annotated[float, "pu", "regulator limit"]
    VRmax: Annotated[float, "pu", "ceiling at 1 pu terminal voltage without load"]
    VRmin: Annotated[float, "pu", "lower limit at 1 pu terminal voltage"]
    KC: Annotated[float, "pu", "fall of the ceiling with field current", NOT_NEGATIVE] = 0.0
    KF: Annotated[float, "pu", "stabilizing feedback gain", NOT_NEGATIVE] = 0.0
    TF: Annotated[float, "s", "stabilizing feedback lag (0: no feedback)", NOT_NEGATIVE] = 1.0
    KLR: Annotated[float, "pu", "gain of the field current limiter", NOT_NEGATIVE] = 0.0
    ILR: Annotated[float, "pu", "field current above which its limiter acts"] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        if self.KF > 0 and self.TF >= SHORT > self.TA:
            yield "TA", f"must be at least {SHORT:g} s with a feedback KF = {self.KF:g}"


class State(NamedTuple):
    """Transducer, two stages, regulator and stabilizing feedback."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged control error"]
    vb: Annotated[float, "pu", "lagged signal of the second stage"]
    vr: Annotated[float, "pu", "regulator output"]
    vf: Annotated[float, "pu", "lagged regulator output of the feedback"]


@inline
def equations(x, u, p):
    """Field voltage Efd (pu), and state derivatives (1/s)."""
    excess = at_least(p.KLR * (u.Ifd - p.ILR), 0.0)  # of the field current
    vf, d_vf = derivative(p.KF, p.TF, x.vr - excess, x.vf)
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    va, d_va = lead_lag(p.TC, p.TB, clip(u.Vref - vm + u.Vs - vf, p.VImin, p.VImax), x.va)
    vb, d_vb = lead_lag(p.TC1, p.TB1, va, x.vb)
    vr, d_vr = lag(p.TA, p.KA * vb, x.vr)
    efd = clip(vr, p.VAmin, p.VAmax) - excess
    efd = at_least(at_most(efd, u.vt * p.VRmax - p.KC * u.Ifd), u.vt * p.VRmin)
    return Output(efd), State(vm=d_vm, va=d_va, vb=d_vb, vr=d_vr, vf=d_vf)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected: nothing."""
    if values["VOS"] != 1:
        raise ValueError(f"VOS = {values['VOS']:g} is not supported; it must be 1 (stabilizer at the input).")
    return Par(**{name: value for name, value in values.items() if name in Par._fields}), []
