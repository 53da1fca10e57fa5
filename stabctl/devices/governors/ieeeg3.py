"""IEEEG3: hydro turbine and governor, mechanical-hydraulic, with a linear turbine.

Pref - (omega - 1) -> (+) -> [1/(TG (1+sTP))], held between Umin and Umax -> [1/s], Pmin to Pmax -> gate
                      (-) <- gate (sigma + delta sTR/(1+sTR))
gate -> [a23 (1 + (a11 - a13 a21/a23) sTW)/(1 + a11 sTW)] -> Pm

Source: IEEE Committee Report, IEEE Trans. PAS-92 (1973), fig. 9 and 10; PSS/E Model Library, IEEEG3.
"""

from typing import Annotated, NamedTuple

from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, lag, lag_rate, lead_lag, washout

from .shared import Input, Output

NAME = "IEEEG3"
ROLE = "governor"
LIMITS = {"gate": ("Pmin", "Pmax")}
DYR = {"IEEEG3": "TG TP Umax Umin Pmax Pmin sigma delta TR TW a11 a13 a21 a23"}
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "derivatives", "output"]


class Par(NamedTuple):
    """Parameters of one governor, on the machine's base."""

    TG: Annotated[float, "s", "gate servo", Ge(1e-3)]
    TP: Annotated[float, "s", "pilot valve", NOT_NEGATIVE]
    sigma: Annotated[float, "pu", "permanent droop", POSITIVE]
    delta: Annotated[float, "pu", "transient droop", NOT_NEGATIVE]
    TR: Annotated[float, "s", "dashpot (0: delta adds to sigma)", NOT_NEGATIVE]
    TW: Annotated[float, "s", "water starting time", NOT_NEGATIVE]
    a11: Annotated[float, "pu", "flow over head"] = 0.5
    a13: Annotated[float, "pu", "flow over gate"] = 1.0
    a21: Annotated[float, "pu", "power over head"] = 1.5
    a23: Annotated[float, "pu", "power over gate", POSITIVE] = 1.0
    Umax: Annotated[float, "pu/s", "largest opening rate Uo"] = 0.1
    Umin: Annotated[float, "pu/s", "largest closing rate Uc, negative"] = -0.1
    Pmax: Annotated[float, "pu", "gate limit"] = 1.0
    Pmin: Annotated[float, "pu", "gate limit"] = 0.0


class State(NamedTuple):
    """Pilot valve, gate, dashpot and turbine."""

    pilot: Annotated[float, "pu/s", "pilot valve, rate of the gate"]
    gate: Annotated[float, "pu", "gate opening"]
    dashpot: Annotated[float, "pu", "lagged gate opening"]
    turbine: Annotated[float, "pu", "lagged signal of the turbine"]


@inline
def output(x, p):
    """Mechanical power (pu machine)."""
    lead = (p.a11 - p.a13 * p.a21 / p.a23) * p.TW
    power, _ = lead_lag(lead, p.a11 * p.TW, clip(x.gate, p.Pmin, p.Pmax), x.turbine)
    return Output(p.a23 * power)


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    gate = clip(x.gate, p.Pmin, p.Pmax)
    transient, _ = washout(p.TR, gate, x.dashpot)
    drive = (u.Pref - (u.omega - 1) - p.sigma * gate - p.delta * transient) / p.TG
    pilot, d_pilot = lag(p.TP, drive, x.pilot)
    d_dashpot, d_turbine = lag_rate(p.TR, x.gate, x.dashpot), lag_rate(p.a11 * p.TW, x.gate, x.turbine)
    return State(pilot=d_pilot, gate=clip(pilot, p.Umin, p.Umax), dashpot=d_dashpot, turbine=d_turbine)
