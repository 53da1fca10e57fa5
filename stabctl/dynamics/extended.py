"""What linear models and controllers need at an operating point beyond its devices: sensors and summing inputs."""

from collections.abc import Iterable

import numpy as np

from stabctl.devices.sensors import bus_frequency

from . import adder, family
from .extension import Extension
from .layout import SetPoint, StatePlace
from .operating_point import OperatingPoint
from .signals import Signal


def extended(point: OperatingPoint, inputs: Iterable[Signal], outputs: Iterable[Signal]) -> OperatingPoint:
    """The operating point with an input at every stabilizer port named, and a frequency sensor at every bus named."""
    ports = [s for s in dict.fromkeys(inputs) if s.kind == "vs" and _missing(point, s)]
    buses = [s.number for s in dict.fromkeys(outputs) if s.kind == "bus_frequency" and not _measured(point, s)]
    if not ports and not buses:
        return point
    more = Extension(point)
    for signal in ports:
        _add_input(more, signal)
    for bus in buses:
        _add_sensor(more, bus)
    return more.build()


def _missing(point: OperatingPoint, signal: Signal) -> bool:
    return point.layout.setpoint(_unit(point, signal), "added Vs") is None


def _measured(point: OperatingPoint, signal: Signal) -> bool:
    at = point.layout.nx + 2 * point.net.place[signal.number]
    return point.system.has("bus_frequency") and at in point.system.family("bus_frequency").w[:, family.BUS]


def _unit(point: OperatingPoint, signal: Signal) -> int:
    return [m.machine for m in point.case.machines].index(signal.number)


def _add_input(more: Extension, signal: Signal) -> None:
    """The exciter reads its stabilizers plus a set-point, which is 0."""
    unit = _unit(more.point, signal)
    ports = more.ports(unit, "Vs")
    setpoint = more.setpoint(SetPoint(unit, "added Vs", signal.label, 0.0), 0.0)
    before = more.connected(ports, 0)
    out = more.outputs([float(more.point.s[before])], unit)
    more.connected(ports, out)
    more.add("adder", adder, [0, 0, 0, unit, before, setpoint, out], [], f"machine {signal.number}")


def _add_sensor(more: Extension, bus: int) -> None:
    point = more.point
    V, par = point.V[point.net.place[bus]], bus_frequency.Par(2 * np.pi * point.case.frequency_hz)
    where = StatePlace("bus_frequency", 0, -1, "theta", f"theta bus frequency {bus}")
    state = more.states([where], list(bus_frequency.guess(V, par)))
    at = point.layout.nx + 2 * point.net.place[bus]
    more.add("bus_frequency", bus_frequency, [state, at, at, -1, more.outputs([1.0])], par, f"bus {bus}")
