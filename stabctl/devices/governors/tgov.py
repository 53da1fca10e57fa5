"""TGOV: speed governor and turbine.

1 - omega -> [K] -> (+) -> limited Pmin..Pmax -> [1/(1+sTs)] -> [(1+sT3)/(1+sTc)] -> [(1+sT4)/(1+sT5)] -> Pm
            Pref -> (+)

Steam turbine: T5 is the reheater time constant, T4/T5 the high-pressure share. Hydro turbine: T4 = -1, T5 = 0.5 is the
water column.
Source: J. Chow, K. Cheung, IEEE Trans. Power Syst. 7 (1992), turbine governor of the Power System Toolbox (PST).
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl.devices.blocks import clip, lag, lead_lag

from .shared import Input, Output

NAME = "TGOV"
ROLE = "governor"
__all__ = ["NAME", "ROLE", "Input", "Output", "Par", "State", "equations"]


class Par(NamedTuple):
    """Parameters of one governor, on the machine's base."""

    K: Annotated[float, "pu", "inverse droop 1/R (0: no speed control)", NOT_NEGATIVE]
    Ts: Annotated[float, "s", "servo", NOT_NEGATIVE]
    Tc: Annotated[float, "s", "governor lag", NOT_NEGATIVE]
    T3: Annotated[float, "s", "governor lead (transient gain)", NOT_NEGATIVE]
    T4: Annotated[float, "s", "turbine lead (-1: water column)"]
    T5: Annotated[float, "s", "turbine lag", NOT_NEGATIVE]
    Pmax: Annotated[float, "pu", "demand limit"] = 1.0
    Pmin: Annotated[float, "pu", "demand limit"] = 0.0


class State(NamedTuple):
    """Servo, governor and turbine."""

    servo: Annotated[float, "pu", "servo output"]
    gate: Annotated[float, "pu", "lagged signal of the governor"]
    turbine: Annotated[float, "pu", "lagged signal of the turbine"]


@inline
def equations(x, u, p):
    """Mechanical power (pu machine), and state derivatives (1/s)."""
    servo, d_servo = lag(p.Ts, clip(u.Pref + p.K * (1 - u.omega), p.Pmin, p.Pmax), x.servo)
    gate, d_gate = lead_lag(p.T3, p.Tc, servo, x.gate)
    power, d_turbine = lead_lag(p.T4, p.T5, gate, x.turbine)
    return Output(power), State(servo=d_servo, gate=d_gate, turbine=d_turbine)
