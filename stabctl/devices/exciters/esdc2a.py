"""ESDC2A: DC exciter with a regulator supplied by the terminals (IEEE type DC2A), whose voltage is never negative.

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [(1+sTC)/(1+sTB)] -> [KA/(1+sTA)], held Vt VRmin..Vt VRmax -> (+) -> [1/(sTE)] >= 0 -> Efd
       (-) [sKF/(1+sTF)] <- Efd                                                           (-) (KE + SE(Efd)) Efd

An EXDC2 with a lower limit; its gate for an underexcitation limiter is not represented.
Source: IEEE Std 421.5, type DC2A; PSS/E Model Library, ESDC2A.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE

from . import dc, shared
from .dc import State, automatic, output, rates
from .shared import Input, Output, prepare

NAME = "ESDC2A"
ROLE = "exciter"
LIMITS = {"vr": ("VRmin", "VRmax", "vt"), "efd": (0.0, np.inf)}
DYR = {"ESDC2A": "TR KA TA TB TC VRmax VRmin KE TE KF TF _switch E1 SE1 E2 SE2"}
__all__ = [
    "DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par",
    "State", "automatic", "derivatives", "from_record", "output", "prepare",
]  # fmt: skip


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
    TB: Annotated[float, "s", "lag of the first stage", NOT_NEGATIVE]
    TC: Annotated[float, "s", "lead of the first stage", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "regulator limit at 1 pu terminal voltage"]
    VRmin: Annotated[float, "pu", "regulator limit at 1 pu terminal voltage"]
    KE: Annotated[float, "pu", "exciter constant (0: computed at the start)"]
    TE: Annotated[float, "s", "exciter time constant", Ge(1e-3)]
    KF: Annotated[float, "pu", "stabilizing feedback gain", NOT_NEGATIVE]
    TF: Annotated[float, "s", "stabilizing feedback lag (0: no feedback)", NOT_NEGATIVE] = 1.0
    E1: Annotated[float, "pu", "field voltage of SE1", NOT_NEGATIVE] = 3.0
    SE1: Annotated[float, "pu", "saturation at E1", NOT_NEGATIVE] = 0.0
    E2: Annotated[float, "pu", "field voltage of SE2", NOT_NEGATIVE] = 4.0
    SE2: Annotated[float, "pu", "saturation at E2 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    SA: Annotated[float, "pu", "field voltage at which saturation begins, from the two points", FROM_CASE] = 0.0
    SB: Annotated[float, "1/pu", "slope of saturation, from the two points", FROM_CASE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        yield from shared.errors(self)


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    return rates(x, u, p, u.vt)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected."""
    values, said = dc.computed(values)
    return Par(**values), said
