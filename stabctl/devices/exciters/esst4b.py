"""ESST4B: static exciter with a compound source and two PI regulators (IEEE type ST4B).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [KPR + KIR/s], limited VRmin..VRmax -> [1/(1+sTA)] -> VA
VA - KG Efd -> [KPM + KIM/s], limited VMmin..VMmax -> VM;  Efd = VM VB
VE = |KP Vt + j (KI + KP XL) It|, KP at the angle THETAP;  VB = min(VBmax, VE FEX(KC Ifd/VE))

The gates for excitation limiters are not represented.
Source: IEEE Std 421.5, type ST4B; PSS/E Model Library, ESST4B.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import at_most, clip, compound, integral, lag, pi, rectified

from .shared import CompoundInput as Input
from .shared import Output, gains

NAME = "ESST4B"
ROLE = "exciter"
LEVELS = ("VBmax",)
DYR = {"ESST4B": "TR KPR KIR VRmax VRmin TA KPM KIM VMmax VMmin KG KP KI VBmax KC XL THETAP"}
__all__ = ["DYR", "LEVELS", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations"]


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KPR: Annotated[float, "pu", "proportional gain of the regulator", NOT_NEGATIVE]
    KIR: Annotated[float, "1/s", "integral gain of the regulator", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "regulator limit"]
    VRmin: Annotated[float, "pu", "regulator limit"]
    TA: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
    KPM: Annotated[float, "pu", "proportional gain of the inner regulator", NOT_NEGATIVE]
    KIM: Annotated[float, "1/s", "integral gain of the inner regulator", NOT_NEGATIVE]
    VMmax: Annotated[float, "pu", "inner regulator limit"]
    VMmin: Annotated[float, "pu", "inner regulator limit"]
    KG: Annotated[float, "pu", "inner feedback gain", NOT_NEGATIVE]
    KP: Annotated[float, "pu", "gain of the potential source", POSITIVE]
    KI: Annotated[float, "pu", "gain of the current source", NOT_NEGATIVE]
    VBmax: Annotated[float, "pu", "limit of the source"]
    KC: Annotated[float, "pu", "rectifier loading, proportional to the commutating reactance", NOT_NEGATIVE]
    XL: Annotated[float, "pu", "reactance of the potential source", NOT_NEGATIVE]
    THETAP: Annotated[float, "-", "angle of the potential source, degrees"]

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        return gains(self, ("KPR", "KIR"), ("KPM", "KIM"))


class State(NamedTuple):
    """Transducer, regulator, its lag and inner regulator."""

    vc: Annotated[float, "pu", "measured terminal voltage"]
    vr: Annotated[float, "pu", "integral of the regulator"]
    va: Annotated[float, "pu", "lagged regulator output"]
    vm: Annotated[float, "pu", "integral of the inner regulator"]


@inline
def equations(x, u, v, p):
    """Field voltage (pu), and state derivatives (1/s); VM = KPM (VA - KG VM VB) + integral is solved for VM."""
    vc, d_vc = lag(p.TR, u.vt, x.vc)
    vr, d_vr = pi(p.KPR, p.KIR, u.Vref - vc + u.Vs, integral(p.KIR, x.vr), p.VRmin, p.VRmax)
    va, d_va = lag(p.TA, vr, x.va)
    vb = at_most(rectified(compound(v, u, p.KP, p.THETAP, p.KI, p.XL), p.KC, u.Ifd), p.VBmax)
    rest = integral(p.KIM, x.vm)
    efd = vb * clip((p.KPM * va + rest) / (1 + p.KPM * p.KG * vb), p.VMmin, p.VMmax)
    _, d_vm = pi(p.KPM, p.KIM, va - p.KG * efd, rest, p.VMmin, p.VMmax)
    return Output(efd), State(vc=d_vc, vr=d_vr, va=d_va, vm=d_vm)
