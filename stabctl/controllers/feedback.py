"""Continuous laws on speed and acceleration (the paper, section 3, eq. (13) and (14)), as orders of storage devices.

The power depends on the acceleration that it causes: the simulation solves for both at once, at every stage of a step.
"""

from dataclasses import dataclass
from math import pi
from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl._util.validation import guard
from stabctl.devices.blocks import magnitude

from .law import Law
from .signals import Input, Output, StorageDevice

NAME = "feedback"
ROLE = "controller"
__all__ = ["NAME", "ROLE", "Feedback", "Input", "Output", "Par", "step"]


class Par(NamedTuple):
    """Parameters for one device."""

    deadband: Annotated[float, "pu", "speed deviation without action"]
    gate: Annotated[float, "pu", "voltage below which the device idles"]
    speed_gain: Annotated[float, "1/pu", "order over speed deviation"]
    acceleration_gain: Annotated[float, "s/pu", "order over acceleration"]
    braking: Annotated[float, "-", "1: eq. (14) instead of (13)"]


@inline
def step(u, v, p):
    """Order in ratings: Kv deviation + Ka acceleration (13), or Ka |acceleration| sgn(deviation) (14)."""
    if magnitude(v[0], v[1]) < p.gate or -p.deadband < u.deviation < p.deadband:
        return Output(0.0)
    wanted = p.speed_gain * u.deviation + p.acceleration_gain * u.acceleration
    if p.braking > 0:
        size = p.acceleration_gain * abs(u.acceleration)
        wanted = size if u.deviation > 0 else -size if u.deviation < 0 else 0.0
    return Output(wanted)


@dataclass(frozen=True)
class Feedback(Law):
    """Speed and acceleration feedback (the paper, section 3, eq. (13) and (14)).

    Parameters
    ----------
    speed_gain : float, pu/(rad/s)
        Kv, on the machine's base as in the one-machine theory.
    acceleration_gain : float, pu/(rad/s^2)
        Ka, on the machine's base.
    braking : bool
        Use eq. (14), Ka |dw/dt| with the sign of w, instead of (13).
    deadband : float or str, Hz
        Speed deviation below which a device idles; text such as "100mHz".
    min_voltage : float, pu
        Voltage below which a device idles.

    Raises
    ------
    StudyError
        For a value that is not a number, or a negative deadband or voltage.

    Examples
    --------
    >>> law = st.Feedback(speed_gain=10.0)
    >>> st.load("two_area").clearing_time("7-8@0.4", storage="50MW", control=law, resolution="1cyc").cycles
    28.0
    """

    speed_gain: Annotated[float, "pu/(rad/s)", "Kv, on the machine's base"] = 0.0
    acceleration_gain: Annotated[float, "pu/(rad/s^2)", "Ka, on the machine's base"] = 0.0
    braking: Annotated[bool, "-", "Ka times the size of the acceleration, with the sign of the speed"] = False
    deadband: Annotated[float, "Hz", "speed deviation without action", NOT_NEGATIVE] = 0.0
    min_voltage: Annotated[float, "pu", "voltage below which the device idles", NOT_NEGATIVE] = 0.8

    def __post_init__(self) -> None:
        guard(self)

    @property
    def inertial(self) -> bool:  # type: ignore[override]
        """Whether its orders follow the acceleration."""
        return self.acceleration_gain != 0

    def reads(self, signal: str) -> bool:
        """As in `Law.reads`."""
        return self.inertial if signal == "acceleration" else super().reads(signal)

    @property
    def abrupt(self) -> bool:  # type: ignore[override]
        """Whether its orders jump, at the edges of the deadband or with the sign of the speed."""
        return self.braking or self.deadband > 0

    @property
    def step(self) -> float:  # type: ignore[override]
        """Longest default step, s: with (14) all that follows depends on when the orders jump."""
        return 1 / 960 if self.braking else super().step

    def par(self, device: StorageDevice) -> Par:
        """Parameters, with gains in orders per pu of speed."""
        scale = 2 * pi * device.frequency * device.machine / device.rating if device.rating else 0.0
        gains = self.speed_gain * scale, self.acceleration_gain * scale
        return Par(self.deadband / device.frequency, self.min_voltage, *gains, float(self.braking))

    def gains(self, device: StorageDevice) -> tuple[float, float, float]:
        """As in `Law.gains`; 0 of speed if the power is full from the edge of the deadband on."""
        par = self.par(device)
        if par.speed_gain * par.deadband >= 1:
            par = par._replace(speed_gain=0.0)
        return 0.0 if self.braking else par.speed_gain, par.acceleration_gain, 0.0
