"""Sum of two signals, for several devices that drive the same summing port."""

from typing import NamedTuple

from stabctl._util.jit import inline

NAME = "sum"
ROLE = "sensor"


class Input(NamedTuple):
    """Signals to add."""

    a: float
    b: float


class Output(NamedTuple):
    """Their sum."""

    sum: float


@inline
def output(u):
    """a + b."""
    return Output(u.a + u.b)
