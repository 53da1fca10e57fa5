"""The stage between a control law and the storage device: limits, rate limit, hold.

wanted -> limited -1..1 -> limited to ramp per second -> order

The order is held over a step, or follows the signals at every stage of it. It keeps within the reach of the ramp from
what it was at the beginning of the step.

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
    elapsed: Annotated[float, "s", "time since then", fixed(0.0)]


class Output(NamedTuple):
    """The order."""

    order: Annotated[float, "-", "order, in ratings"]


@inline
def step(u, p):
    """The order."""
    wanted = min(max(u.wanted, -1.0), 1.0) * u.online
    if p.ramp > 0:
        reach = p.ramp * u.elapsed
        wanted = min(max(wanted, u.before - reach), u.before + reach)
    return Output(wanted)
