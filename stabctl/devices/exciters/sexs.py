"""SEXS: simplified static exciter (PST type 0).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [(1+sTC)/(1+sTB)] -> [KA/(1+sTA)], held between Efdmin and Efdmax -> Efd

Source: simple exciter of the Power System Toolbox (PST): J. Chow, K. Cheung, IEEE Trans. Power Syst. 7 (1992). It is
also the SEXS of PSS/E, whose TA, TB, K, TE are TC, TB, KA, TA here.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, lag, lead_lag

from .shared import Input, Output

NAME = "SEXS"
ROLE = "exciter"
LIMITS = {"efd": ("Efdmin", "Efdmax")}
DYR = {"SEXS": "TA_over_TB TB K TE EMIN EMAX"}
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations", "from_record"]


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
    TB: Annotated[float, "s", "transient gain reduction, lag", NOT_NEGATIVE] = 0.0
    TC: Annotated[float, "s", "transient gain reduction, lead", NOT_NEGATIVE] = 0.0
    Efdmax: Annotated[float, "pu", "field voltage limit"] = 5.0
    Efdmin: Annotated[float, "pu", "field voltage limit"] = -5.0


class State(NamedTuple):
    """Transducer, lead-lag and regulator."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged control error"]
    efd: Annotated[float, "pu", "field voltage"]


@inline
def equations(x, u, p):
    """Field voltage Efd (pu), and state derivatives (1/s)."""
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    va, d_va = lead_lag(p.TC, p.TB, u.Vref - vm + u.Vs, x.va)
    efd, d_efd = lag(p.TA, p.KA * va, x.efd)
    return Output(clip(efd, p.Efdmin, p.Efdmax)), State(vm=d_vm, va=d_va, efd=d_efd)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected: nothing."""
    TB = values["TB"]
    par = Par(
        TR=0.0, KA=values["K"], TA=values["TE"], TB=TB, TC=values["TA_over_TB"] * TB,
        Efdmax=values["EMAX"], Efdmin=values["EMIN"],
    )  # fmt: skip
    return par, []
