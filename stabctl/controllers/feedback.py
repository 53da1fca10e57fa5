"""Continuous laws on speed and acceleration (the paper, section 3, eq. (13) and (14)), as orders of storage devices.

In the one-machine theory the power depends on the acceleration that it causes. Here an order is held over a step and
sees the acceleration of the step before, which comes to the same within a few steps while |Ka| stays below 2H/wb.
"""

from dataclasses import dataclass
from math import pi
from typing import Annotated

from stabctl._util.guard import guard
from stabctl._util.jit import inline
from stabctl.schema import NOT_NEGATIVE

from .signals import Device, Par

LINEAR, BRAKING = 2.0, 3.0


@inline
def order(seen, p):
    """Order in ratings, within -1..1: Kv deviation + Ka acceleration (13), or Ka |acceleration| sgn(deviation) (14)."""
    if seen.voltage < p.gate or -p.deadband <= seen.deviation <= p.deadband:
        return 0.0
    wanted = p.speed_gain * seen.deviation + p.acceleration_gain * seen.acceleration
    if p.kind == BRAKING:
        size = p.acceleration_gain * abs(seen.acceleration)
        wanted = size if seen.deviation > 0 else -size
    return min(max(wanted, -1.0), 1.0)


@dataclass(frozen=True)
class Feedback:
    """Speed and acceleration feedback; gains in pu of the machine's base, as in the one-machine theory."""

    speed_gain: Annotated[float, "pu/(rad/s)", "Kv"] = 0.0
    acceleration_gain: Annotated[float, "pu/(rad/s^2)", "Ka"] = 0.0
    braking: bool = False  # eq. (14) instead of (13)
    deadband: Annotated[float, "Hz", "speed deviation without action", NOT_NEGATIVE] = 0.0
    min_voltage: Annotated[float, "pu", "voltage below which the device idles", NOT_NEGATIVE] = 0.8

    def __post_init__(self) -> None:
        guard(self)

    def par(self, device: Device) -> Par:
        """Constants in orders over pu of speed."""
        scale = 2 * pi * device.frequency * device.machine / device.rating if device.rating else 0.0
        return Par(
            BRAKING if self.braking else LINEAR,
            self.deadband / device.frequency,
            self.min_voltage,
            self.speed_gain * scale,
            self.acceleration_gain * scale,
        )
