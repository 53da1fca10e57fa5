"""Places of all signals: states, set-points and outputs, and which of them every input reads.

An input reads the signal of that name in its unit. A port reads what fills it, else its set-point; a summing port the
sum of what fills it, else zero.
"""

from collections.abc import Mapping
from functools import cache
from types import ModuleType
from typing import Any, get_args, get_type_hints

import numpy as np

from stabctl import devices
from stabctl.devices.ports import At, Port
from stabctl.errors import EquilibriumError
from stabctl.model.case import Case
from stabctl.model.network import Network

from . import adder, family
from .layout import WORDS, Layout, SetPoint, StatePlace
from .program import Family
from .rows import NO_UNIT, Row


class Wiring:
    """Gives every signal its place."""

    def __init__(self, case: Case, tables: Mapping[str, list[Row]], buses: int, net: Network) -> None:
        self.case, self.tables, self.buses, self.net = case, dict(tables), buses, net
        self.states: list[StatePlace] = []
        self.setpoints: list[SetPoint] = []
        self.first_state: dict[str, int] = {}
        self.given: dict[tuple[int, str], list[tuple[str, int]]] = {}  # unit, name -> devices (table, row) that give it
        self._sensors()
        for name, rows in self.tables.items():
            self._states(name, rows)
        self.nx = len(self.states)
        self._ports()
        self.step = self.nx + 2 * buses + len(self.setpoints)
        self._outputs()

    def _sensors(self) -> None:
        """A sensor for every bus that an input elsewhere asks for."""
        for name, rows in list(self.tables.items()):
            for at, row in (
                (hint, row) for hint in _inputs(devices.every()[name]).values() for row in rows if isinstance(hint, At)
            ):
                if at.signal in devices.every() and devices.every()[at.signal].ROLE == "sensor":
                    bus, sensors = self._bus(at, row), self.tables.setdefault(at.signal, [])
                    if bus not in [s.bus for s in sensors]:
                        sensors.append(self._sensor(at.signal, bus))

    def _sensor(self, name: str, bus: int) -> Row:
        device, number = devices.every()[name], self.case.buses[bus].bus
        par = device.Par(2 * np.pi * self.case.frequency_hz) if hasattr(device, "Par") else ()
        return Row(NO_UNIT, bus, bus, par, f"{device.NAME} {number}", f"bus {number}")

    def _bus(self, at: At, row: Row) -> int:
        number = int(getattr(row.par, at.place))
        if number and number not in self.net.place:
            raise EquilibriumError(
                f"There is no bus {number} in {self.case.name}, which {row.label} names as {at.place}."
            )
        return self.net.place[number] if number else row.bus

    def _states(self, name: str, rows: list[Row]) -> None:
        device = devices.every()[name]
        self.first_state[name] = len(self.states)
        for j, row in enumerate(rows):
            for state in family.fields(device, "State"):
                at = row.unit if device.ROLE in devices.UNIT_ROLES else NO_UNIT
                if device.ROLE in ("machine", "converter"):
                    self.given.setdefault((row.unit, state), []).append((name, j))
                self.states.append(StatePlace(name, j, at, state, f"{WORDS.get(state, state)} {row.label}"))

    def _ports(self) -> None:
        """Who gives each signal of a unit, and the set-points of the ports that nobody fills."""
        for name, rows in self.tables.items():
            if devices.every()[name].ROLE in devices.UNIT_ROLES:
                for j, row in enumerate(rows):
                    for output in family.fields(devices.every()[name], "Output"):
                        self.given.setdefault((row.unit, output), []).append((name, j))
        self.setpoint_of: dict[tuple[Any, str], int] = {}
        for name, rows in self.tables.items():
            device = devices.every()[name]
            in_unit = device.ROLE in devices.UNIT_ROLES
            ports = {k: port for k, port in _inputs(device).items() if isinstance(port, Port) and not port.summing}
            for signal, port in ports.items():
                for j, row in enumerate(rows):
                    key = self._owner(name, j, row), signal
                    if key not in self.setpoint_of and not (in_unit and (row.unit, signal) in self.given):
                        self.setpoint_of[key] = len(self.setpoints)
                        unit = row.unit if in_unit else NO_UNIT
                        self.setpoints.append(SetPoint(unit, signal, f"{signal} {row.label}", port.start))

    @staticmethod
    def _owner(name: str, j: int, row: Row) -> Any:
        """Whose set-point it is: the unit's, or that of the device alone."""
        return row.unit if devices.every()[name].ROLE in devices.UNIT_ROLES else (name, j)

    def _outputs(self) -> None:
        at = self.step + 3
        self.first_output: dict[str, int] = {}
        for name, rows in self.tables.items():
            self.first_output[name] = at
            at += len(rows) * family.stride(devices.every()[name])
        self.sums: list[tuple[int, list[int]]] = []  # outputs, and the places each adds up
        self.end = at

    def place(self, name: str, j: int, signal: str) -> int:
        """Place of a state or output of a device."""
        device = devices.every()[name]
        states, outputs = family.fields(device, "State"), family.fields(device, "Output")
        if signal in outputs:
            return self.first_output[name] + j * family.stride(device) + outputs.index(signal)
        return self.first_state[name] + j * len(states) + states.index(signal)

    def _input(self, name: str, j: int, row: Row, signal: str, hint: Any) -> int:
        """Place of the signal that an input reads."""
        givers = self.given.get((row.unit, signal), []) if devices.every()[name].ROLE in devices.UNIT_ROLES else []
        if isinstance(hint, At):
            return self._elsewhere(hint, row)
        if isinstance(hint, Port) and hint.summing:
            return self._sum([self.place(*giver, signal) for giver in givers])
        if len(givers) > 1:
            names = " and ".join(f"{devices.every()[n].NAME}" for n, _ in givers)
            raise EquilibriumError(f"{names} both give {signal} of {row.key} in {self.case.name}; keep one of them.")
        if givers:
            return self.place(*givers[0], signal)
        if isinstance(hint, Port):
            return self.nx + 2 * self.buses + self.setpoint_of[self._owner(name, j, row), signal]
        raise EquilibriumError(
            f"{devices.every()[name].NAME} of {row.key} in {self.case.name} reads {signal}, which no device of its "
            "unit gives; use another model."
        )

    def _elsewhere(self, at: At, row: Row) -> int:
        if at.signal in self.tables:
            buses = [s.bus for s in self.tables[at.signal]]
            return self.place(at.signal, buses.index(self._bus(at, row)), devices.every()[at.signal].Output._fields[0])
        number = int(getattr(row.par, at.place))
        units = {m.machine: i for i, m in enumerate(self.case.machines)}
        givers = self.given.get((units.get(number, NO_UNIT) if number else row.unit, at.signal), [])
        if not givers:
            raise EquilibriumError(
                f"Machine {number} of {self.case.name} gives no {at.signal}, which {row.label} reads."
            )
        return self.place(*givers[0], at.signal)

    def _sum(self, places: list[int]) -> int:
        if not places:
            return self.step + 1
        if len(places) == 1:
            return places[0]
        for out, those in self.sums:
            if those == places:
                return out
        self.sums.append((self.end, places))
        self.end += 1
        return self.end - 1

    def families(self) -> tuple[Family, ...]:
        """The tables of places and constants."""
        made = []
        for name, rows in self.tables.items():
            device, inputs = devices.every()[name], _inputs(devices.every()[name])
            states, outputs = len(family.fields(device, "State")), family.stride(device)
            w = np.empty((len(rows), family.width(device)), np.int64)
            j = np.arange(len(rows))
            w[:, family.STATE] = self.first_state[name] + states * j
            w[:, family.BUS] = self.nx + 2 * np.array([row.bus for row in rows])
            w[:, family.BUS2] = self.nx + 2 * np.array([row.bus2 for row in rows])
            w[:, family.UNIT] = [row.unit for row in rows]
            for c, (signal, hint) in enumerate(inputs.items()):
                w[:, family.INPUTS + c] = [self._input(name, i, row, signal, hint) for i, row in enumerate(rows)]
            w[:, -1] = self.first_output[name] + outputs * j
            k = np.array([row.par for row in rows], float).reshape(len(rows), -1)
            made.append(Family(name, device, w, k, tuple(row.key for row in rows)))
        return (*made, *self._adders())

    def _adders(self) -> list[Family]:
        """Sums of the signals that fill one summing port, two at a time."""
        rows = []
        for out, places in self.sums:
            left = places[0]
            for i, right in enumerate(places[1:]):
                last = i == len(places) - 2
                here = out if last else self.end
                self.end += not last
                rows.append([0, 0, 0, NO_UNIT, left, right, here])
                left = here
        if not rows:
            return []
        return [
            Family("adder", adder, np.array(rows, np.int64), np.zeros((len(rows), 0)), ("a summing port",) * len(rows))
        ]

    def layout(self) -> Layout:
        """Places in s, after `families`."""
        owner = np.full(self.end, NO_UNIT, np.int64)
        owner[: self.nx] = [place.unit for place in self.states]
        owner[self.nx + 2 * self.buses : self.step] = [point.unit for point in self.setpoints]
        signals = {}
        for name, rows in self.tables.items():
            device = devices.every()[name]
            if device.ROLE in devices.UNIT_ROLES:
                n = family.stride(device)
                for j, row in enumerate(rows):
                    owner[self.first_output[name] + n * j : self.first_output[name] + n * (j + 1)] = row.unit
        sums = {tuple(places): out for out, places in self.sums}
        for (unit, signal), givers in self.given.items():
            places = tuple(self.place(*giver, signal) for giver in givers)
            signals[unit, signal] = sums.get(places, places[0])
        for k, point in enumerate(self.setpoints):
            if point.unit != NO_UNIT:
                signals.setdefault((point.unit, point.name), self.nx + 2 * self.buses + k)
        outputs = self.end - self.step - 3
        return Layout(tuple(self.states), tuple(self.setpoints), self.buses, outputs, 0, signals, owner)


@cache
def _inputs(device: ModuleType) -> dict[str, Any]:
    """Inputs of a device, each with its marker (Port, At) or None."""
    if not hasattr(device, "Input"):
        return {}
    hints = get_type_hints(device.Input, include_extras=True)
    return {
        name: next((m for m in get_args(hints[name]) if isinstance(m, Port | At)), None)
        for name in device.Input._fields
    }
