"""EXST1: bus-fed static exciter with a limited control error (IEEE type ST1, 1981).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> VImin..VImax -> [(1+sTC)/(1+sTB)] -> [KA/(1+sTA)] -> VA, limited -> Efd
       (-) [sKF/(1+sTF)] <- VA

Vt VRmin - KC Ifd <= Efd <= Vt VRmax - KC Ifd
Source: IEEE Committee Report, Excitation system models for power system stability studies, IEEE Trans. PAS-100 (1981),
type ST1; PSS/E Model Library, EXST1.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import SHORT, clip, derivative, lag, lead_lag

from .shared import LoadedInput as Input
from .shared import Output

NAME = "EXST1"
ROLE = "exciter"
DYR = {"EXST1": "TR VImax VImin TC TB KA TA VRmax VRmin KC KF TF"}
__all__ = ["DYR", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations"]


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    VImax: Annotated[float, "pu", "error limit"]
    VImin: Annotated[float, "pu", "error limit"]
    TC: Annotated[float, "s", "lead of the first stage", NOT_NEGATIVE]
    TB: Annotated[float, "s", "lag of the first stage", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "ceiling at 1 pu terminal voltage without load"]
    VRmin: Annotated[float, "pu", "lower limit at 1 pu terminal voltage without load"]
    KC: Annotated[float, "pu", "fall of the limits with field current", NOT_NEGATIVE] = 0.0
    KF: Annotated[float, "pu", "stabilizing feedback gain", NOT_NEGATIVE] = 0.0
    TF: Annotated[float, "s", "stabilizing feedback lag (0: no feedback)", NOT_NEGATIVE] = 1.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        if self.KF > 0 and self.TF >= SHORT > self.TA:
            yield "TA", f"must be at least {SHORT:g} s with a feedback KF = {self.KF:g}"


class State(NamedTuple):
    """Transducer, first stage, regulator and stabilizing feedback."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged control error"]
    vr: Annotated[float, "pu", "regulator output"]
    vf: Annotated[float, "pu", "lagged regulator output of the feedback"]


@inline
def equations(x, u, p):
    """Field voltage Efd (pu), and state derivatives (1/s)."""
    vf, d_vf = derivative(p.KF, p.TF, x.vr, x.vf)
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    va, d_va = lead_lag(p.TC, p.TB, clip(u.Vref - vm + u.Vs - vf, p.VImin, p.VImax), x.va)
    vr, d_vr = lag(p.TA, p.KA * va, x.vr)
    drop = p.KC * u.Ifd
    efd = clip(vr + drop, u.vt * p.VRmin, u.vt * p.VRmax) - drop
    return Output(efd), State(vm=d_vm, va=d_va, vr=d_vr, vf=d_vf)
