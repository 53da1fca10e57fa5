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
from stabctl.devices.blocks import clip, lag, lag_rate, low_value

from .shared import Input, Output

NAME = "GAST"
ROLE = "governor"
LIMITS = {"valve": ("Vmin", "Vmax")}
UPPER = ("AT",)
DYR = {"GAST": "R T1 T2 T3 AT KT Vmax Vmin Dturb"}
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "UPPER", "Input", "Output", "Par", "State", "derivatives", "output"]


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
def demand(x, u, p):
    """The smaller of the demands of speed and temperature (pu)."""
    return low_value(u.Pref - (u.omega - 1) / p.R, p.AT + p.KT * (p.AT - x.heat))


@inline
def valve(x, u, p):
    """Valve position (pu)."""
    return clip(lag(p.T1, demand(x, u, p), x.valve), p.Vmin, p.Vmax)


@inline
def output(x, u, p):
    """Mechanical power (pu machine)."""
    return Output(lag(p.T2, valve(x, u, p), x.flow) - p.Dturb * (u.omega - 1))


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    position = valve(x, u, p)
    flow = lag(p.T2, position, x.flow)
    return State(lag_rate(p.T1, demand(x, u, p), x.valve), lag_rate(p.T2, position, x.flow), (flow - x.heat) / p.T3)
