"""Storage law on a surface of speed and angle, for machines or coherent groups of them.

    surface  w + k d     w speed and d angle of the group against the rest of the island, d from its initial value
    order    full power by the sign of the surface, or in proportion to it (slope), nothing within the deadband

The device idles while its gates are closed: at low voltage, or while the deviation changes quickly, as during a fault.
If an arming level is set, it acts only for some time after the surface was last beyond that level. While it has nothing
else to do, it returns its energy to the initial value.
"""

import re
from collections import Counter
from dataclasses import dataclass
from math import pi
from typing import Annotated, Any, NamedTuple

from stabctl._util.errors import StudyError, shown
from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE, SHARE
from stabctl._util.validation import guard
from stabctl.devices.blocks import magnitude

from .law import Law
from .signals import Input, StorageDevice

NAME = "storage law"
ROLE = "controller"
__all__ = ["NAME", "ROLE", "START", "Input", "Output", "Par", "StorageLaw", "step"]


class Par(NamedTuple):
    """Parameters for one device."""

    angle_gain: Annotated[float, "pu/rad", "k: weight of the angle in the surface"]
    slope: Annotated[float, "pu", "surface beyond the deadband at which the power is full (0: at once)"]
    deadband: Annotated[float, "pu", "surface without action"]
    gate: Annotated[float, "pu", "voltage below which the device idles"]
    fastest: Annotated[float, "pu/s", "rate of the deviation above which the device idles"]
    level: Annotated[float, "pu", "surface that arms the law (0: always armed)"]
    timeout: Annotated[float, "s", "time for which it stays armed"]
    stored: Annotated[float, "pu s", "energy to which it returns"]
    per_energy: Annotated[float, "1/(pu s)", "order for energy away from that"]
    return_power: Annotated[float, "-", "largest order with which it returns"]


class Output(NamedTuple):
    """What the law gives, and when it is disarmed."""

    wanted: Annotated[float, "-", "order in ratings, positive to absorb"]
    until: Annotated[float, "s", "time at which it is disarmed"]


START = Output(0.0, -1e9)


@inline
def step(u, v, y, p):
    """Order in ratings, from the surface and the energy; y is what it was before."""
    surface = u.deviation + p.angle_gain * u.angle
    beyond = abs(surface) - p.deadband
    until = u.time + p.timeout if abs(surface) > p.level else y.until
    wanted = 0.0
    if magnitude(v[0], v[1]) >= p.gate and abs(u.acceleration) <= p.fastest:
        if beyond > 0 and (p.level == 0 or u.time < until):
            wanted = beyond / p.slope if p.slope > 0 else 1.0
            wanted = wanted if surface > 0 else -wanted
        elif p.return_power > 0:
            wanted = min(max(p.per_energy * (p.stored - u.energy), -p.return_power), p.return_power)
    return Output(wanted, until)


