"""Case and power flow -> the devices of the system, wired: places of every state, input and output.

An input reads the signal of that name in its unit. A port reads what fills it, else its set-point; a summing port the
sum of what fills it, else zero.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple, get_args, get_type_hints

import numpy as np

from stabctl import devices
from stabctl.devices.ports import At, Port
from stabctl.errors import EquilibriumError
from stabctl.model.case import Case
from stabctl.model.network import Network
from stabctl.model.powerflow import PowerFlow

from . import family
from .layout import WORDS, Layout, SetPoint, StatePlace
from .program import Family

NO_UNIT = -1


class Row(NamedTuple):
    """One device: its unit and buses (rows), its constants, what it is called in labels and in messages."""

    unit: int
    bus: int
    bus2: int
    par: Any
    label: str
    key: str


class Limits(NamedTuple):
    """States that stop at limits (non-windup): low * scale <= state <= high * scale."""

    state: np.ndarray  # places
    low: np.ndarray
    high: np.ndarray
    scale: np.ndarray  # places of the signals that the limits are per unit of; the constant 1 where there is none
    names: tuple[tuple[str, str], ...]  # parameters (low, high)


class Rotors(NamedTuple):
    """The units with a rotor."""

    unit: np.ndarray  # rows of the units
    angle: np.ndarray  # places; the speed follows
    inertia: np.ndarray  # s   H on the system base


@dataclass(frozen=True, eq=False)
class System:
    """All devices of a case, with everything that the start, the derivatives and the simulation need of them."""

    families: tuple[Family, ...]
    layout: Layout
    limits: Limits
    rotors: Rotors
    unit_bus: np.ndarray  # (units) rows of the buses
    forming: np.ndarray  # (units) does it hold a voltage of its own?
    fixed: np.ndarray  # (buses) admittance of what stands in the network matrix, pu
    draw_bus: np.ndarray  # rows of the buses with currents that depend on their voltage
    watch_bus: np.ndarray  # rows of the buses of loads
    watch_low: np.ndarray  # pu   their voltages below which a load counts as lost
    kept: dict[Any, Any] = field(default_factory=dict, repr=False)  # what is worked out once for all such systems

    def family(self, name: str) -> Family | None:
        """The family of that name; None where the case has no such device."""
        return next((f for f in self.families if f.name == name), None)

    def with_constants(self, name: str, k: np.ndarray) -> "System":
        """The same system, the constants of one family replaced."""
        changed = tuple(f._replace(k=k) if f.name == name else f for f in self.families)
        return replace(self, families=changed, limits=limits(changed, self.layout.one))

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"kept": {}}


def system(case: Case, flow: PowerFlow, net: Network) -> System:
    """Every device of the case, wired. `EquilibriumError` where a device reads a signal that its unit does not have."""
    tables, fixed = _tables(case, flow, net)
    wired = _Wiring(case, tables, len(case.buses), net)
    families = wired.families()
    draws = [f for f in families if family.CURRENT in family.equations(f.device)]
    unit = {name: [row.unit for row in rows] for name, rows in tables.items()}
    forming = np.zeros(len(case.machines), bool)
    for f in families:
        if hasattr(f.device, "source"):
            forming[unit[f.name]] = True
    watched = [(b, low) for name, rows in tables.items() for row in rows for b, low in _watched(name, row)]
    buses = [f.w[:, [family.BUS, family.BUS2]].ravel() for f in draws]
    draw_bus = (np.unique(np.concatenate(buses)) - wired.nx) // 2 if buses else np.zeros(0, np.int64)
    return System(
        families,
        wired.layout(),
        wired.limits(families),
        _rotors(families, unit),
        net.machine_bus.astype(np.int64),
        forming,
        fixed,
        draw_bus.astype(np.int64),
        np.array([b for b, _ in watched], np.int64),
        np.array([low for _, low in watched], float),
    )


def _watched(name: str, row: Row) -> Iterator[tuple[int, float]]:
    device = devices.every()[name]
    if device.ROLE in ("load", "link") and "vlow" in device.Par._fields:
        for bus in dict.fromkeys((row.bus, row.bus2)):
            yield bus, row.par.vlow


def _rotors(families: Iterable[Family], unit: Mapping[str, list[int]]) -> Rotors:
    found = []
    for f in families:
        states, constants = family.fields(f.device, "State"), family.fields(f.device, "Par")
        if {"delta", "omega"} <= set(states) and "H" in constants:
            inertia = f.k[:, constants.index("H")] * f.k[:, constants.index("mva")]
            found += zip(unit[f.name], f.w[:, family.STATE] + states.index("delta"), inertia, strict=True)
    found.sort()
    parts = list(zip(*found, strict=True)) or [(), (), ()]
    return Rotors(np.array(parts[0], np.int64), np.array(parts[1], np.int64), np.array(parts[2], float))


def _tables(case: Case, flow: PowerFlow, net: Network) -> tuple[dict[str, list[Row]], np.ndarray]:
    """Table -> devices, and the admittance (buses, pu) of loads that stands in the network matrix."""
    numbers = {m.machine: i for i, m in enumerate(case.machines)}
    found: dict[str, list[Row]] = {}
    for name, device in devices.models().items():
        if device.ROLE in devices.UNIT_ROLES and name in case.devices:
            found[name] = [
                _unit_row(case, device, numbers[number_of(key)], key, par, net)
                for key, par in case.devices[name].items()
            ]
    found["zip_load"], fixed = [], np.zeros(len(case.buses), complex)
    for i, load in enumerate(case.loads):
        _load(case, flow, net, i, found, fixed)
    esd, hvdc = devices.every()["esd"], devices.every()["hvdc"]
    found["esd"] = [
        Row(
            numbers[s.machine],
            net.place[s.bus],
            net.place[s.bus],
            esd.from_case(s, case.base_mva),
            f"ESD {s.machine}@{s.bus}",
            f"ESD {s.machine}@{s.bus}",
        )
        for s in case.storage
    ]
    found["hvdc"] = []
    for k in case.links:
        a, b = net.place[k.from_bus], net.place[k.to_bus]
        powers = k.p / abs(flow.V[a]), (k.p - k.loss) / abs(flow.V[b])
        found["hvdc"].append(
            Row(NO_UNIT, a, b, hvdc.Par(*(p / case.base_mva for p in powers), 0.5), f"HVDC {k.link}", f"link {k.link}")
        )
    return {name: rows for name, rows in found.items() if rows}, fixed


def number_of(key: Any) -> int:
    """Number of the machine or bus in the key of a device: 2 of 2 and of "2#2"."""
    return int(str(key).partition("#")[0])


def _unit_row(case: Case, device: ModuleType, unit: int, key: Any, par: Any, net: Network) -> Row:
    m = case.machines[unit]
    given = {"mva": m.base / case.base_mva, "wb": 2 * np.pi * case.frequency_hz}
    par = par._replace(**{name: value for name, value in given.items() if name in par._fields})
    par = device.prepare(par) if hasattr(device, "prepare") else par
    bus = int(net.machine_bus[unit])
    return Row(unit, bus, bus, par, f"{device.NAME} {key}", f"machine {m.machine} at bus {m.bus}")


def loads_at(case: Case) -> list[Any]:
    """Key of every load: its bus, followed by #2 for the second load there."""
    seen: dict[int, int] = {}
    keys: list[Any] = []
    for load in case.loads:
        seen[load.bus] = seen.get(load.bus, 0) + 1
        keys.append(load.bus if seen[load.bus] == 1 else f"{load.bus}#{seen[load.bus]}")
    return keys


