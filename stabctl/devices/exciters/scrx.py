"""SCRX: static exciter, fed by its bus or by a constant source.

Vref + Vs - Vt -> [(1+sTC)/(1+sTB)] -> [K/(1+sTE)], held between Emin and Emax -> x Vt or x 1 -> Efd

Where `resistor` > 0, the field current cannot reverse through the bridge: it then flows through a resistor, and
Efd = -resistor Ifd.
Source: PSS/E Model Library, SCRX; IEEE Std 421.5, type AC4A.
"""

from typing import Annotated, NamedTuple

from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, crowbar, lag, lead_lag

from .shared import LoadedInput as Input
from .shared import Output

NAME = "SCRX"
ROLE = "exciter"
LIMITS = {"vr": ("Emin", "Emax")}
DYR = {"SCRX": "TA_over_TB TB K TE Emin Emax switch resistor"}
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations", "from_record"]


class Par(NamedTuple):
    """Parameters of one exciter."""

    K: Annotated[float, "pu", "gain", POSITIVE]
    TE: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
    TB: Annotated[float, "s", "transient gain reduction, lag", NOT_NEGATIVE] = 0.0
    TC: Annotated[float, "s", "transient gain reduction, lead", NOT_NEGATIVE] = 0.0
    Emax: Annotated[float, "pu", "limit of the regulator"] = 5.0
    Emin: Annotated[float, "pu", "limit of the regulator"] = -5.0
    switch: Annotated[int, "-", "0: fed by its bus, 1: by a constant source", Interval(ge=0, le=1)] = 0
    resistor: Annotated[float, "-", "resistor over field resistance (0: the bridge reverses)", NOT_NEGATIVE] = 0.0


class State(NamedTuple):
    """Lead-lag and regulator."""

    va: Annotated[float, "pu", "lagged control error"]
    vr: Annotated[float, "pu", "regulator output"]


@inline
def equations(x, u, p):
    """Field voltage Efd (pu), and state derivatives (1/s)."""
    va, d_va = lead_lag(p.TC, p.TB, u.Vref - u.vt + u.Vs, x.va)
    vr, d_vr = lag(p.TE, p.K * va, x.vr)
    vr = clip(vr, p.Emin, p.Emax)
    efd = crowbar(vr * u.vt if p.switch == 0 else vr, u.Ifd, p.resistor)
    return Output(efd), State(va=d_va, vr=d_vr)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected: nothing."""
    TB, switch = values["TB"], values["switch"]
    if switch not in (0, 1):
        raise ValueError(f"CSWITCH = {switch:g} is not supported; it must be 0 (bus fed) or 1 (constant source).")
    same = {name: values[name] for name in ("K", "TE", "Emin", "Emax", "resistor")}
    return Par(TB=TB, TC=values["TA_over_TB"] * TB, switch=int(switch), **same), []
