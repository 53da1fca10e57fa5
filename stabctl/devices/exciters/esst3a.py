"""ESST3A: static exciter with a compound source and an inner field-voltage loop (IEEE type ST3A).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> VImin..VImax -> [(1+sTC)/(1+sTB)] -> [KA/(1+sTA)], held VRmin..VRmax -> VR
VR -> (+) -> [KM/(1+sTM)], held VMmin..VMmax -> x VB -> Efd
      (-) min(VGmax, KG Efd)
VE = |KP Vt + j (KI + KP XL) It|, KP at the angle THETAP;  VB = min(VBmax, VE FEX(KC Ifd/VE))

Source: IEEE Std 421.5, type ST3A; PSS/E Model Library, ESST3A.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import SHORT, at_most, clip, compound, lag, lag_rate, lead_lag, rectified

from .shared import CompoundInput as Input
from .shared import Output

NAME = "ESST3A"
ROLE = "exciter"
LIMITS = {"vr": ("VRmin", "VRmax"), "vm": ("VMmin", "VMmax")}
LEVELS = ("VBmax", "VGmax")
DYR = {"ESST3A": "TR VImax VImin KM TC TB KA TA VRmax VRmin KG KP KI VBmax KC XL VGmax THETAP TM VMmax VMmin"}
__all__ = ["DYR", "LEVELS", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations"]


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    VImax: Annotated[float, "pu", "error limit"]
    VImin: Annotated[float, "pu", "error limit"]
    KM: Annotated[float, "pu", "gain of the inner regulator", POSITIVE]
    TC: Annotated[float, "s", "lead of the first stage", NOT_NEGATIVE]
    TB: Annotated[float, "s", "lag of the first stage", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "regulator limit"]
    VRmin: Annotated[float, "pu", "regulator limit"]
    KG: Annotated[float, "pu", "inner feedback gain", NOT_NEGATIVE]
    KP: Annotated[float, "pu", "gain of the potential source", POSITIVE]
    KI: Annotated[float, "pu", "gain of the current source", NOT_NEGATIVE]
    VBmax: Annotated[float, "pu", "limit of the source"]
    KC: Annotated[float, "pu", "rectifier loading, proportional to the commutating reactance", NOT_NEGATIVE]
    XL: Annotated[float, "pu", "reactance of the potential source", NOT_NEGATIVE]
    VGmax: Annotated[float, "pu", "inner feedback limit"]
    THETAP: Annotated[float, "-", "angle of the potential source, degrees"]
    TM: Annotated[float, "s", "inner regulator lag", NOT_NEGATIVE]
    VMmax: Annotated[float, "pu", "inner regulator limit"]
    VMmin: Annotated[float, "pu", "inner regulator limit"]

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        if self.KG > 0 and self.TM < SHORT:
            yield "TM", f"must be at least {SHORT:g} s with an inner feedback KG = {self.KG:g}"


class State(NamedTuple):
    """Transducer, first stage, regulator and inner regulator."""

    vc: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged control error"]
    vr: Annotated[float, "pu", "regulator output"]
    vm: Annotated[float, "pu", "inner regulator output"]


@inline
def equations(x, u, v, p):
    """Field voltage Efd = VM VB (pu), and state derivatives (1/s)."""
    vc, d_vc = lag(p.TR, u.vt, x.vc)
    va, d_va = lead_lag(p.TC, p.TB, clip(u.Vref - vc + u.Vs, p.VImin, p.VImax), x.va)
    vr, d_vr = lag(p.TA, p.KA * va, x.vr)
    vr = clip(vr, p.VRmin, p.VRmax)
    vm = clip(x.vm if p.TM >= SHORT else p.KM * vr, p.VMmin, p.VMmax)
    vb = at_most(rectified(compound(v, u, p.KP, p.THETAP, p.KI, p.XL), p.KC, u.Ifd), p.VBmax)
    efd = vm * vb
    d_vm = lag_rate(p.TM, p.KM * (vr - at_most(p.KG * efd, p.VGmax)), x.vm)
    return Output(efd), State(vc=d_vc, va=d_va, vr=d_vr, vm=d_vm)
