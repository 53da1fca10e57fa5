"""Inputs: a set-point, or a power drawn from a bus."""

from typing import NamedTuple

import numpy as np

from stabctl.devices.loads import zip_load
from stabctl.errors import StudyError

from . import family
from .operating_point import OperatingPoint
from .signals import OF_CONVERTER, Signal

PORTS = {
    "vs": "added Vs",
    "vref": "Vref",
    "pref": "Pref",
    "field": "Efd",
    "power": "Pm",
    "ipcmd": "Ipcmd",
    "iqcmd": "Iqcmd",
}


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


def place(point: OperatingPoint, signal: Signal) -> int | None:
    """Place in s of a set-point; None for a drawn power."""
    case = point.case
    if signal.kind == "order":
        esd = point.system.family("esd")
        row = [f"{s.machine}@{s.bus}" for s in case.storage].index(str(signal.place))
        return int(esd.w[row, family.INPUTS])
    if signal.kind in ("storage", "load_p", "load_q"):
        return None
    unit = [m.machine for m in case.machines].index(signal.number)
    found = point.layout.setpoint(unit, PORTS[signal.kind])
    if found is None and signal.kind in OF_CONVERTER:
        raise StudyError(f"A control of converter {signal.number} sets {PORTS[signal.kind]}, so it is not an input.")
    return found


def draw(point: OperatingPoint, signal: Signal) -> Draw:
    """The drawn power: constant power for a storage device, the voltage dependence of the first load for a load."""
    bus = point.net.place[signal.number]
    v0 = float(abs(point.V[bus]))
    if signal.kind == "storage":
        return Draw(bus, zip_load.from_case(Shares(p_power=1.0), 1.0, 0.0, v0))
    load = next((b for b in point.case.loads if b.bus == signal.place), Shares())
    return Draw(bus, zip_load.from_case(load, *((0.0, 1.0) if signal.kind == "load_q" else (1.0, 0.0)), v0))


def slopes(point: OperatingPoint, signal: Signal) -> np.ndarray:
    """Derivative (2) of the current into the bus of a drawn power, at the operating point."""
    d = draw(point, signal)
    current = d.current_of(complex(point.V[d.bus]))
    return np.array([current.real, current.imag])
