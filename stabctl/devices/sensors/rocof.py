"""Rate of change of frequency (ROCOF): that of a measured bus frequency, filtered with the time constant T.

f -> (+) -> [1/T] -> rate        rate = s f / (1 + sT), in Hz/s
     (-) <- x <- [1/s] <- rate
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE

NAME = "rocof"
ROLE = "sensor"


class Par(NamedTuple):
    """Parameters of one sensor."""

    hz: Annotated[float, "Hz", "frequency of the system", FROM_CASE]
    T: Annotated[float, "s", "time constant"] = 0.1


class State(NamedTuple):
    """State of the sensor."""

    f: Annotated[float, "pu", "filtered frequency"]


class Input(NamedTuple):
    """Signal at the sensor."""

    measured: Annotated[float, "pu", "measured frequency of the bus"]


class Output(NamedTuple):
    """Signal of the sensor."""

    rate: Annotated[float, "Hz/s", "rate of change of frequency"]


@inline
def equations(x, u, p):
    """Rate of change of frequency (Hz/s), and state derivative (1/s)."""
    rate = (u.measured - x.f) / p.T
    return Output(rate * p.hz), State(f=rate)
