"""Magnitude of a bus voltage, |V|, without a transducer lag."""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import magnitude

NAME = "bus voltage"
ROLE = "sensor"


class Output(NamedTuple):
    """Signal of the sensor."""

    V: Annotated[float, "pu", "voltage magnitude"]


@inline
def output(v):
    """Voltage magnitude (pu)."""
    return Output(magnitude(v[0], v[1]))
