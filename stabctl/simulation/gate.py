"""The gate of a controller: decided once at the start of a step, open while a signal is within bounds."""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.ports import fixed

NAME = "gate"
ROLE = "controller"


class Par(NamedTuple):
    """Bounds."""

    low: Annotated[float, "-", "lower bound, unit of the signal"]
    high: Annotated[float, "-", "upper bound, unit of the signal"]
    magnitude: Annotated[float, "-", "1: bounds of the magnitude"]


class Input(NamedTuple):
    """What is compared."""

    signal: Annotated[float, "-", "the signal", fixed(0.0)]


class Output(NamedTuple):
    """Whether the gate is open."""

    open: Annotated[float, "-", "1 if it is open, else 0"]


@inline
def step(u, p):
    """1 while low <= signal <= high."""
    value = -u.signal if p.magnitude > 0 and u.signal < 0 else u.signal
    return Output(1.0 if p.low <= value <= p.high else 0.0)
