"""Inputs of linear models and controllers: each is a set-point, and `extended` adds the devices that this needs.

`outputs` is the counterpart, for what is read.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from stabctl import devices
from stabctl._util.errors import StudyError
from stabctl.devices.loads import zip_load
from stabctl.devices.sensors import bus_frequency, rocof
from stabctl.model import naming

from . import adder, drawn, family, storage
from .extension import Extension
from .layout import SetPoint, StatePlace
from .operating_point import OperatingPoint
from .rows import NO_UNIT
from .signals import CONTROLS, OF_CONVERTER, OF_STORAGE, Signal, port

ADDED = "added Vs"  # set-point that an exciter reads beside its stabilizers
SETPOINT_OF = {
    "vs": ADDED,
    "vref": "Vref",
    "pref": "Pref",
    "field": "Efd",
    "power": "Pm",
    "ipcmd": "Ipcmd",
    "iqcmd": "Iqcmd",
}  # input -> its set-point
DRAWN = ("storage", "load_p", "load_q")  # inputs that are powers drawn from a bus, each added with its device


def extended(point: OperatingPoint, inputs: Iterable[Signal], outputs: Iterable[Signal]) -> OperatingPoint:
    """The operating point with all that these signals need.

    An input at every stabilizer port named, a device that draws every power named, and sensors of the frequency, and of
    its rate, at every bus named.
    """
    added = [s for s in dict.fromkeys(inputs) if s.kind == "vs" and _missing(point, _unit(point, s), ADDED)]
    powers = [s for s in dict.fromkeys(inputs) if s.kind in DRAWN and _missing(point, NO_UNIT, s.label)]
    rates = [s.number for s in dict.fromkeys(outputs) if s.kind == "rocof" and not _measured(point, "rocof", s.number)]
    at = dict.fromkeys([*rates, *(s.number for s in outputs if s.kind == "bus_frequency")])
    buses = [bus for bus in at if not _measured(point, "bus_frequency", bus)]
    if not (added or powers or buses or rates):
        return point
    more = Extension(point)
    for signal in added:
        _add_input(more, signal)
    for signal in powers:
        _add_draw(more, signal)
    frequency = {bus: _add_sensor(more, bus) for bus in buses}
    for bus in rates:
        _add_rate(more, bus, frequency.get(bus))
    return more.build()


def _missing(point: OperatingPoint, unit: int, name: str) -> bool:
    """Whether there is no set-point of this name."""
    return point.layout.setpoint(unit, name) is None


def _measured(point: OperatingPoint, table: str, bus: int) -> bool:
    """Whether there is a sensor at a bus."""
    at = point.layout.nx + 2 * point.net.place[bus]
    return point.system.has(table) and at in point.system.family(table).w[:, family.BUS]


def _unit(point: OperatingPoint, signal: Signal) -> int:
    """Row of the unit of a signal."""
    return [m.machine for m in point.case.machines].index(signal.number)


def _add_input(more: Extension, signal: Signal) -> None:
    """The exciter reads its stabilizers plus a set-point, which is 0."""
    unit = _unit(more.point, signal)
    ports = more.ports(unit, "Vs")
    setpoint = more.setpoint(SetPoint(unit, ADDED, signal.label, 0.0), 0.0)
    before = more.connected(ports, 0)
    out = more.outputs([float(more.point.s[before])], unit)
    more.connected(ports, out)
    more.add("adder", adder, [0, 0, 0, unit, before, setpoint, out], [], f"machine {signal.called}")


def _add_draw(more: Extension, signal: Signal) -> None:
    """A device that draws a set-point, which is 0."""
    bus, par = draw(more.point, signal)
    at = more.point.layout.nx + 2 * bus
    setpoint = more.setpoint(SetPoint(NO_UNIT, signal.label, signal.label, 0.0), 0.0)
    more.add("drawn", drawn, [0, at, at, NO_UNIT, setpoint, at], par, f"bus {signal.number}")


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


def _add_rate(more: Extension, bus: int, frequency: int | None) -> None:
    """A sensor of the rate of a measured frequency."""
    point = more.point
    where = StatePlace("rocof", 0, NO_UNIT, "f", f"f rocof {bus}")
    par, state = rocof.Par(point.case.frequency_hz), more.states([where], [1.0])
    at = point.layout.nx + 2 * point.net.place[bus]
    read = sensor(point, "bus_frequency", bus) if frequency is None else frequency
    more.add("rocof", rocof, [state, at, at, NO_UNIT, read, more.outputs([0.0])], par, f"bus {bus}")


def sensor(point: OperatingPoint, table: str, bus: int) -> int:
    """Place of the output of a sensor at a bus."""
    f = point.system.family(table)
    at = point.layout.nx + 2 * point.net.place[bus]
    return int(f.w[f.w[:, family.BUS] == at][0, -1])


def place(point: OperatingPoint, signal: Signal) -> int:
    """Place in s of an input, in a point that `extended` has prepared for it.

    Raises `StudyError` if another device sets it, or it has no effect.
    """
    case = point.case
    if signal.kind in OF_STORAGE:
        row = naming.row(case, "storage", str(signal.place))
        at = int(getattr(storage.places(point.system, case), signal.kind)[row])
        if at < 0:
            raise StudyError(_without_effect(point, signal, row))
        return at
    found: int | None
    if signal.kind in DRAWN:
        found = point.layout.setpoint(NO_UNIT, signal.label)
    else:
        name = SETPOINT_OF.get(signal.kind) or port(case, signal.number, signal.kind)
        found = point.layout.setpoint(_unit(point, signal), str(name))
    if found is None and signal.kind in OF_CONVERTER:
        raise StudyError(
            f"A control of converter {signal.called} sets {SETPOINT_OF[signal.kind]}, so it is not an input."
        )
    if found is None:
        raise StudyError(f"{signal.label} of {case.name} is set by another device, so it is not an input.")
    if signal.kind in ("qset", "vset") and (why := _unread(point, signal)):
        raise StudyError(f"Unit {signal.called} of {case.name} {why}.")
    return found


def _unread(point: OperatingPoint, signal: Signal) -> str:
    """Why the controls of a converter do not read a set-point of reactive power or voltage; empty if they do."""
    flags: dict[str, float] = {}
    for f in point.system.families:
        if f.device.role in CONTROLS:
            for k in f.k[f.w[:, family.UNIT] == _unit(point, signal)]:
                flags |= zip(f.device.Par._fields, k, strict=True)
    if flags.get("PfFlag", 0) > 0.5:
        return f"keeps its power factor (PfFlag = 1), so {signal.kind} has no effect on it; set PfFlag = 0"
    holds, other = ("voltage", "vset") if flags.get("RefFlag", 0) > 0.5 else ("reactive power", "qset")
    if "RefFlag" in flags and other != signal.kind:
        return (
            f"controls its {holds} (RefFlag = {flags['RefFlag']:g}), so {signal.kind} has no effect on it; give {other}"
        )
    return ""


def _without_effect(point: OperatingPoint, signal: Signal, row: int) -> str:
    """Why an order of reactive power or voltage has no effect on a storage device, and what to do."""
    plant = "repc_RefFlag" in devices.every()[point.case.storage[row].device].Par._fields
    flags = "repc_RefFlag=1" if plant else "QFlag=1 VFlag=0"
    has, advice = "has no", f"set {flags}" if plant else f"make it grid-forming, or grid-following with {flags}"
    if signal.kind == "order_q":
        has, advice = f"with {flags} follows its", "give order_v"
    return (
        f"The storage device {signal.place} of {point.case.name} {has} voltage reference, so {signal.kind} has no "
        f"effect on it; {advice}."
    )


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


def draw(point: OperatingPoint, signal: Signal) -> Draw:
    """The drawn power: constant power for a storage device, the voltage dependence of the first load for a load."""
    bus = point.net.place[signal.number]
    v0 = float(abs(point.V[bus]))
    if signal.kind == "storage":
        return Draw(bus, zip_load.from_case(Shares(p_power=1.0), 1.0, 0.0, v0))
    load = next((b for b in point.case.loads if b.bus == signal.place), Shares())
    return Draw(bus, zip_load.from_case(load, *((0.0, 1.0) if signal.kind == "load_q" else (1.0, 0.0)), v0))
