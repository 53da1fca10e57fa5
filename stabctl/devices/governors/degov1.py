"""DEGOV1: Woodward diesel governor with droop and the delay of the engine.

Pref - (omega - 1) - DROOP f -> [(1+sT3)/(1+sT1+s^2 T1 T2)] -> [K (1+sT4)/(s (1+sT5)(1+sT6))], Tmin to Tmax -> throttle
throttle -> [exp(-sTD)] -> times omega -> Pm

The feedback f is the throttle or, with M = 1, the electrical power behind 1/(1+sTE). The delay is that of DEGOV.
Source: PSS/E Model Library, DEGOV1.
"""

from typing import Annotated, NamedTuple

from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, lag

from .degov import actuator, delayed
from .shared import Metered as Input
from .shared import Output

NAME = "DEGOV1"
ROLE = "governor"
LIMITS = {"throttle": ("Tmin", "Tmax")}
DYR = {"DEGOV1": "+M T1 T2 T3 K T4 T5 T6 TD Tmax Tmin DROOP TE"}
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "derivatives", "output"]


class Par(NamedTuple):
    """Parameters of one governor, on the machine's base."""

    M: Annotated[int, "-", "feedback: 0 throttle, 1 electrical power", Interval(ge=0, le=1)]
    T1: Annotated[float, "s", "electric control box", NOT_NEGATIVE]
    T2: Annotated[float, "s", "electric control box", NOT_NEGATIVE]
    T3: Annotated[float, "s", "electric control box, lead", NOT_NEGATIVE]
    K: Annotated[float, "1/s", "actuator gain", POSITIVE]
    T4: Annotated[float, "s", "actuator lead", NOT_NEGATIVE]
    T5: Annotated[float, "s", "actuator lag", NOT_NEGATIVE]
    T6: Annotated[float, "s", "actuator lag", NOT_NEGATIVE]
    TD: Annotated[float, "s", "delay of the engine", NOT_NEGATIVE]
    DROOP: Annotated[float, "pu", "droop", POSITIVE]
    TE: Annotated[float, "s", "power transducer", NOT_NEGATIVE]
    Tmax: Annotated[float, "pu", "throttle limit"] = 1.0
    Tmin: Annotated[float, "pu", "throttle limit"] = 0.0


class State(NamedTuple):
    """Control box, actuator, throttle, delay and power transducer."""

    box: Annotated[float, "pu", "speed signal"]
    box_rate: Annotated[float, "pu/s", "its rate"]
    drive: Annotated[float, "pu", "actuator signal"]
    drive_rate: Annotated[float, "pu/s", "its rate"]
    throttle: Annotated[float, "pu", "throttle"]
    d1: Annotated[float, "pu", "delay, first section"]
    d1_rate: Annotated[float, "pu/s", "its rate"]
    d2: Annotated[float, "pu", "delay, second section"]
    d2_rate: Annotated[float, "pu/s", "its rate"]
    d3: Annotated[float, "pu", "delay, third section"]
    d3_rate: Annotated[float, "pu/s", "its rate"]
    d4: Annotated[float, "pu", "delay, fourth section"]
    d4_rate: Annotated[float, "pu/s", "its rate"]
    power: Annotated[float, "pu", "measured electrical power"]


@inline
def output(x, omega, p):
    """Mechanical power (pu machine)."""
    torque, _ = delayed(p.TD, clip(x.throttle, p.Tmin, p.Tmax), x)
    return Output(torque * omega)


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    power, d_power = lag(p.TE, u.P, x.power)
    feedback = power if p.M == 1 else clip(x.throttle, p.Tmin, p.Tmax)
    error = u.Pref - (u.omega - 1) - p.DROOP * feedback
    _, sections = delayed(p.TD, x.throttle, x)
    return State(*(actuator(p, error, x) + sections + (d_power,)))
