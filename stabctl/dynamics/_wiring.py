"""Connections: which devices provide each signal, what every input reads, sums and sensors in between.

An input reads the signal with its name in its unit. A port reads the output that drives it, or its set-point if there
is none; a summing port reads the sum of the outputs that drive it, or zero. A remote input reads a signal of another
machine, or a sensor, of which there is one at every bus that such an input names.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, get_args, get_type_hints

import numpy as np

from stabctl import devices
from stabctl._util.errors import EquilibriumError
from stabctl.devices.device import Device, of
from stabctl.devices.ports import At, Port
from stabctl.model.case import Case
from stabctl.model.network import Network

from . import adder, family
from .family import Family
from .layout import WORDS, Layout, SetPoint, StatePlace
from .rows import NO_UNIT, Row


class Wiring:
    """Assigns a place to every signal."""

    def __init__(self, case: Case, tables: Mapping[str, list[Row]], buses: int, net: Network) -> None:
        self.case, self.tables, self.buses, self.net = case, _with_sensors(case, tables, net), buses, net
        self.devices = {name: devices.every()[name] for name in self.tables}
        self.units = {name: np.array([row.unit for row in rows]) for name, rows in self.tables.items()}
        self.providers = _Providers(len(case.machines))
        self.states: list[StatePlace] = []
        self.first_state: dict[str, int] = {}
        for name, rows in self.tables.items():
            self._states(name, rows)
        self.nx = len(self.states)
        self.first_setpoint = self.nx + 2 * buses
        self._ports()
        self.step = self.first_setpoint + len(self.setpoints)
        self._outputs()

    def _states(self, name: str, rows: list[Row]) -> None:
        device = self.devices[name]
        states, first = device.State._fields, len(self.states)
        self.first_state[name] = first
        words, in_unit = [(state, WORDS.get(state, state)) for state in states], self._in_unit(name)
        self.states += [
            StatePlace(name, j, row.unit if in_unit else NO_UNIT, state, f"{word} {row.label}")
            for j, row in enumerate(rows)
            for state, word in words
        ]
        if device.role in ("machine", "converter"):
            for i, state in enumerate(states):
                self.providers.add(state, self.units[name], first + i + len(states) * np.arange(len(rows)))

    def _in_unit(self, name: str) -> bool:
        """Whether the devices of a table belong to units."""
        return self.devices[name].role in devices.UNIT_ROLES

    def _ports(self) -> None:
        """Add the set-points of the ports that no device drives."""
        in_unit = {name for name in self.tables if self._in_unit(name)}
        filled = {
            (unit, output)
            for name in in_unit
            for output in self.devices[name].Output._fields
            for unit in self.units[name].tolist()
        }
        self.setpoints: list[SetPoint] = []
        self.setpoint_of: dict[tuple[Any, str], int] = {}
        for name, rows in self.tables.items():
            for signal, port in _markers(self.devices[name]).items():
                if not isinstance(port, Port) or port.summing:
                    continue
                for j, row in enumerate(rows):
                    key = row.unit if name in in_unit else (name, j), signal
                    if key not in self.setpoint_of and key not in filled:
                        self.setpoint_of[key] = len(self.setpoints)
                        unit = row.unit if name in in_unit else NO_UNIT
                        self.setpoints.append(SetPoint(unit, signal, f"{signal} {row.label}", port.start))

    def _outputs(self) -> None:
        at = self.step + 3
        self.first_output: dict[str, int] = {}
        for name, rows in self.tables.items():
            device = self.devices[name]
            self.first_output[name], stride = at, family.stride(device)
            if self._in_unit(name):
                for i, output in enumerate(device.Output._fields):
                    self.providers.add(output, self.units[name], at + i + stride * np.arange(len(rows)))
            at += len(rows) * stride
        self.sums = _Sums(self.step + 1, at)

    def families(self) -> tuple[Family, ...]:
        """The tables of places and parameters."""
        made = []
        for name, rows in self.tables.items():
            device = self.devices[name]
            states, outputs = len(device.State._fields), family.stride(device)
            w = np.empty((len(rows), family.width(device)), np.int64)
            j = np.arange(len(rows))
            w[:, family.STATE] = self.first_state[name] + states * j
            w[:, family.BUS] = self.nx + 2 * np.array([row.bus for row in rows])
            w[:, family.BUS2] = self.nx + 2 * np.array([row.bus2 for row in rows])
            w[:, family.UNIT] = self.units[name]
            for c, (signal, hint) in enumerate(_markers(device).items()):
                w[:, family.INPUTS + c] = self._inputs(name, signal, hint)
            w[:, -1] = self.first_output[name] + outputs * j
            k = np.array([row.par for row in rows], float).reshape(len(rows), -1)
            made.append(Family(name, device, w, k, tuple(row.key for row in rows)))
        return (*made, *self.sums.families())

    def _inputs(self, name: str, signal: str, hint: Any) -> np.ndarray:
        """Places of the signals that an input of the devices of a table reads."""
        rows, units = self.tables[name], self.units[name]
        if isinstance(hint, At):
            return np.array([self._elsewhere(hint, row) for row in rows])
        in_unit = self._in_unit(name)
        found = self.providers.of(signal, units) if in_unit else np.zeros((0, len(rows)), int)
        count = (found >= 0).sum(axis=0)
        if isinstance(hint, Port) and hint.summing:
            return np.array([self.sums.of(found[:n, j].tolist()) for j, n in enumerate(count)])
        out = found[0].copy() if len(found) else np.full(len(rows), -1)
        for j in np.flatnonzero(count != 1):
            key = int(units[j]) if in_unit else (name, int(j))
            if count[j] or not isinstance(hint, Port):
                raise EquilibriumError(self._unclear(name, rows[j], signal, found[: count[j], j]))
            out[j] = self.first_setpoint + self.setpoint_of[key, signal]
        return out

    def _elsewhere(self, at: At, row: Row) -> int:
        """Place of the signal that a remote input of a device reads: that of a sensor, or of another machine."""
        if at.signal in self.tables:
            buses = [s.bus for s in self.tables[at.signal]]
            stride = family.stride(self.devices[at.signal])
            return self.first_output[at.signal] + stride * buses.index(_bus_of(self.case, self.net, at, row))
        number = int(getattr(row.par, at.place))
        units = {m.machine: i for i, m in enumerate(self.case.machines)}
        unit = units.get(number, NO_UNIT) if number else row.unit
        found = self.providers.of(at.signal, np.array([unit]))
        if unit == NO_UNIT or not (found >= 0).any():
            called = number if unit == NO_UNIT else self.case.machines[unit].called
            raise EquilibriumError(
                f"Machine {called} of {self.case.name} has no signal {at.signal}, which {row.label} reads; choose "
                "another machine."
            )
        return int(found[0, 0])

    def _unclear(self, name: str, row: Row, signal: str, places: np.ndarray) -> str:
        """The error for an input that no device, or more than one device, drives."""
        if len(places):
            names = " and ".join(self.devices[self._table(place)].name for place in places)
            return f"{names} both provide {signal} of {row.key} in {self.case.name}; keep one of them."
        return (
            f"{self.devices[name].name} of {row.key} in {self.case.name} reads {signal}, which no device of its "
            "unit provides; use another model."
        )

    def _table(self, place: int) -> str:
        """The table of the device that gives a state or output."""
        if place < self.nx:
            return self.states[place].table
        return max((first, name) for name, first in self.first_output.items() if first <= place)[1]

    def layout(self) -> Layout:
        """Places in s, after `families`."""
        owner = np.full(self.sums.end, NO_UNIT, np.int64)
        owner[: self.nx] = [place.unit for place in self.states]
        owner[self.first_setpoint : self.step] = [point.unit for point in self.setpoints]
        for name, units in self.units.items():
            device = self.devices[name]
            if self._in_unit(name):
                first, n = self.first_output[name], family.stride(device)
                owner[first : first + n * len(units)] = np.repeat(units, n)
        outputs = self.sums.end - self.step - 3
        return Layout(tuple(self.states), tuple(self.setpoints), self.buses, outputs, 0, self._signals(), owner)

    def _signals(self) -> dict[tuple[int, str], int]:
        """Unit and name of every signal -> its place; that of the sum where several devices give it."""
        signals: dict[tuple[int, str], int] = {}
        for signal, layers in self.providers:
            signals |= {(unit, signal): place for unit, place in enumerate(layers[0].tolist()) if place >= 0}
        for places, out in self.sums.places.items():
            signals |= {key: out for key, place in signals.items() if place == places[0]}
        for k, point in enumerate(self.setpoints):
            if point.unit != NO_UNIT:
                signals.setdefault((point.unit, point.name), self.first_setpoint + k)
        return signals


def _with_sensors(case: Case, tables: Mapping[str, list[Row]], net: Network) -> dict[str, list[Row]]:
    """The devices of every table, and the sensors that they read."""
    found, every = {name: list(rows) for name, rows in tables.items()}, devices.every()
    for name, rows in tables.items():
        for hint in _markers(every[name]).values():
            if not (isinstance(hint, At) and hint.signal in every and every[hint.signal].role == "sensor"):
                continue
            sensors = found.setdefault(hint.signal, [])
            for row in rows:
                bus = _bus_of(case, net, hint, row)
                if bus not in [sensor.bus for sensor in sensors]:
                    sensors.append(_sensor(case, hint.signal, bus))
    return found


def _sensor(case: Case, name: str, bus: int) -> Row:
    device, number = devices.every()[name], case.buses[bus].bus
    par = device.Par(2 * np.pi * case.frequency_hz) if device.Par._fields else ()
    return Row(NO_UNIT, bus, bus, par, f"{device.name} {number}", f"bus {number}")


def _bus_of(case: Case, net: Network, at: At, row: Row) -> int:
    """Row of the bus whose number is a device's parameter; its own bus if that is 0."""
    number = int(getattr(row.par, at.place))
    if number and number not in net.place:
        raise EquilibriumError(
            f"There is no bus {number} in {case.name}, the {at.place} of {row.label}; choose another."
        )
    return net.place[number] if number else row.bus


