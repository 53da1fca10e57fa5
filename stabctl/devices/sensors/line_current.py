"""Current into a circuit from one of its ends, |Y1 V1 + Y2 V2|, with the two-port admittances of its pi section."""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import magnitude

from . import line_power

NAME = "line current"
ROLE = "sensor"
Par = line_power.Par


class Output(NamedTuple):
    """Current into the circuit."""

    I: Annotated[float, "pu", "magnitude, system base"]


@inline
def output(v1, v2, p):
    """Magnitude of the current into the circuit from the end with voltage v1."""
    return Output(magnitude(*line_power.into(v1, v2, p)))
