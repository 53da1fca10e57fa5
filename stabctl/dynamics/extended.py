"""What linear models and controllers need at an operating point beyond its devices: sensors, inputs, drawn powers."""

from collections.abc import Iterable

import numpy as np

from stabctl.devices.sensors import bus_frequency, rocof

from . import adder, drawn, family
from . import inputs as ins
from .extension import Extension
from .layout import SetPoint, StatePlace
from .operating_point import OperatingPoint
from .rows import NO_UNIT
from .signals import Signal


def extended(point: OperatingPoint, inputs: Iterable[Signal], outputs: Iterable[Signal]) -> OperatingPoint:
    """The operating point with all that these signals need.

    An input at every stabilizer port named, a device that draws every power named, and sensors of the frequency, and of
    its rate, at every bus named.
    """
    ports = [s for s in dict.fromkeys(inputs) if s.kind == "vs" and _missing(point, _unit(point, s), "added Vs")]
    powers = [s for s in dict.fromkeys(inputs) if s.kind in ins.DRAWN and _missing(point, NO_UNIT, s.label)]
    rates = [s.number for s in dict.fromkeys(outputs) if s.kind == "rocof" and not _measured(point, "rocof", s.number)]
    at = dict.fromkeys([*rates, *(s.number for s in outputs if s.kind == "bus_frequency")])
    buses = [bus for bus in at if not _measured(point, "bus_frequency", bus)]
    if not (ports or powers or buses or rates):
        return point
    more = Extension(point)
    for signal in ports:
        _add_input(more, signal)
    for signal in powers:
        _add_draw(more, signal)
    frequency = {bus: _add_sensor(more, bus) for bus in buses}
    for bus in rates:
        _add_rate(more, bus, frequency.get(bus))
    return more.build()


def sensor(point: OperatingPoint, table: str, bus: int) -> int:
    """Place of the output of a sensor at a bus."""
    f = point.system.family(table)
    at = point.layout.nx + 2 * point.net.place[bus]
    return int(f.w[f.w[:, family.BUS] == at][0, -1])


def _missing(point: OperatingPoint, unit: int, name: str) -> bool:
    return point.layout.setpoint(unit, name) is None


def _measured(point: OperatingPoint, table: str, bus: int) -> bool:
    at = point.layout.nx + 2 * point.net.place[bus]
    return point.system.has(table) and at in point.system.family(table).w[:, family.BUS]


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


def _add_draw(more: Extension, signal: Signal) -> None:
    """A device that draws a set-point, which is 0."""
    bus, par = ins.draw(more.point, signal)
    at = more.point.layout.nx + 2 * bus
    setpoint = more.setpoint(SetPoint(NO_UNIT, signal.label, signal.label, 0.0), 0.0)
    more.add("drawn", drawn, [0, at, at, NO_UNIT, setpoint, at], par, f"bus {signal.number}")


def _add_rate(more: Extension, bus: int, frequency: int | None) -> None:
    """A sensor of the rate of a measured frequency."""
    point = more.point
    where = StatePlace("rocof", 0, NO_UNIT, "f", f"f rocof {bus}")
    par, state = rocof.Par(point.case.frequency_hz), more.states([where], [1.0])
    at = point.layout.nx + 2 * point.net.place[bus]
    read = sensor(point, "bus_frequency", bus) if frequency is None else frequency
    more.add("rocof", rocof, [state, at, at, NO_UNIT, read, more.outputs([0.0])], par, f"bus {bus}")


def _add_sensor(more: Extension, bus: int) -> int:
    """A sensor of the frequency of a bus; place of its output."""
    point = more.point
    V, par = point.V[point.net.place[bus]], bus_frequency.Par(2 * np.pi * point.case.frequency_hz)
    where = StatePlace("bus_frequency", 0, NO_UNIT, "theta", f"theta bus frequency {bus}")
    state = more.states([where], list(bus_frequency.guess(V, par)))
    at = point.layout.nx + 2 * point.net.place[bus]
    out = more.outputs([1.0])
    more.add("bus_frequency", bus_frequency, [state, at, at, NO_UNIT, out], par, f"bus {bus}")
    return out
