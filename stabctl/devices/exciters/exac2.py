"""EXAC2: high-response alternator with uncontrolled rectifier (IEEE type AC2, 1981).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [(1+sTC)/(1+sTB)] -> [KA/(1+sTA)], held VAmin..VAmax -> VA
      (-) [sKF/(1+sTF)] <- VFE
min(VA - KH VFE, KL (VLR - VFE)) -> [KB] -> limited VRmin..VRmax -> (+) -> [1/(sTE)] >= 0 -> VE
                                                                    (-) VFE

VFE = (KE + SE(VE)) VE + KD Ifd;  Efd = VE FEX(KC Ifd/VE);  SE(VE) VE = B (VE - A)^2 through (E1, SE1) and (E2, SE2),
SE2 = 0 means no saturation.
Source: IEEE Committee Report, Excitation system models for power system stability studies, IEEE Trans. PAS-100 (1981),
type AC2; PSS/E Model Library, EXAC2.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, low_value

from . import shared
from .ac import State, excited, guess, regulated
from .shared import LoadedInput as Input
from .shared import Output, prepare

NAME = "EXAC2"
ROLE = "exciter"
LIMITS = {"vr": ("VAmin", "VAmax"), "ve": (0.0, np.inf)}
UPPER = ("VLR",)
DYR = {"EXAC2": "TR TB TC KA TA VAmax VAmin KB VRmax VRmin TE KL KH KF TF KC KD KE VLR E1 SE1 E2 SE2"}
__all__ = [
    "DYR", "LIMITS", "NAME", "ROLE", "UPPER", "Input", "Output", "Par", "State", "equations", "from_record", "guess",
    "prepare",
]  # fmt: skip


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    TB: Annotated[float, "s", "lag of the first stage", NOT_NEGATIVE]
    TC: Annotated[float, "s", "lead of the first stage", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
    VAmax: Annotated[float, "pu", "regulator limit"]
    VAmin: Annotated[float, "pu", "regulator limit"]
    KB: Annotated[float, "pu", "gain of the second stage", POSITIVE]
    VRmax: Annotated[float, "pu", "limit of the voltage at the field of the exciter"]
    VRmin: Annotated[float, "pu", "limit of the voltage at the field of the exciter"]
    TE: Annotated[float, "s", "exciter time constant", Ge(1e-3)]
    KL: Annotated[float, "pu", "gain of the field current limiter", NOT_NEGATIVE]
    KH: Annotated[float, "pu", "feedback of the field of the exciter", NOT_NEGATIVE]
    KF: Annotated[float, "pu", "stabilizing feedback gain", NOT_NEGATIVE]
    TF: Annotated[float, "s", "stabilizing feedback lag (0: no feedback)", NOT_NEGATIVE]
    KC: Annotated[float, "pu", "rectifier loading, proportional to the commutating reactance", NOT_NEGATIVE]
    KD: Annotated[float, "pu", "demagnetizing effect of the field current", NOT_NEGATIVE]
    KE: Annotated[float, "pu", "exciter constant"]
    VLR: Annotated[float, "pu", "reference of the field current limiter"]
    E1: Annotated[float, "pu", "exciter voltage of SE1", NOT_NEGATIVE] = 3.0
    SE1: Annotated[float, "pu", "saturation at E1", NOT_NEGATIVE] = 0.0
    E2: Annotated[float, "pu", "exciter voltage of SE2", NOT_NEGATIVE] = 4.0
    SE2: Annotated[float, "pu", "saturation at E2 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    SA: Annotated[float, "pu", "voltage at which saturation begins, from the two points", FROM_CASE] = 0.0
    SB: Annotated[float, "1/pu", "slope of saturation, from the two points", FROM_CASE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        yield from shared.errors(self)


@inline
def equations(x, u, p):
    """Field voltage Efd (pu), and state derivatives (1/s)."""
    vr, vfe, d = regulated(x, u, p)
    drive = p.KB * low_value(clip(vr, p.VAmin, p.VAmax) - p.KH * vfe, p.KL * (p.VLR - vfe))
    return excited(x, u, clip(drive, p.VRmin, p.VRmax), vfe, d, p)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected."""
    values, said = shared.ordered(values)
    return Par(**values), said