@dataclass(frozen=True)
class StorageLaw(Law):
    """Storage law on the surface w + k d; times and frequencies may be text, such as "100mHz" or "5s".

    Parameters
    ----------
    groups : tuple of str
        Coherent groups, such as ("13+14",): a device of one of their machines sees the group against the rest of the
        island, devices of other machines see their own machine against the rest.
    angle_gain : float, 1/s
        k; the surface in Hz is w + k d / (2 pi), w in Hz and d in rad.
    slope : float, Hz
        Surface beyond the deadband at which the power is full; 0 is a relay.
    deadband : float, Hz
        Surface without action.
    min_voltage : float, pu
        Voltage below which a device idles; 0 never.
    max_acceleration : float, Hz/s
        Rate of the deviation above which a device idles; 0 is unlimited.
    arm_at : float, Hz
        Surface that arms the law; 0: it is always armed.
    timeout : float, s
        Time for which it stays armed after the surface was last beyond `arm_at`.
    return_time : float, s
        Time constant with which an idle device returns to its initial energy; 0: it does not.
    return_power : float
        Largest share of the rating for that.

    Raises
    ------
    StudyError
        If a value is not allowed, or a machine is in two groups.

    Examples
    --------
    >>> law = st.StorageLaw(("3+4",), angle_gain=2.0, deadband="50mHz", min_voltage=0.5)
    >>> st.load("two_area").clearing_time("7-8@0.4", storage="50MW", control=law, resolution="1cyc").cycles
    34.0
    """

    groups: Annotated[Any, "-", "coherent groups, each seen as one machine"] = ()
    angle_gain: Annotated[float, "1/s", "weight of the angle in the surface"] = 0.0
    slope: Annotated[float, "Hz", "surface beyond the deadband of full power; 0: a relay", NOT_NEGATIVE] = 0.0
    deadband: Annotated[float, "Hz", "surface without action", NOT_NEGATIVE] = 0.1
    min_voltage: Annotated[float, "pu", "voltage below which the device idles", NOT_NEGATIVE] = 0.8
    max_acceleration: Annotated[float, "Hz/s", "rate above which the device idles; 0: none", NOT_NEGATIVE] = 0.0
    arm_at: Annotated[float, "Hz", "surface that arms the law; 0: always armed", NOT_NEGATIVE] = 0.0
    timeout: Annotated[float, "s", "time for which it stays armed", POSITIVE] = 5.0
    return_time: Annotated[float, "s", "time constant of the return of energy; 0: none", NOT_NEGATIVE] = 0.0
    return_power: Annotated[float, "-", "largest share of the rating for the return", SHARE] = 0.1

    def __post_init__(self) -> None:
        guard(self)
        object.__setattr__(self, "groups", _groups(self.groups))
        if self.arm_at and self.arm_at < self.deadband:
            raise StudyError(
                f"arm_at = {self.arm_at:g} Hz must not be less than deadband = {self.deadband:g} Hz; raise it."
            )

    @property
    def relay(self) -> bool:  # type: ignore[override]
        """Whether its orders switch between fixed values."""
        return self.slope == 0 and self.return_time == 0

    def reads(self, signal: str) -> bool:
        """As in `Law.reads`; with the time it only measures how long it has been armed."""
        of_settings = {"angle": self.angle_gain != 0, "acceleration": self.max_acceleration > 0, "time": False}
        return of_settings[signal] if signal in of_settings else super().reads(signal)

    def par(self, device: StorageDevice) -> Par:
        """Parameters in pu."""
        f, rating = device.frequency, device.rating / device.system
        back = self.return_time > 0 and rating > 0
        return Par(
            self.angle_gain / (2 * pi * f),
            self.slope / f,
            self.deadband / f,
            self.min_voltage,
            self.max_acceleration / f or float("inf"),
            self.arm_at / f,
            self.timeout,
            device.stored,
            1 / (rating * self.return_time) if back else 0.0,
            self.return_power if back else 0.0,
        )

    def gains(self, device: StorageDevice) -> tuple[float, float, float]:
        """As in `Law.gains`."""
        if not self.slope:
            return 0.0, 0.0, 0.0
        par = self.par(device)
        return 1 / par.slope, 0.0, par.angle_gain / par.slope


def _groups(given: Any) -> tuple[tuple[int | str, ...], ...]:
    """Groups of machines by number or name, from "13+14", "30/1+30/2" or sequences of them."""
    found = []
    if not isinstance(given, str | list | tuple):
        raise StudyError(f"groups = {shown(given)} does not name machines; give numbers, such as '13+14'.")
    for group in (given,) if isinstance(given, str) else given:
        if not isinstance(group, str | list | tuple):
            raise StudyError(f"groups: {shown(group)} does not name machines; give numbers, such as '13+14'.")
        parts = group.split("+") if isinstance(group, str) else [str(n) for n in group]
        parts = [part.strip() for part in parts]
        if not all(re.fullmatch(r"[0-9]{1,18}|.+/.+", part) for part in parts):
            raise StudyError(f"groups: {shown(group)} does not name machines; give numbers, such as '13+14'.")
        members = {int(part) if part.isdecimal() else part for part in parts}
        found.append(tuple(sorted(members, key=lambda n: (len(str(n)), str(n)))))
    for n, times in Counter(n for group in found for n in group).items():
        if times > 1:
            raise StudyError(f"groups: machine {n} is in two groups; leave it in one.")
    return tuple(found)
