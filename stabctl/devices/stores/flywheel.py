"""Flywheel: its speed falls with its energy, its losses grow with the speed, and its torque is limited.

w^2 = wlow^2 + (1 - wlow^2) energy/capacity         speed over full speed
take = torque w/k, give = k torque w, both at most 1
d energy/dt = P - rating (loss(w) - loss(w0)),      loss(w) = friction w + windage w^3

`capacity` is the energy between the lowest speed wlow, at which the device is empty, and full speed: 1 - wlow^2 of
J w^2/2. The losses at the speed w0 of the start are supplied by the station and are part of the power flow, so nothing
moves while nothing happens; what counts is their change with the speed. torque is in power rating over full speed, and
from 1/wlow on it gives full power until it is empty.
Valid between wlow and full speed: below wlow the drive is off, and losses do not count there. The electrical machine
is a gain; its flux and current control are faster than the converter.
Source: B. Bolund, H. Bernhoff, M. Leijon, Flywheel energy and power storage systems, Renew. Sustain. Energy Rev. 11
(2007): energy and speed, losses of bearings and of air.
"""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import at_least, at_most

NAME = "FLYWHEEL"
FINITE = True
automatic = None


class Par(NamedTuple):
    """Parameters of the store of one device."""

    rating: Annotated[float, "pu", "power rating, system base", FROM_CASE] = 0.0
    wlow: Annotated[float, "pu", "lowest speed, at which it is empty", Interval(gt=0, le=1)] = 0.5
    torque: Annotated[float, "pu", "largest torque", POSITIVE] = 2.0
    friction: Annotated[float, "pu", "loss of the bearings at full speed", NOT_NEGATIVE] = 0.005
    windage: Annotated[float, "pu", "loss of the air at full speed", NOT_NEGATIVE] = 0.005


@inline
def speed(energy, p):
    """Speed (pu of full speed)."""
    low = p.wlow * p.wlow
    return np.sqrt(at_least(low + (1 - low) * energy / p.capacity, 1e-6))


@inline
def loss(w, p):
    """Losses (pu system) at a speed."""
    return p.rating * (p.friction * w + p.windage * w * w * w)


@inline
def most(x, p):
    """Largest power that it takes and gives, over the rating, k^2 the round-trip efficiency of the conversion."""
    power, k = p.torque * speed(x.energy, p), p.efficiency
    return at_most(power / k, 1.0), at_most(k * power, 1.0)


@inline
def rate(x, P, p):
    """Derivative of its energy (pu)."""
    return P - (loss(speed(x.energy, p), p) - loss(speed(p.stored, p), p))
