"""TGOV1: steam turbine and governor.

Pref -> (+) -> [1/R] -> [1/(1+sT1)], held between Vmin and Vmax -> [(1+sT2)/(1+sT3)] -> (+) -> Pm
        (-) <- omega - 1                                            Dt (omega - 1) -> (-)

T3 is the reheater time constant, T2/T3 the high-pressure share.
Source: PSS/E Model Library, TGOV1; IEEE Task Force, Dynamic Models for Turbine-Governors, PES-TR1 (2013), section 2.1.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, lag, lead_lag

from .shared import Input, Output

NAME = "TGOV1"
ROLE = "governor"
LIMITS = {"valve": ("Vmin", "Vmax")}
DYR = {"TGOV1": "R T1 Vmax Vmin T2 T3 Dt"}
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations"]


class Par(NamedTuple):
    """Parameters of one governor, on the machine's base."""

    R: Annotated[float, "pu", "droop", POSITIVE]
    T1: Annotated[float, "s", "governor and valve", NOT_NEGATIVE]
    T2: Annotated[float, "s", "turbine lead", NOT_NEGATIVE]
    T3: Annotated[float, "s", "turbine lag, reheater", NOT_NEGATIVE]
    Dt: Annotated[float, "pu", "turbine damping, power over speed deviation", NOT_NEGATIVE] = 0.0
    Vmax: Annotated[float, "pu", "valve limit"] = 1.0
    Vmin: Annotated[float, "pu", "valve limit"] = 0.0


class State(NamedTuple):
    """Valve and reheater."""

    valve: Annotated[float, "pu", "valve position"]
    turbine: Annotated[float, "pu", "lagged signal of the turbine"]


@inline
def equations(x, u, p):
    """Mechanical power (pu machine), and state derivatives (1/s)."""
    valve, d_valve = lag(p.T1, (u.Pref - (u.omega - 1)) / p.R, x.valve)
    power, d_turbine = lead_lag(p.T2, p.T3, clip(valve, p.Vmin, p.Vmax), x.turbine)
    return Output(power - p.Dt * (u.omega - 1)), State(valve=d_valve, turbine=d_turbine)
