"""AC8B: alternator with uncontrolled rectifier, PID regulator and a limit of the exciter field (IEEE type AC8B).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [KPR + KIR/s + sKDR/(1+sTDR)], limited VPIDmin..VPIDmax -> [KA/(1+sTA)], held VRmin..VRmax
   -> (+) -> [1/(sTE)] -> VE >= VEmin;  Efd = VE FEX(KC Ifd/VE)
      (-) VFE = (KE + SE(VE)) VE + KD Ifd, at most VFEmax

SE(VE) VE = B (VE - A)^2 through (E1, SE1) and (E2, SE2). The integral stops while the limited sum is driven beyond its
limit. VFE comes to VFEmax through a lag of 10 ms, so that it does not pass it; in the source it stops there. (Where
VFE rises more slowly than VE, it is VE that moves with 10 ms.)
Source: IEEE Std 421.5-2005, type AC8B; PSS/E Model Library, AC8B.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import at_least, at_most, clip, derivative, integral, lag, pi, rectified

from . import shared
from .ac import load
from .shared import LoadedInput as Input
from .shared import Output, prepare

NAME = "AC8B"
ROLE = "exciter"
STOP = 100.0  # 1/s   how fast VFE comes to its limit
LIMITS = {"vr": ("VRmin", "VRmax"), "ve": ("VEmin", np.inf)}
DYR = {
    "AC8B": "TR KPR KIR KDR TDR VPIDmax VPIDmin VRmax VRmin VFEmax VEmin TA KA TE KC KD KE E1 SE1 E2 SE2",
}
__all__ = [
    "DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations", "from_record", "guess", "prepare",
]  # fmt: skip


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KPR: Annotated[float, "pu", "proportional gain", NOT_NEGATIVE]
    KIR: Annotated[float, "1/s", "integral gain", NOT_NEGATIVE]
    KDR: Annotated[float, "s", "derivative gain", NOT_NEGATIVE]
    TDR: Annotated[float, "s", "lag of the derivative (0: no derivative)", NOT_NEGATIVE]
    VPIDmax: Annotated[float, "pu", "limit of the PID regulator"]
    VPIDmin: Annotated[float, "pu", "limit of the PID regulator"]
    KA: Annotated[float, "pu", "amplifier gain", POSITIVE]
    TA: Annotated[float, "s", "amplifier lag", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "amplifier limit"]
    VRmin: Annotated[float, "pu", "amplifier limit"]
    TE: Annotated[float, "s", "exciter time constant", Ge(1e-3)]
    VFEmax: Annotated[float, "pu", "limit of the exciter field"]
    VEmin: Annotated[float, "pu", "lowest exciter voltage", NOT_NEGATIVE]
    KC: Annotated[float, "pu", "rectifier loading, proportional to the commutating reactance", NOT_NEGATIVE]
    KD: Annotated[float, "pu", "demagnetization by the field current", NOT_NEGATIVE]
    KE: Annotated[float, "pu", "exciter constant", POSITIVE]
    E1: Annotated[float, "pu", "exciter voltage of SE1", NOT_NEGATIVE] = 3.0
    SE1: Annotated[float, "pu", "saturation at E1", NOT_NEGATIVE] = 0.0
    E2: Annotated[float, "pu", "exciter voltage of SE2", NOT_NEGATIVE] = 4.0
    SE2: Annotated[float, "pu", "saturation at E2 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    SA: Annotated[float, "pu", "exciter voltage at which saturation begins, from the two points", FROM_CASE] = 0.0
    SB: Annotated[float, "1/pu", "slope of saturation, from the two points", FROM_CASE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        yield from shared.gains(self, ("KPR", "KIR"))
        yield from shared.errors(self)


class State(NamedTuple):
    """Transducer, integral and derivative of the regulator, amplifier and exciter."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    vi: Annotated[float, "pu", "integral of the regulator"]
    vd: Annotated[float, "pu", "lagged control error of the derivative"]
    vr: Annotated[float, "pu", "amplifier output"]
    ve: Annotated[float, "pu", "exciter voltage"]


@inline
def equations(x, u, p):
    """Field voltage Efd = VE FEX(KC Ifd/VE) (pu), and state derivatives (1/s)."""
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    error = u.Vref - vm + u.Vs
    vd, d_vd = derivative(p.KDR, p.TDR, error, x.vd)
    pid, d_vi = pi(p.KPR, p.KIR, error, integral(p.KIR, x.vi) + vd, p.VPIDmin, p.VPIDmax)
    vr, d_vr = lag(p.TA, p.KA * pid, x.vr)
    vfe = load(x, u, p)
    slope = at_least(p.KE + 2 * p.SB * at_least(x.ve - p.SA, 0.0), 1.0)  # of VFE; STOP is the rate of VFE, not of VE
    d_ve = at_most((clip(vr, p.VRmin, p.VRmax) - vfe) / p.TE, STOP * (p.VFEmax - vfe) / slope)
    return Output(rectified(x.ve, p.KC, u.Ifd)), State(vm=d_vm, vi=d_vi, vd=d_vd, vr=d_vr, ve=d_ve)


def guess(V, I, p):
    """Initial guess: a voltage at which the rectifier is not overloaded."""
    return State(1.0, 1.0, 0.0, 10.0, 10.0)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected."""
    values, said = shared.ordered(values)
    return Par(**values), said
