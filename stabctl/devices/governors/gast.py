"""GAST: gas turbine and governor with a limit of the exhaust temperature.

Pref - (omega - 1)/R -> [LV] -> [1/(1+sT1)], held between Vmin and Vmax -> [1/(1+sT2)] -> (+) -> Pm
AT + KT (AT - xt) ---->                                                 |    (-) <- Dturb (omega - 1)
                                                                        +-> [1/(1+sT3)] -> xt

LV is a low-value gate; AT is the load at which the temperature limit begins to act.
Source: PSS/E Model Library, GAST; IEEE Task Force, Dynamic Models for Turbine-Governors, PES-TR1 (2013), section 3.1.1.
"""

from typing import Annotated, NamedTuple

from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, lag, low_value

from .shared import Input, Output

NAME = "GAST"
ROLE = "governor"
LIMITS = {"valve": ("Vmin", "Vmax")}
UPPER = ("AT",)
DYR = {"GAST": "R T1 T2 T3 AT KT Vmax Vmin Dturb"}
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "UPPER", "Input", "Output", "Par", "State", "equations"]


class Par(NamedTuple):
    """Parameters of one governor, on the machine's base."""

    R: Annotated[float, "pu", "droop", POSITIVE]
    T1: Annotated[float, "s", "governor and valve", NOT_NEGATIVE]
    T2: Annotated[float, "s", "combustion chamber", NOT_NEGATIVE]
    T3: Annotated[float, "s", "exhaust temperature measurement", Ge(1e-3)]
    AT: Annotated[float, "pu", "load limit by ambient temperature"] = 1.0
    KT: Annotated[float, "pu", "gain of the temperature limit", NOT_NEGATIVE] = 2.0
    Vmax: Annotated[float, "pu", "valve limit"] = 1.0
    Vmin: Annotated[float, "pu", "valve limit"] = 0.0
    Dturb: Annotated[float, "pu", "turbine damping, power over speed deviation", NOT_NEGATIVE] = 0.0


class State(NamedTuple):
    """Valve, fuel flow and exhaust temperature."""

    valve: Annotated[float, "pu", "valve position"]
    flow: Annotated[float, "pu", "fuel flow"]
    heat: Annotated[float, "pu", "measured exhaust temperature"]


@inline
def equations(x, u, p):
    """Mechanical power (pu machine), and state derivatives (1/s)."""
    demand = low_value(u.Pref - (u.omega - 1) / p.R, p.AT + p.KT * (p.AT - x.heat))
    valve, d_valve = lag(p.T1, demand, x.valve)
    flow, d_flow = lag(p.T2, clip(valve, p.Vmin, p.Vmax), x.flow)
    d_heat = (flow - x.heat) / p.T3
    return Output(flow - p.Dturb * (u.omega - 1)), State(valve=d_valve, flow=d_flow, heat=d_heat)
