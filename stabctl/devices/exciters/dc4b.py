"""DC4B: DC exciter with a PID regulator supplied by the terminals (IEEE type DC4B).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [KP + KI/s + sKD/(1+sTD)], limited VRmin/KA..VRmax/KA -> x Vt -> [KA/(1+sTA)] -> VR
       (-) [sKF/(1+sTF)] <- Efd
Vt VRmin <= VR <= Vt VRmax;  VR -> (+) -> [1/(sTE)] >= VEmin -> Efd
                                  (-) (KE + SE(Efd)) Efd

SE(Efd) Efd = B (Efd - A)^2 through (E1, SE1) and (E2, SE2); SE2 = 0 means no saturation. KE = 0 is computed at the
start: KE = VRmax/(10 Efd) - SE(Efd). The inputs for excitation limiters are not represented.
Source: IEEE Std 421.5-2005, type DC4B; PSS/E Model Library, DC4B.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, derivative, field_demand, integral, lag, pi

from . import dc, shared
from .dc import automatic, output
from .shared import Input, Output, prepare

NAME = "DC4B"
ROLE = "exciter"
LIMITS = {"vr": ("VRmin", "VRmax", "vt"), "efd": ("VEmin", np.inf)}
DYR = {"DC4B": "_OEL _UEL TR KP KI KD TD VRmax VRmin KA TA KE TE KF TF VEmin E1 SE1 E2 SE2"}
__all__ = [
    "DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "automatic", "derivatives", "from_record",
    "output", "prepare",
]  # fmt: skip


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KP: Annotated[float, "pu", "proportional gain", NOT_NEGATIVE]
    KI: Annotated[float, "1/s", "integral gain", NOT_NEGATIVE]
    KD: Annotated[float, "s", "derivative gain", NOT_NEGATIVE]
    TD: Annotated[float, "s", "lag of the derivative (0: no derivative)", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "regulator limit at 1 pu terminal voltage"]
    VRmin: Annotated[float, "pu", "regulator limit at 1 pu terminal voltage"]
    KA: Annotated[float, "pu", "gain of the power stage", POSITIVE]
    TA: Annotated[float, "s", "lag of the power stage", NOT_NEGATIVE]
    KE: Annotated[float, "pu", "exciter constant (0: computed at the start)"]
    TE: Annotated[float, "s", "exciter time constant", Ge(1e-3)]
    KF: Annotated[float, "pu", "stabilizing feedback gain", NOT_NEGATIVE]
    TF: Annotated[float, "s", "stabilizing feedback lag (0: no feedback)", NOT_NEGATIVE]
    VEmin: Annotated[float, "pu", "lowest field voltage"] = 0.0
    E1: Annotated[float, "pu", "field voltage of SE1", NOT_NEGATIVE] = 3.0
    SE1: Annotated[float, "pu", "saturation at E1", NOT_NEGATIVE] = 0.0
    E2: Annotated[float, "pu", "field voltage of SE2", NOT_NEGATIVE] = 4.0
    SE2: Annotated[float, "pu", "saturation at E2 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    SA: Annotated[float, "pu", "field voltage at which saturation begins, from the two points", FROM_CASE] = 0.0
    SB: Annotated[float, "1/pu", "slope of saturation, from the two points", FROM_CASE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        yield from shared.gains(self, ("KP", "KI"))
        yield from shared.errors(self)


class State(NamedTuple):
    """Transducer, integral and derivative of the regulator, power stage, exciter and stabilizing feedback."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    vi: Annotated[float, "pu", "integral of the regulator"]
    vd: Annotated[float, "pu", "lagged control error of the derivative"]
    vr: Annotated[float, "pu", "output of the power stage"]
    efd: Annotated[float, "pu", "field voltage"]
    vf: Annotated[float, "pu", "lagged field voltage of the feedback"]


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    vf, d_vf = derivative(p.KF, p.TF, x.efd, x.vf)
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    error = u.Vref - vm + u.Vs - vf
    vd, d_vd = derivative(p.KD, p.TD, error, x.vd)
    rest = integral(p.KI, x.vi) + vd
    _, d_vi = pi(p.KP, p.KI, error, rest, p.VRmin / p.KA, p.VRmax / p.KA)
    vr, d_vr = lag(p.TA, u.vt * clip(p.KA * (p.KP * error + rest), p.VRmin, p.VRmax), x.vr)
    drive = clip(vr, u.vt * p.VRmin, u.vt * p.VRmax)
    d_efd = (drive - field_demand(x.efd, p.KE, p.SA, p.SB)) / p.TE
    return State(vm=d_vm, vi=d_vi, vd=d_vd, vr=d_vr, efd=d_efd, vf=d_vf)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected."""
    values, said = dc.computed(values)
    return Par(**values), said
