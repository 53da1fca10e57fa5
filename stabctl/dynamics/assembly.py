"""The system of a case at its power flow: all devices, their connections, and the angles that a simulation judges."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from stabctl import devices
from stabctl.model.case import Case
from stabctl.model.network import Network, islands
from stabctl.model.powerflow import PowerFlow

from . import family, rows
from ._wiring import Wiring
from .family import Family, Limits, limits
from .layout import Layout
from .program import near
from .rows import NO_UNIT, Row

INFINITE = 1e9  # s   inertia constant in place of that of an infinite bus


class Rotors(NamedTuple):
    """The units with an angle and a speed of their own: synchronous machines, and converters with a virtual rotor."""

    unit: np.ndarray  # rows of the units
    angle: np.ndarray  # places, among the states
    speed: np.ndarray  # places, among the states or outputs
    inertia: np.ndarray  # s   H on the system base, of a virtual rotor the equivalent one
    virtual: np.ndarray  # whether it is that of a converter

    @property
    def real(self) -> "Rotors":
        """Those of synchronous machines."""
        return Rotors(*(column[~self.virtual] for column in self))

    def of_machines(self, island: np.ndarray) -> np.ndarray:
        """Inertia (rotor units, s), 0 for virtual rotors in an island (of every unit; -1: off) that has a machine."""
        with_machine = np.isin(island[self.unit], island[self.unit[~self.virtual]])
        return np.where(self.virtual & with_machine, 0.0, self.inertia)


class Angle(NamedTuple):
    """An angle that is judged as that of a rotor, without weight in the center of inertia of rotors.

    That of a phase-locked loop, or of the virtual rotor of a grid-forming storage device.
    """

    unit: int  # row of the unit, -1 of a storage device
    bus: int  # row of the bus
    place: int  # among the states
    virtual: bool  # that of a virtual rotor, or else of a phase-locked loop
    name: str  # in messages, such as "ESD 1@2"
    frequency: int  # place of the frequency of the phase-locked loop, or of the virtual speed; -1: none
    inertia: float  # s   on the system base, its weight in an island without rotors; 0 of a phase-locked loop
    least: float  # pu   of its frequency
    most: float  # pu
    energy: int  # place of the energy of a grid-forming storage device, whose store may end the supply of an island
    current: int  # place of its active current, pu delivered
    floor: float  # pu s   energy when empty
    capacity: float  # pu s   energy when full


class Unweighted(NamedTuple):
    """All angles without weight in the center of inertia of rotors, as columns."""

    rows: tuple[Angle, ...]

    def column(self, name: str, kind: type = np.int64) -> np.ndarray:
        """The column of this name."""
        return np.array([getattr(row, name) for row in self.rows], kind)


class Watched(NamedTuple):
    """A load or the terminal of a link, which counts as lost if its voltage stays low."""

    bus: int  # row of its bus
    other: int  # row of the bus of the other terminal, without whose voltage a link is blocked; of a load its own
    low: float  # pu
    name: str  # in messages


@dataclass(frozen=True, eq=False)
class System:
    """All devices of a case, with everything that initialization, derivatives and simulation need."""

    families: tuple[Family, ...]
    layout: Layout
    limits: Limits
    rotors: Rotors
    unit_bus: np.ndarray  # (units) rows of the buses
    island: np.ndarray  # (buses) island before any switching
    forming: np.ndarray  # (units) whether it is a voltage source
    fixed: np.ndarray  # (buses) admittances included in the network matrix, pu
    draw_bus: np.ndarray  # rows of the buses with voltage-dependent currents
    watched: tuple[Watched, ...]  # loads and links
    kept: dict[Any, Any] = field(default_factory=dict, repr=False)  # results computed once for all such systems

    def has(self, table: str) -> bool:
        """Whether the case has devices of this table."""
        return any(f.name == table for f in self.families)

    def family(self, table: str) -> Family:
        """The devices of a table. Raises `KeyError` if the case has none."""
        for f in self.families:
            if f.name == table:
                return f
        raise KeyError(table)

    @property
    def unweighted(self) -> Unweighted:
        """The angles without weight in the center of inertia of rotors, of devices with a rating above 0."""
        return Unweighted(tuple(sorted(row for f in self.families for row in _angles(f, self.layout.nx))))

    @property
    def near_bus(self) -> np.ndarray:
        """Rows of the buses with voltage-dependent currents, and of the remote buses that these depend on."""
        if "near bus" not in self.kept:
            places = near(self.families) - self.layout.nx
            inside = places[(places >= 0) & (places < 2 * self.layout.buses)] // 2
            self.kept["near bus"] = np.union1d(inside, self.draw_bus)
        return self.kept["near bus"]

    def with_constants(self, name: str, k: np.ndarray) -> "System":
        """The same system with other parameters of one family."""
        changed = tuple(f._replace(k=k) if f.name == name else f for f in self.families)
        return replace(self, families=changed, limits=limits(changed, self.layout.one))

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"kept": {}}


def _angles(f: Family, nx: int) -> Iterator[Angle]:
    """The angles of the devices of a family; the voltages begin at nx."""
    storage = f.device.role == "storage"
    name = f.device.pll or ("delta" if storage and f.device.source else None)
    if name is None:
        return
    states, outputs, constants = (f.device.fields(record) for record in ("State", "Output", "Par"))
    speed, own = ("wpll", None) if f.device.pll else ("omega", _inertia(f))
    inertia = np.zeros(len(f.w)) if own is None else own
    for w, k, key, H in zip(f.w, f.k, f.keys, inertia, strict=True):
        p = dict(zip(constants, k, strict=True))
        frequency = int(w[-1]) + outputs.index(speed) if speed in outputs else -1
        least = 1 + p["wmin"] / p["wb"] if "wmin" in p else -np.inf
        most = 1 + p["wmax"] / p["wb"] if "wmax" in p else np.inf
        unit = NO_UNIT if storage else int(w[family.UNIT])
        if not storage or p["mva"] > 0:
            bus, first = (int(w[family.BUS]) - nx) // 2, int(w[family.STATE])
            store = 0, 0, -np.inf, np.inf
            if storage and "energy" in states and "Ip" in outputs:
                store = first + states.index("energy"), int(w[-1]) + outputs.index("Ip"), p["floor"], p["capacity"]
            place = first + states.index(name)
            yield Angle(unit, bus, place, not f.device.pll, key, frequency, float(H), least, most, *store)


def system(case: Case, flow: PowerFlow, net: Network) -> System:
    """Connect all devices of a case. Raises `EquilibriumError` if a device reads a signal that its unit lacks."""
    tables, fixed = rows.tables(case, flow, net)
    wired = Wiring(case, tables, len(case.buses), net)
    families, layout = wired.families(), wired.layout()
    draws = [f for f in families if family.CURRENT in family.equations(f.device)]
    unit = {name: [row.unit for row in found] for name, found in tables.items()}
    forming = np.zeros(len(case.machines), bool)
    for f in families:
        if f.device.source is not None and f.device.role in devices.UNIT_ROLES:
            forming[unit[f.name]] = True
    buses = [f.w[:, [family.BUS, family.BUS2]].ravel() for f in draws]
    draw_bus = (np.unique(np.concatenate(buses)) - wired.nx) // 2 if buses else np.zeros(0, np.int64)
    return System(
        families,
        layout,
        limits(families, wired.step + 2),
        _rotors(families, unit),
        net.machine_bus.astype(np.int64),
        islands(net).astype(np.int64),
        forming,
        fixed,
        draw_bus.astype(np.int64),
        tuple(one for name, found in tables.items() for row in found for one in _watched(name, row)),
    )


def _watched(name: str, row: Row) -> Iterator[Watched]:
    """What is watched of a load or link: no admittance, and no terminal without power."""
    device = devices.every()[name]
    if device.role == "link":
        for bus, other, power in ((row.bus, row.bus2, row.par.Prec), (row.bus2, row.bus, row.par.Pinv)):
            if power:
                yield Watched(bus, other, row.par.vlow, f"HVDC {row.key}")
    elif device.role == "load" and "vlow" in device.Par._fields:
        yield Watched(row.bus, row.bus, row.par.vlow, "its load")


def _rotors(families: Iterable[Family], unit: Mapping[str, list[int]]) -> Rotors:
    found: list[tuple[int, int, int, float, bool]] = []
    for f in families:
        inertia, states = _inertia(f), f.device.State._fields
        if inertia is not None and f.device.role != "storage":
            angle = f.w[:, family.STATE] + states.index("delta")
            if "omega" in states:
                speed = f.w[:, family.STATE] + states.index("omega")
            else:
                speed = f.w[:, -1] + f.device.Output._fields.index("omega")
            virtual = [f.device.role != "machine"] * len(f.w)
            found += zip(unit[f.name], angle, speed, inertia, virtual, strict=True)
    parts = list(zip(*sorted(found), strict=True)) or [()] * 5
    kinds = np.int64, np.int64, np.int64, float, bool
    return Rotors(*(np.array(part, kind) for part, kind in zip(parts, kinds, strict=True)))


def _inertia(f: Family) -> np.ndarray | None:
    """Inertia constants (devices) on the system base, s; None if the device has no rotor, real or virtual."""
    constants = f.device.Par._fields
    if f.device.inertia is not None:
        return np.asarray(f.device.inertia(f.device.Par(*f.k.T))) * f.k[:, constants.index("mva")]
    if not ({"delta", "omega"} <= set(f.device.State._fields) and "H" in constants):
        return None
    H = f.k[:, constants.index("H")]
    return np.where(H > 0, H, INFINITE) * f.k[:, constants.index("mva")]
