"""Angle of a bus voltage relative to a reference angle, such as that of the center of inertia."""

from typing import Annotated, NamedTuple

import numpy as np

from stabctl._util.jit import inline
from stabctl.devices.blocks import angle

NAME = "bus angle"
ROLE = "sensor"


class Input(NamedTuple):
    """Signal at the sensor."""

    reference: Annotated[float, "rad", "reference angle"]


class Output(NamedTuple):
    """Signal of the sensor."""

    angle: Annotated[float, "rad", "angle relative to the reference, -pi to pi"]


@inline
def output(u, v):
    """Angle of V exp(-j reference)."""
    c, s = np.cos(u.reference), np.sin(u.reference)
    return Output(angle(c * v[0] + s * v[1], c * v[1] - s * v[0]))
