"""EXST3: static exciter with a compound source and an inner field-voltage loop (IEEE type ST3, 1981).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> VI limits -> KJ (1+sTC)/(1+sTB) -> (+) -> [KA/(1+sTA)], held VRmin..VRmax -> x VB -> Efd
                                                               (-) min(VGmax, KG Efd)

VE = |KP Vt + j (KI + KP XL) It|, KP at the angle THETAP;  VB = VE FEX(KC Ifd/VE);  Efd <= Emax. Without a current
source (KI = XL = 0), Vt is the supply voltage of the machine, without the speed factor of its source.
Source: IEEE Committee Report, Excitation system models for power system stability studies, IEEE Trans. PAS-100 (1981),
type ST3; IEEE Std 421.5, type ST3A; PSS/E Model Library, EXST3.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import SHORT, clip, compound, lag, lag_rate, lead_lag, rectified
from stabctl.devices.ports import PORT, SUM

from .shared import Output

NAME = "EXST3"
ROLE = "exciter"
LIMITS = {"vr": ("VRmin", "VRmax")}
LEVELS = ("VGmax",)
DYR = {"EXST3": "TR VImax VImin KJ TC TB KA TA VRmax VRmin KG KP KI Emax KC XL VGmax THETAP"}
__all__ = ["DYR", "LEVELS", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations"]


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
    KI: Annotated[float, "pu", "gain of the current source", NOT_NEGATIVE] = 0.0
    XL: Annotated[float, "pu", "reactance of the potential source", NOT_NEGATIVE] = 0.0
    THETAP: Annotated[float, "-", "angle of the potential source, degrees"] = 0.0
    KC: Annotated[float, "pu", "rectifier loading, proportional to the commutating reactance", NOT_NEGATIVE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        if self.KG > 0 and self.TA < SHORT:
            yield "TA", f"must be at least {SHORT:g} s with an inner feedback KG = {self.KG:g}"


class State(NamedTuple):
    """Transducer, first stage and regulator."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged error of the first stage"]
    vr: Annotated[float, "pu", "regulator output"]


class Input(NamedTuple):
    """Signals at an exciter whose source is fed by terminal voltage and current."""

    Vref: Annotated[float, "pu", "voltage reference", PORT]
    Vs: Annotated[float, "pu", "stabilizing signal", SUM]
    vt: Annotated[float, "pu", "terminal voltage"]
    ve: Annotated[float, "pu", "supply voltage of the rectifier"]
    Ifd: Annotated[float, "pu", "field current"]
    delta: Annotated[float, "rad", "rotor angle"]
    id: Annotated[float, "pu", "current, d axis"]
    iq: Annotated[float, "pu", "current, q axis"]


@inline
def equations(x, u, v, p):
    """Field voltage Efd = min(VR VB, Emax) (pu), and state derivatives (1/s)."""
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    va, d_va = lead_lag(p.TC, p.TB, p.KJ * clip(u.Vref - vm + u.Vs, p.VImin, p.VImax), x.va)
    vr = clip(x.vr if p.TA >= SHORT else p.KA * va, p.VRmin, p.VRmax)
    ve = p.KP * u.ve if p.KI == 0 and p.XL == 0 else compound(v, u, p.KP, p.THETAP, p.KI, p.XL)
    efd = clip(vr * rectified(ve, p.KC, u.Ifd), -p.Emax, p.Emax)
    d_vr = lag_rate(p.TA, p.KA * (va - clip(p.KG * efd, -p.VGmax, p.VGmax)), x.vr)
    return Output(efd), State(vm=d_vm, va=d_va, vr=d_vr)
