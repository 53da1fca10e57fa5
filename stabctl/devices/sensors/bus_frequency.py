"""Frequency of a bus: rate of change of its voltage angle, filtered with the time constant T.

angle of V -> (+) -> [1/T] -> df -> [1/s] -> theta        f = 1 + df/wb
              (-) <- theta

This is a washout s/(1+sT) of the angle, a first-order phase-locked loop.
Source: F. Milano, Power System Modelling and Scripting, 2010, bus frequency estimation.
"""

from typing import Annotated, NamedTuple

import numpy as np

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE
from stabctl.devices.blocks import angle

NAME = "bus frequency"
ROLE = "sensor"
ANGLES = ("theta",)


class Par(NamedTuple):
    """Parameters of one sensor."""

    wb: Annotated[float, "rad/s", "base speed, 2 pi f", FROM_CASE]
    T: Annotated[float, "s", "time constant"] = 0.02


class State(NamedTuple):
    """State of the sensor."""

    theta: Annotated[float, "rad", "tracked angle"]


class Output(NamedTuple):
    """Signal of the sensor."""

    f: Annotated[float, "pu", "frequency"]


def guess(V: complex, p: Par) -> State:
    """State at rest: the angle of the voltage."""
    return State(float(np.angle(V)))


@inline
def rate(x, v, p):
    """Rate of the tracked angle (rad/s)."""
    c, s = np.cos(x.theta), np.sin(x.theta)
    return angle(c * v[0] + s * v[1], c * v[1] - s * v[0]) / p.T


@inline
def output(x, v, p):
    """Frequency (pu)."""
    return Output(1 + rate(x, v, p) / p.wb)


@inline
def derivatives(x, v, p):
    """State derivative (1/s)."""
    return State(rate(x, v, p))
