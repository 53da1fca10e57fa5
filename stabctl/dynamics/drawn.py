"""A power drawn from a bus on command: the current is the power times that of a load of 1 pu."""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.loads import zip_load

NAME = "drawn power"
ROLE = "sensor"
Par = zip_load.Par


class Input(NamedTuple):
    """What is drawn."""

    power: Annotated[float, "pu", "power, system base"]


@inline
def current(u, v, p):
    """Current into the network (pu), real and imaginary part."""
    re, im = zip_load.current(v, p)
    return u.power * re, u.power * im