@cache
def _markers(device: Device) -> dict[str, Any]:
    """Inputs of a device, each with its marker (Port, At) or None."""
    hints = get_type_hints(device.Input, include_extras=True)
    return {
        name: next((m for m in get_args(hints[name]) if isinstance(m, Port | At)), None)
        for name in device.Input._fields
    }


class _Providers:
    """Places of the signals that the devices of every unit provide; several devices may provide the same signal."""

    def __init__(self, units: int) -> None:
        self._units = units
        self._layers: dict[str, list[np.ndarray]] = {}  # signal -> (units) places of each provider, -1: none

    def add(self, signal: str, units: np.ndarray, places: np.ndarray) -> None:
        """Add a signal that devices of these units provide at these places."""
        layers = self._layers.setdefault(signal, [])
        depth = 0
        while len(units):
            if depth == len(layers):
                layers.append(np.full(self._units, -1))
            rank, earliest = np.arange(len(units)), np.empty(self._units, np.int64)
            earliest[units[::-1]] = rank[::-1]
            first = (earliest[units] == rank) & (layers[depth][units] < 0)
            layers[depth][units[first]] = places[first]
            units, places = units[~first], places[~first]
            depth += 1

    def of(self, signal: str, units: np.ndarray) -> np.ndarray:
        """Places (providers, units) of a signal of these units; -1 if there is no further device."""
        return np.array([layer[units] for layer in self._layers.get(signal, ())], int).reshape(-1, len(units))

    def __iter__(self) -> Iterator[tuple[str, np.ndarray]]:
        """Every signal with its places (providers, units)."""
        return ((signal, np.array(layers)) for signal, layers in self._layers.items())


class _Sums:
    """Assigns a place to every sum of signals that drive a summing port, once."""

    def __init__(self, zero: int, end: int) -> None:
        self._zero, self.end = zero, end  # places of the constant 0, the sum of nothing, and of the next output
        self.places: dict[tuple[int, ...], int] = {}  # places that are added up -> place of their sum

    def of(self, places: list[int]) -> int:
        """Place of the sum of the signals at these places."""
        if len(places) < 2:
            return places[0] if places else self._zero
        if tuple(places) not in self.places:
            self.places[tuple(places)] = self.end
            self.end += 1
        return self.places[tuple(places)]

    def families(self) -> list[Family]:
        """The devices that add, two signals at a time."""
        rows = []
        for places, out in self.places.items():
            left = places[0]
            for i, right in enumerate(places[1:]):
                last = i == len(places) - 2
                here = out if last else self.end
                self.end += not last
                rows.append([0, 0, 0, NO_UNIT, left, right, here])
                left = here
        if not rows:
            return []
        w = np.array(rows, np.int64)
        return [Family("adder", of(adder), w, np.zeros((len(rows), 0)), ("a summing port",) * len(rows))]
