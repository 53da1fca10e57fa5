"""EXPIC1: exciter with a proportional and integral regulator, static or rotating.

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [KA (1+sTA1)/s], limited VAmin..VAmax -> [(1+sTA3)/((1+sTA2)(1+sTA4))], limited VRmin..VRmax
       (-) [sKF/((1+sTF1)(1+sTF2))] <- Efd                                                       |
                                      x VB -> limited Efdmin..Efdmax -> (+) -> [1/(sTE)] -> Efd
                                                                        (-) (KE + SE(Efd)) Efd

VE = |KP Vt + j KI It|;  VB = VE FEX(KC Ifd/VE), 1 if KP = KI = 0. With TE = 0 the exciter is static: Efd is the limited
signal. SE(Efd) Efd = B (Efd - A)^2 through (E1, SE1) and (E2, SE2); SE2 = 0 means no saturation.
Source: PSS/E Model Library, EXPIC1 (there VR1, VR2 are the limits VAmax, VAmin).
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import (
    SHORT,
    clip,
    compound,
    derivative,
    field_demand,
    lag,
    lag_rate,
    lead_lag,
    pi,
    rectified,
)

from . import shared
from .shared import CompoundInput as Input
from .shared import Output, prepare

NAME = "EXPIC1"
ROLE = "exciter"
DYR = {
    "EXPIC1": "TR KA TA1 VAmax VAmin TA2 TA3 TA4 VRmax VRmin KF TF1 TF2 Efdmax Efdmin KE TE E1 SE1 E2 SE2 KP KI KC",
}
__all__ = [
    "DYR", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations", "from_record", "prepare",
]  # fmt: skip


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KA: Annotated[float, "1/s", "integral gain of the regulator", POSITIVE]
    TA1: Annotated[float, "s", "lead of the regulator", NOT_NEGATIVE]
    VAmax: Annotated[float, "pu", "limit of the regulator"]
    VAmin: Annotated[float, "pu", "limit of the regulator"]
    TA2: Annotated[float, "s", "first lag of the second stage", NOT_NEGATIVE]
    TA3: Annotated[float, "s", "lead of the second stage", NOT_NEGATIVE]
    TA4: Annotated[float, "s", "second lag of the second stage", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "limit of the second stage"]
    VRmin: Annotated[float, "pu", "limit of the second stage"]
    KF: Annotated[float, "pu", "stabilizing feedback gain", NOT_NEGATIVE]
    TF1: Annotated[float, "s", "first feedback lag (0: no feedback)", NOT_NEGATIVE]
    TF2: Annotated[float, "s", "second feedback lag", NOT_NEGATIVE]
    Efdmax: Annotated[float, "pu", "limit of the voltage at the exciter"]
    Efdmin: Annotated[float, "pu", "limit of the voltage at the exciter"]
    KE: Annotated[float, "pu", "exciter constant"]
    TE: Annotated[float, "s", "exciter time constant (0: static)", NOT_NEGATIVE]
    E1: Annotated[float, "pu", "field voltage of SE1", NOT_NEGATIVE] = 3.0
    SE1: Annotated[float, "pu", "saturation at E1", NOT_NEGATIVE] = 0.0
    E2: Annotated[float, "pu", "field voltage of SE2", NOT_NEGATIVE] = 4.0
    SE2: Annotated[float, "pu", "saturation at E2 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    KP: Annotated[float, "pu", "gain of the potential source", NOT_NEGATIVE] = 0.0
    KI: Annotated[float, "pu", "gain of the current source", NOT_NEGATIVE] = 0.0
    KC: Annotated[float, "pu", "rectifier loading, proportional to the commutating reactance", NOT_NEGATIVE] = 0.0
    SA: Annotated[float, "pu", "field voltage at which saturation begins, from the two points", FROM_CASE] = 0.0
    SB: Annotated[float, "1/pu", "slope of saturation, from the two points", FROM_CASE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        if self.KF > 0 and self.TF1 >= SHORT > max(self.TE, self.TF2):
            yield "TF2", f"must be at least {SHORT:g} s with a feedback KF = {self.KF:g} of a static exciter"
        yield from shared.errors(self)


class State(NamedTuple):
    """Transducer, regulator, two lags, exciter, and the two lags of the feedback."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "integral of the regulator"]
    vb: Annotated[float, "pu", "lagged signal of the second stage"]
    vr: Annotated[float, "pu", "output of the second stage"]
    efd: Annotated[float, "pu", "field voltage"]
    vf: Annotated[float, "pu", "lagged field voltage of the feedback"]
    damping: Annotated[float, "pu", "stabilizing feedback"]


@inline
def supply(u, v, p):
    """Voltage VB of the rectifier (pu)."""
    if p.KP == 0 and p.KI == 0:
        return 1.0 + 0 * u.Ifd
    return rectified(compound(v, u, p.KP, 0.0, p.KI, 0.0), p.KC, u.Ifd)


@inline
def equations(x, u, v, p):
    """Field voltage Efd (pu), and state derivatives (1/s); feedback with one lag alone is that of the exciter state."""
    damping = x.damping if p.TF2 >= SHORT else derivative(p.KF, p.TF1, x.efd, x.vf)[0]
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    va, d_va = pi(p.KA * p.TA1, p.KA, u.Vref - vm + u.Vs - damping, x.va, p.VAmin, p.VAmax)
    vb, d_vb = lead_lag(p.TA3, p.TA2, va, x.vb)
    vr, d_vr = lag(p.TA4, vb, x.vr)
    drive = clip(clip(vr, p.VRmin, p.VRmax) * supply(u, v, p), p.Efdmin, p.Efdmax)
    if p.TE >= SHORT:
        efd, d_efd = x.efd, (drive - field_demand(x.efd, p.KE, p.SA, p.SB)) / p.TE
    else:
        efd, d_efd = drive, 0 * x.efd
    vf, d_vf = derivative(p.KF, p.TF1, efd, x.vf)
    d_damping = lag_rate(p.TF2, vf, x.damping)
    return Output(efd), State(vm=d_vm, va=d_va, vb=d_vb, vr=d_vr, efd=d_efd, vf=d_vf, damping=d_damping)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected."""
    values, said = shared.ordered(values)
    return Par(**values), said
