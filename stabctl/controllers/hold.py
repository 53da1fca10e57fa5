"""The stage between a control law and the storage device: limits, rate limit, hold.

wanted -> limited -1..1 -> limited to ramp per second -> order

The order is held over a step, or follows the signals at every stage of it. It keeps within the reach of the ramp from
what it was at the beginning of the step. If it follows them, the order wanted changes linearly between the two
instants: where the order meets it and cannot keep pace, the order turns back.

The order is zero if the machine is disconnected.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.ports import fixed

NAME = "hold"
ROLE = "controller"


class Par(NamedTuple):
    """Parameters of one device."""

    ramp: Annotated[float, "1/s", "largest change of the order, in ratings per second (0: unlimited)"]


class Input(NamedTuple):
    """Signals at the hold."""

    wanted: Annotated[float, "-", "order wanted, in ratings", fixed(0.0)]
    online: Annotated[float, "-", "1 if the machine is on, 0 if it is off", fixed(1.0)]
    before: Annotated[float, "-", "order at the beginning of the step", fixed(0.0)]
    aim: Annotated[float, "-", "order wanted then; where the order is held, that wanted now", fixed(0.0)]
    elapsed: Annotated[float, "s", "time since then", fixed(0.0)]


class Output(NamedTuple):
    """The order."""

    order: Annotated[float, "-", "order, in ratings"]


@inline
def turned(before, aim, change, reach):
    """The order, where the order wanted changes by more than it can."""
    up = 1.0 if change < 0 else -1.0  # the direction in which they may meet
    gap, away = up * (aim - before), abs(change)
    met = min(max(gap / (reach + away), 0.0), 1.0)  # when, as a fraction of the time
    top = up * before + reach * met
    if top > 1:
        met, top = min((up * aim - 1) / away, 1.0), 1.0
    return up * max(top - reach * (1 - met), -1.0)


@inline
def step(u, p):
    """The order."""
    wanted = min(max(u.wanted, -1.0), 1.0) * u.online
    if p.ramp > 0:
        reach, change = p.ramp * u.elapsed, (u.wanted - u.aim) * u.online
        wanted = min(max(wanted, u.before - reach), u.before + reach)
        if abs(change) > reach:
            wanted = turned(u.before, u.aim * u.online, change, reach)
    return Output(wanted)
