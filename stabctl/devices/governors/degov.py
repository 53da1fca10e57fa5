"""DEGOV: Woodward diesel governor, isochronous, with the delay of the engine.

omega - 1 -> [-(1+sT3)/(1+sT1+s^2 T1 T2)] -> [K (1+sT4)/(s (1+sT5)(1+sT6))], held between Tmin and Tmax -> throttle
throttle -> [exp(-sTD)] -> times omega -> Pm

It has no load reference: the governor holds the speed, the throttle starts at the power. The delay is a chain of four
Pade approximations of TD/4, within 1 degree up to omega TD = 6.7.
Source: PSS/E Model Library, DEGOV.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, delay2, delay2_rates, second_order, second_order_rates

from .shared import Output

NAME = "DEGOV"
ROLE = "governor"
LIMITS = {"throttle": ("Tmin", "Tmax")}
DYR = {"DEGOV": "T1 T2 T3 K T4 T5 T6 TD Tmax Tmin"}
SECTIONS = 4  # of the delay
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "delayed", "derivatives", "output"]


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
    """Throttle after each section of the delay."""
    T = TD / SECTIONS
    one = delay2(T, throttle, x.d1, x.d1_rate)
    two = delay2(T, one, x.d2, x.d2_rate)
    three = delay2(T, two, x.d3, x.d3_rate)
    return one, two, three, delay2(T, three, x.d4, x.d4_rate)


@inline
def delay_rates(TD, throttle, x):
    """State derivatives (1/s) of the delay."""
    T = TD / SECTIONS
    one, two, three, _ = delayed(TD, throttle, x)
    first, second = delay2_rates(T, throttle, x.d1, x.d1_rate), delay2_rates(T, one, x.d2, x.d2_rate)
    return first + second + delay2_rates(T, two, x.d3, x.d3_rate) + delay2_rates(T, three, x.d4, x.d4_rate)


@inline
def actuator(p, error, x):
    """Signal of the control box and rate of the throttle (1/s)."""
    box = second_order(p.T3, 0.0, p.T1, p.T1 * p.T2, error, x.box, x.box_rate)
    return box, p.K * second_order(p.T4, 0.0, p.T5 + p.T6, p.T5 * p.T6, box, x.drive, x.drive_rate)


@inline
def output(x, omega, p):
    """Mechanical power (pu machine)."""
    return Output(delayed(p.TD, clip(x.throttle, p.Tmin, p.Tmax), x)[3] * omega)


@inline
def derivatives(x, omega, p):
    """State derivatives (1/s)."""
    box, rate = actuator(p, 1 - omega, x)
    first = second_order_rates(p.T1, p.T1 * p.T2, 1 - omega, x.box, x.box_rate)
    second = second_order_rates(p.T5 + p.T6, p.T5 * p.T6, box, x.drive, x.drive_rate)
    return State(*(first + second + (rate,) + delay_rates(p.TD, x.throttle, x)))
