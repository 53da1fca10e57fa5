"""Inputs: each is a set-point; those of drawn powers are added with the device that draws them."""

from typing import NamedTuple

from stabctl.devices.loads import zip_load
from stabctl.errors import StudyError

from . import storage
from .operating_point import OperatingPoint
from .rows import NO_UNIT
from .signal_kinds import OF_CONVERTER, OF_STORAGE
from .signals import Signal, port

PORTS = {
    "vs": "added Vs",
    "vref": "Vref",
    "pref": "Pref",
    "field": "Efd",
    "power": "Pm",
    "ipcmd": "Ipcmd",
    "iqcmd": "Iqcmd",
}
DRAWN = ("storage", "load_p", "load_q")


class Draw(NamedTuple):
    """A power of 1 pu drawn from a bus by a load."""

    bus: int
    par: zip_load.Par

    def current_of(self, V: complex) -> complex:
        """Current into the network (pu) for 1 pu of power."""
        return complex(*zip_load.current((V.real, V.imag), self.par))


class Shares(NamedTuple):
    """How a drawn power depends on the voltage, as in a row of loads.csv."""

    p_power: float = 0.0
    q_power: float = 0.0
    p_current: float = 0.0
    q_current: float = 0.0
    v_low: float = 0.5


def place(point: OperatingPoint, signal: Signal) -> int:
    """Place in s of an input, in a point that `extended` has prepared for it. Raises `StudyError` if it is driven."""
    case = point.case
    if signal.kind in OF_STORAGE:
        row = [f"{s.machine}@{s.bus}" for s in case.storage].index(str(signal.place))
        at = int(getattr(storage.places(point.system, case), signal.kind)[row])
        if at < 0:
            raise StudyError(
                f"The storage device {signal.place} of {case.name} has no voltage reference, so order_v has no effect "
                "on it; make it grid-forming, or grid-following with QFlag=1 VFlag=0."
            )
        return at
    found: int | None
    if signal.kind in DRAWN:
        found = point.layout.setpoint(NO_UNIT, signal.label)
    else:
        unit = [m.machine for m in case.machines].index(signal.number)
        name = PORTS.get(signal.kind) or port(case, signal.number, signal.kind)
        found = point.layout.setpoint(unit, str(name))
    if found is None and signal.kind in OF_CONVERTER:
        raise StudyError(f"A control of converter {signal.number} sets {PORTS[signal.kind]}, so it is not an input.")
    if found is None:
        raise StudyError(f"{signal.label} of {case.name} is set by another device, so it is not an input.")
    return found


def draw(point: OperatingPoint, signal: Signal) -> Draw:
    """The drawn power: constant power for a storage device, the voltage dependence of the first load for a load."""
    bus = point.net.place[signal.number]
    v0 = float(abs(point.V[bus]))
    if signal.kind == "storage":
        return Draw(bus, zip_load.from_case(Shares(p_power=1.0), 1.0, 0.0, v0))
    load = next((b for b in point.case.loads if b.bus == signal.place), Shares())
    return Draw(bus, zip_load.from_case(load, *((0.0, 1.0) if signal.kind == "load_q" else (1.0, 0.0)), v0))