def load_row(case: Case, i: int, V: float, net: Network) -> tuple[str, Row]:
    """Table and device of row `i` of loads.csv, at the voltage V (pu) of the power flow."""
    load = case.loads[i]
    P, Q = load.p / case.base_mva, load.q / case.base_mva
    key, bus = loads_at(case)[i], net.place[load.bus]
    for name, device in devices.models().items():
        if device.ROLE == "load" and key in case.devices.get(name, {}):
            par = case.devices[name][key]
            given = {"P0": P, "Q0": Q, "V0": V, "vlow": load.v_low, "wb": 2 * np.pi * case.frequency_hz}
            par = par._replace(**{k: v for k, v in given.items() if k in par._fields})
            return name, Row(NO_UNIT, bus, bus, par, f"{device.NAME} {key}", f"the load at bus {load.bus}")
    zip_load = devices.every()["zip_load"]
    return "zip_load", Row(
        NO_UNIT, bus, bus, zip_load.from_case(load, P, Q, V), f"load {key}", f"the load at bus {load.bus}"
    )


def _load(case: Case, flow: PowerFlow, net: Network, i: int, found: dict[str, list[Row]], fixed: np.ndarray) -> None:
    """Add row `i` of loads.csv to the devices, its constant-admittance part to the network."""
    load, V = case.loads[i], float(abs(flow.V[net.place[case.loads[i].bus]]))
    if load.v_low > V:
        raise EquilibriumError(
            f"The load at bus {load.bus} of {case.name} cannot be initialized: its v_low = {load.v_low:g} pu, below "
            f"which it is an admittance, is above its power-flow voltage of {V:.3f} pu; lower v_low_pu in loads.csv."
        )
    name, row = load_row(case, i, V, net)
    if name == "zip_load":
        fixed[row.bus] += devices.every()[name].admittance(row.par)
        row = row._replace(par=row.par._replace(Pz=0.0, Qz=0.0))
        if not any(row.par[:4]):
            return
    found.setdefault(name, []).append(row)


class _Wiring:
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
        from . import adder

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
        signals = {}
        for name, rows in self.tables.items():
            device = devices.every()[name]
            if device.ROLE in devices.UNIT_ROLES:
                n = family.stride(device)
                for j, row in enumerate(rows):
                    owner[self.first_output[name] + n * j : self.first_output[name] + n * (j + 1)] = row.unit
        for (unit, signal), givers in self.given.items():
            signals[unit, signal] = self.place(*givers[0], signal)
        for k, point in enumerate(self.setpoints):
            if point.unit != NO_UNIT:
                signals.setdefault((point.unit, point.name), self.nx + 2 * self.buses + k)
        outputs = self.end - self.step - 3
        return Layout(tuple(self.states), tuple(self.setpoints), self.buses, outputs, 0, signals, owner)

    def limits(self, families: Iterable[Family]) -> Limits:
        """The states that models list in LIMITS."""
        return limits(families, self.step + 2)


def limits(families: Iterable[Family], one: int) -> Limits:
    """The states that models list in LIMITS; `one` is the place of the constant 1."""
    state, low, high, scale, names = [], [], [], [], []
    for f in families:
        constants, states = family.fields(f.device, "Par"), family.fields(f.device, "State")
        inputs = family.fields(f.device, "Input")
        for name, (least, most, *per) in getattr(f.device, "LIMITS", {}).items():
            state.append(f.w[:, family.STATE] + states.index(name))
            low.append(f.k[:, constants.index(least)])
            high.append(f.k[:, constants.index(most)])
            scale.append(f.w[:, family.INPUTS + inputs.index(per[0])] if per else np.full(len(f.w), one))
            names += [(least, most)] * len(f.w)
    if not state:
        return Limits(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0, np.int64), ())
    return Limits(*(np.concatenate(part) for part in (state, low, high, scale)), tuple(names))


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
