"""ESAC6A: alternator with uncontrolled rectifier and a regulator supplied by the terminals (IEEE type AC6A).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [KA (1+sTK)/(1+sTA)] -> [(1+sTC)/(1+sTB)], limited VAmin..VAmax -> VA
VA - VH -> limited Vt VRmin..Vt VRmax -> (+) -> [1/(sTE)] >= 0 -> VE
                                         (-) VFE
VFE - VFELIM -> [KH (1+sTJ)/(1+sTH)], limited 0..VHmax -> VH

VFE = (KE + SE(VE)) VE + KD Ifd;  Efd = VE FEX(KC Ifd/VE);  SE(VE) VE = B (VE - A)^2 through (E1, SE1) and (E2, SE2),
SE2 = 0 means no saturation. The gate for an underexcitation limiter is not represented.
Source: IEEE Std 421.5, type AC6A; PSS/E Model Library, ESAC6A.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import at_least, at_most, clip, lag, lead_lag, rectified

from . import shared
from .ac import load
from .shared import LoadedInput as Input
from .shared import Output, prepare

NAME = "ESAC6A"
ROLE = "exciter"
LIMITS = {"ve": (0.0, np.inf)}
LEVELS = ("VFELIM", "VHmax")
DYR = {"ESAC6A": "TR KA TA TK TB TC VAmax VAmin VRmax VRmin TE VFELIM KH VHmax TH TJ KC KD KE E1 SE1 E2 SE2"}
__all__ = [
    "DYR", "LEVELS", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations", "from_record", "guess",
    "prepare",
]  # fmt: skip


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "lag of the first stage", NOT_NEGATIVE]
    TK: Annotated[float, "s", "lead of the first stage", NOT_NEGATIVE]
    TB: Annotated[float, "s", "lag of the second stage", NOT_NEGATIVE]
    TC: Annotated[float, "s", "lead of the second stage", NOT_NEGATIVE]
    VAmax: Annotated[float, "pu", "regulator limit"]
    VAmin: Annotated[float, "pu", "regulator limit"]
    VRmax: Annotated[float, "pu", "limit of the voltage at the field of the exciter, at 1 pu terminal voltage"]
    VRmin: Annotated[float, "pu", "limit of the voltage at the field of the exciter, at 1 pu terminal voltage"]
    TE: Annotated[float, "s", "exciter time constant", Ge(1e-3)]
    VFELIM: Annotated[float, "pu", "field of the exciter above which its limiter acts"]
    KH: Annotated[float, "pu", "gain of the field current limiter", NOT_NEGATIVE]
    VHmax: Annotated[float, "pu", "largest signal of the field current limiter", NOT_NEGATIVE]
    TH: Annotated[float, "s", "lag of the field current limiter", NOT_NEGATIVE]
    TJ: Annotated[float, "s", "lead of the field current limiter", NOT_NEGATIVE]
    KC: Annotated[float, "pu", "rectifier loading, proportional to the commutating reactance", NOT_NEGATIVE]
    KD: Annotated[float, "pu", "demagnetizing effect of the field current", NOT_NEGATIVE]
    KE: Annotated[float, "pu", "exciter constant"]
    E1: Annotated[float, "pu", "exciter voltage of SE1", NOT_NEGATIVE] = 3.0
    SE1: Annotated[float, "pu", "saturation at E1", NOT_NEGATIVE] = 0.0
    E2: Annotated[float, "pu", "exciter voltage of SE2", NOT_NEGATIVE] = 4.0
    SE2: Annotated[float, "pu", "saturation at E2 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    SA: Annotated[float, "pu", "voltage at which saturation begins, from the two points", FROM_CASE] = 0.0
    SB: Annotated[float, "1/pu", "slope of saturation, from the two points", FROM_CASE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        yield from shared.errors(self)


class State(NamedTuple):
    """Transducer, two stages, exciter and field current limiter."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged control error"]
    vb: Annotated[float, "pu", "lagged signal of the second stage"]
    ve: Annotated[float, "pu", "exciter voltage"]
    vh: Annotated[float, "pu", "lagged excess of the field current limiter"]


@inline
def equations(x, u, p):
    """Field voltage Efd = VE FEX(KC Ifd/VE) (pu), and state derivatives (1/s)."""
    vfe = load(x, u, p)
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    va, d_va = lead_lag(p.TK, p.TA, u.Vref - vm + u.Vs, x.va)
    vb, d_vb = lead_lag(p.TC, p.TB, p.KA * va, x.vb)
    vh, d_vh = lead_lag(p.TJ, p.TH, vfe - p.VFELIM, x.vh)
    vh = at_most(at_least(p.KH * vh, 0.0), p.VHmax)
    drive = clip(clip(vb, p.VAmin, p.VAmax) - vh, u.vt * p.VRmin, u.vt * p.VRmax)
    rates = State(vm=d_vm, va=d_va, vb=d_vb, ve=(drive - vfe) / p.TE, vh=d_vh)
    return Output(rectified(x.ve, p.KC, u.Ifd)), rates


def guess(V, I, p):
    """Initial guess: a voltage at which the rectifier is not overloaded."""
    return State(1.0, 1.0, 1.0, 10.0, 10.0)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected."""
    values, said = shared.ordered(values)
    return Par(**values), said
