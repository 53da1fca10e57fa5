"""Devices added to an operating point that do not move it: sensors, summing inputs, drawn powers, controllers.

New states, set-points, outputs and memory get their places behind the existing ones of the same kind, so all places
change. While an extension is being built, new places are counted from virtual origins.

`extended` adds what the signals of linear models and controllers need. Each of their inputs is then a set-point.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from types import ModuleType
from typing import NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.devices.device import of
from stabctl.devices.loads import zip_load
from stabctl.devices.sensors import bus_frequency, rocof

from . import adder, drawn, family, storage
from .assembly import System
from .family import CURRENT, Family, limits
from .layout import Layout, SetPoint, StatePlace
from .operating_point import OperatingPoint
from .rows import NO_UNIT
from .signals import OF_CONVERTER, OF_STORAGE, Signal, port

STATES, SETPOINTS, OUTPUTS, MEMORY = (k << 40 for k in range(1, 5))  # virtual origins
PORTS = {
    "vs": "added Vs",
    "vref": "Vref",
    "pref": "Pref",
    "field": "Efd",
    "power": "Pm",
    "ipcmd": "Ipcmd",
    "iqcmd": "Iqcmd",
}  # input -> the port whose set-point it is
DRAWN = ("storage", "load_p", "load_q")  # inputs that are powers drawn from a bus, each added with its device


class Extension:
    """An operating point with more devices. `add` them with places of `point.s`, or those given here; then `build`.

    Parameters
    ----------
    point : OperatingPoint
        The operating point; it is not changed.
    """

    def __init__(self, point: OperatingPoint) -> None:
        self.point = point
        self._families = [f._replace(w=f.w.copy()) for f in point.system.families]
        self._states: list[StatePlace] = []
        self._setpoints: list[SetPoint] = []
        self._values: dict[int, list[float]] = {STATES: [], SETPOINTS: [], OUTPUTS: []}
        self._owners: list[int] = []
        self._memory = 0

    def states(self, places: Sequence[StatePlace], values: Sequence[float]) -> int:
        """Place of the first of new states, with their values at the operating point."""
        self._states += places
        self._values[STATES] += values
        return STATES + len(self._states) - len(places)

    def setpoint(self, one: SetPoint, value: float) -> int:
        """Place of a new set-point."""
        self._setpoints.append(one)
        self._values[SETPOINTS].append(value)
        return SETPOINTS + len(self._setpoints) - 1

    def outputs(self, values: Sequence[float], unit: int = -1) -> int:
        """Place of the first of new outputs, with their values; they are 0 while their unit (if any) is off."""
        self._values[OUTPUTS] += values
        self._owners += [unit] * len(values)
        return OUTPUTS + len(self._owners) - len(values)

    def memory(self, count: int) -> int:
        """Place of the first of `count` new values that are kept from frame to frame, 0 at the start."""
        self._memory += count
        return MEMORY + self._memory - count

    def add(self, name: str, module: ModuleType, w: Sequence[int], k: Sequence[float], key: str) -> None:
        """Add one device with its places and constants, to its family if there is one of the same size."""
        device = of(module)
        row = np.array([w], np.int64), np.array([k], float).reshape(1, -1)
        for i, f in enumerate(self._families):
            if f.name == name and (f.w.shape[1], f.k.shape[1]) == (len(w), len(k)) and not device.single:
                both = np.vstack([f.w, row[0]]), np.vstack([f.k, row[1]])
                self._families[i] = Family(name, device, *both, (*f.keys, key))
                return
        self._families.append(Family(name, device, *row, (key,)))

    def readers(self, place: int) -> list[tuple[int, int, int]]:
        """Inputs (family, row, column) of the present devices that read a place."""
        return [
            (i, int(row), int(column))
            for i, f in enumerate(self._families)
            for row, column in np.argwhere(f.w[:, family.INPUTS : -1] == place) + [0, family.INPUTS]
        ]

    def ports(self, unit: int, name: str) -> list[tuple[int, int, int]]:
        """Inputs (family, row, column) with this name of the controls of a unit."""
        return [
            (i, int(row), family.INPUTS + f.device.Input._fields.index(name))
            for i, f in enumerate(self._families)
            if name in f.device.Input._fields
            for row in np.flatnonzero(f.w[:, family.UNIT] == unit)
        ]

    def connected(self, ports: Sequence[tuple[int, int, int]], place: int) -> int:
        """Let these inputs read another place; returns the place that they read before."""
        before = {int(self._families[i].w[row, column]) for i, row, column in ports}
        for i, row, column in ports:
            self._families[i].w[row, column] = place
        (one,) = before
        return one

    def value(self, place: int) -> float:
        """Value of a signal at the operating point."""
        kind, index = place >> 40, place & ((1 << 40) - 1)
        return float(self._values[kind << 40][index] if kind else self.point.s[place])

    def build(self) -> OperatingPoint:
        """The operating point with the new devices."""
        point, old = self.point, self.point.layout
        places = self._places()
        families = tuple(f._replace(w=_moved(f.w, places)) for f in self._families)
        owner = np.full(places(np.array([MEMORY]))[0] + self._memory, -1, np.int64)
        owner[places(np.arange(old.first_memory))] = old.owner[: old.first_memory]
        first = places(np.array([OUTPUTS]))[0]
        owner[first : first + len(self._owners)] = self._owners
        owner[old.nx : old.nx + len(self._states)] = [p.unit for p in self._states]
        layout = replace(
            old, states=(*old.states, *self._states), setpoints=(*old.setpoints, *self._setpoints),
            outputs=old.outputs + len(self._owners), memory=self._memory, owner=owner,
            signals={key: int(places(np.array([at]))[0]) for key, at in old.signals.items()},
        )  # fmt: skip
        s = np.zeros(layout.size)
        s[places(np.arange(old.first_memory))] = point.s[: old.first_memory]
        for origin, values in self._values.items():
            s[places(origin + np.arange(len(values)))] = values
        system = self._system(families, layout.one)
        system = replace(system, rotors=system.rotors._replace(speed=places(system.rotors.speed)))
        return replace(point, system=replace(system, layout=layout), s=s, stages={})

    def _system(self, families: tuple[Family, ...], one: int) -> System:
        """The system with these families; its buses with voltage-dependent currents may be more."""
        old, added = self.point.system, families[len(self.point.system.families) :]
        new = [f.w[:, family.BUS] for f in added if CURRENT in family.operations(f)]
        first = self.point.layout.nx + len(self._states)
        buses = np.union1d(old.draw_bus, (np.concatenate(new) - first) // 2) if new else old.draw_bus
        return replace(old, families=families, limits=limits(families, one), draw_bus=buses, kept={})

    def place(self, given: int) -> int:
        """Place after `build` of a place of `point.s` or of one given here."""
        return int(self._places()(np.array([given]))[0])

    def _places(self) -> "_Places":
        return _Places(self.point.layout, len(self._states), len(self._setpoints), len(self._owners))


class _Places:
    """New places from old and virtual ones."""

    def __init__(self, old: Layout, states: int, setpoints: int, outputs: int) -> None:
        self._nx, self._step, self._states, self._setpoints = old.nx, old.step, states, setpoints
        last = old.first_memory + states + setpoints
        self._origin = np.array([0, old.nx, old.step + states, last, last + outputs])

    def __call__(self, at: np.ndarray) -> np.ndarray:
        kind, index = at >> 40, at & ((1 << 40) - 1)
        shifted = at + self._states * (at >= self._nx) + self._setpoints * (at >= self._step)
        return np.where(kind > 0, self._origin[np.clip(kind, 0, 4)] + index, shifted)


def _moved(w: np.ndarray, places: _Places) -> np.ndarray:
    """A table of places with the new ones; units keep their rows."""
    out = places(w)
    out[:, family.UNIT] = w[:, family.UNIT]
    return out


def extended(point: OperatingPoint, inputs: Iterable[Signal], outputs: Iterable[Signal]) -> OperatingPoint:
    """The operating point with all that these signals need.

    An input at every stabilizer port named, a device that draws every power named, and sensors of the frequency, and of
    its rate, at every bus named.
    """
    added = [s for s in dict.fromkeys(inputs) if s.kind == "vs" and _missing(point, _unit(point, s), "added Vs")]
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
    setpoint = more.setpoint(SetPoint(unit, "added Vs", signal.label, 0.0), 0.0)
    before = more.connected(ports, 0)
    out = more.outputs([float(more.point.s[before])], unit)
    more.connected(ports, out)
    more.add("adder", adder, [0, 0, 0, unit, before, setpoint, out], [], f"machine {signal.number}")


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
        name = PORTS.get(signal.kind) or port(case, signal.number, signal.kind)
        found = point.layout.setpoint(_unit(point, signal), str(name))
    if found is None and signal.kind in OF_CONVERTER:
        raise StudyError(f"A control of converter {signal.number} sets {PORTS[signal.kind]}, so it is not an input.")
    if found is None:
        raise StudyError(f"{signal.label} of {case.name} is set by another device, so it is not an input.")
    return found


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
