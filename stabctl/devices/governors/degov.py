"""DEGOV: Woodward diesel governor, isochronous, with the delay of the engine.

omega - 1 -> [-(1+sT3)/(1+sT1+s^2 T1 T2)] -> [K (1+sT4)/(s (1+sT5)(1+sT6))], held between Tmin and Tmax -> throttle
throttle -> [exp(-sTD)] -> times omega -> Pm

It has no load reference: the governor holds the speed, the throttle starts at the power. The delay is a chain of four
Pade approximations of TD/4, within 1 degree up to omega TD = 5.1.
Source: PSS/E Model Library, DEGOV.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, delay2, second_order

from .shared import Output

NAME = "DEGOV"
ROLE = "governor"
LIMITS = {"throttle": ("Tmin", "Tmax")}
DYR = {"DEGOV": "T1 T2 T3 K T4 T5 T6 TD Tmax Tmin"}
SECTIONS = 4  # of the delay
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "delayed", "equations"]


class Par(NamedTuple):
    """Parameters of one governor, on the machine's base."""

    T1: Annotated[float, "s", "electric control box", NOT_NEGATIVE]
    T2: Annotated[float, "s", "electric control box", NOT_NEGATIVE]
    T3: Annotated[float, "s", "electric control box, lead", NOT_NEGATIVE]
    K: Annotated[float, "1/s", "actuator gain", POSITIVE]
    T4: Annotated[float, "s", "actuator lead", NOT_NEGATIVE]
    T5: Annotated[float, "s", "actuator lag", NOT_NEGATIVE]
    T6: Annotated[float, "s", "actuator lag", NOT_NEGATIVE]
    TD: Annotated[float, "s", "delay of the engine", NOT_NEGATIVE]
    Tmax: Annotated[float, "pu", "throttle limit"] = 1.0
    Tmin: Annotated[float, "pu", "throttle limit"] = 0.0


class State(NamedTuple):
    """Control box, actuator, throttle and delay."""

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


class Input(NamedTuple):
    """Signal at the governor."""

    omega: Annotated[float, "pu", "speed"]


@inline
def delayed(TD, throttle, x):
    """Throttle after the delay, and state derivatives (1/s) of its sections."""
    T = TD / SECTIONS
    one, d1, dd1 = delay2(T, throttle, x.d1, x.d1_rate)
    two, d2, dd2 = delay2(T, one, x.d2, x.d2_rate)
    three, d3, dd3 = delay2(T, two, x.d3, x.d3_rate)
    four, d4, dd4 = delay2(T, three, x.d4, x.d4_rate)
    return four, (d1, dd1, d2, dd2, d3, dd3, d4, dd4)


@inline
def actuator(p, error, x):
    """State derivatives (1/s) of the control box, of the drive and of the throttle."""
    box, d_box, dd_box = second_order(p.T3, 0.0, p.T1, p.T1 * p.T2, error, x.box, x.box_rate)
    drive, d_drive, dd_drive = second_order(p.T4, 0.0, p.T5 + p.T6, p.T5 * p.T6, box, x.drive, x.drive_rate)
    return d_box, dd_box, d_drive, dd_drive, p.K * drive


@inline
def equations(x, omega, p):
    """Mechanical power (pu machine), and state derivatives (1/s)."""
    torque, _ = delayed(p.TD, clip(x.throttle, p.Tmin, p.Tmax), x)
    _, sections = delayed(p.TD, x.throttle, x)
    return Output(torque * omega), State(*(actuator(p, 1 - omega, x) + sections))
