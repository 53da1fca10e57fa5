"""A power system as frozen tables, in the units of its files; every case that exists is a valid one.

Network per-unit values stand on the case's `base_mva`, machine and control values on the machine's own `base_mva`.
Conversion to the units of the equations happens once, in `network.grid` and `build.plant`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple

from stabctl._util.verbs import verb
from stabctl.devices.machines import gencls
from stabctl.errors import StudyError
from stabctl.schema import NOT_NEGATIVE, POSITIVE, RATIO, SHARE, Range

from . import checks

Characteristic = Literal["power", "current", "conductance"]


class Bus(NamedTuple):
    """A bus and its shunt."""

    bus: Annotated[int, "-", "bus number", POSITIVE]
    kind: Annotated[Literal["swing", "pv", "pq"], "-", "role in the load flow"]
    v: Annotated[float, "pu", "voltage set-point (swing, pv), first guess (pq)", RATIO] = 1.0
    angle: Annotated[float, "deg", "angle of the swing bus; elsewhere a first guess"] = 0.0
    g: Annotated[float, "MW", "shunt conductance, consumption at 1 pu"] = 0.0
    b: Annotated[float, "Mvar", "shunt susceptance, production at 1 pu"] = 0.0
    rated: Annotated[float, "kV", "rated voltage, for the reader", NOT_NEGATIVE] = 0.0


class Branch(NamedTuple):
    """A line or transformer circuit; the tap stands on the from side."""

    from_bus: Annotated[int, "-", "bus number"]
    to_bus: Annotated[int, "-", "bus number"]
    r: Annotated[float, "pu", "series resistance"]
    x: Annotated[float, "pu", "series reactance (negative: series capacitor)"]
    b: Annotated[float, "pu", "total charging susceptance"] = 0.0
    tap: Annotated[float, "-", "turns ratio on the from side (1: a line)", RATIO] = 1.0
    phase: Annotated[float, "deg", "angle by which the from side leads"] = 0.0


class Machine(NamedTuple):
    """A synchronous machine: where it stands, what it produces, where its storage belongs."""

    machine: Annotated[int, "-", "machine number", POSITIVE]
    bus: Annotated[int, "-", "terminal bus"]
    base: Annotated[float, "MVA", "machine base", Range(1e-6)]
    p: Annotated[float, "MW", "dispatched power (at the swing bus a first guess)"]
    storage_bus: Annotated[int, "-", "bus of its storage device: high-voltage side, or terminal where there is none"]


class Load(NamedTuple):
    """A load; what is neither constant power nor constant current is constant admittance."""

    bus: Annotated[int, "-", "bus number"]
    p: Annotated[float, "MW", "active power (negative: infeed)"]
    q: Annotated[float, "Mvar", "reactive power"]
    p_power: Annotated[float, "-", "share of p that is constant power", SHARE] = 0.0
    q_power: Annotated[float, "-", "share of q that is constant power", SHARE] = 0.0
    p_current: Annotated[float, "-", "share of p that is constant current", SHARE] = 0.0
    q_current: Annotated[float, "-", "share of q that is constant current", SHARE] = 0.0
    v_low: Annotated[float, "pu", "voltage below which the load is an admittance", POSITIVE] = 0.5


class Link(NamedTuple):
    """An HVDC link, seen as constant-current injections at its terminals."""

    link: Annotated[str, "-", "name"]
    from_bus: Annotated[int, "-", "rectifier bus"]
    to_bus: Annotated[int, "-", "inverter bus"]
    p: Annotated[float, "MW", "power taken at the rectifier"]
    loss: Annotated[float, "MW", "power lost on the way"] = 0.0


class Storage(NamedTuple):
    """An energy storage device (ESD) that belongs to a machine; the defaults are the paper's ideal device."""

    machine: Annotated[int, "-", "machine whose speed it follows"]
    bus: Annotated[int, "-", "bus it is connected to"]
    rating: Annotated[float, "MW", "largest power, at 1 pu voltage", NOT_NEGATIVE]
    characteristic: Annotated[Characteristic, "-", "power against voltage"] = "power"
    energy: Annotated[float, "MWh", "energy it can hold (0: unlimited)", NOT_NEGATIVE] = 0.0
    charge: Annotated[float, "-", "state of charge at the start", SHARE] = 0.5
    ramp: Annotated[float, "MW/s", "largest change of power (0: unlimited)", NOT_NEGATIVE] = 0.0
    lag: Annotated[float, "s", "time constant from order to power", NOT_NEGATIVE] = 0.0
    efficiency: Annotated[float, "-", "of the round trip", Range(0.01, 1.0)] = 1.0


TABLES: Mapping[str, type] = MappingProxyType(
    {"buses": Bus, "branches": Branch, "machines": Machine, "loads": Load, "links": Link, "storage": Storage}
)


@dataclass(frozen=True, repr=False)
class Case:
    """A power system. Making one checks it: `CaseError` names table, row, column, value and what is allowed."""

    name: str
    buses: tuple[Bus, ...]
    branches: tuple[Branch, ...]
    machines: tuple[Machine, ...]
    devices: Mapping[str, Mapping[int, Any]]  # model name -> machine number -> its Par
    loads: tuple[Load, ...] = ()
    links: tuple[Link, ...] = ()
    storage: tuple[Storage, ...] = ()
    base_mva: float = 100.0
    frequency_hz: float = 60.0
    title: str = ""
    source: str = ""
    warnings: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        frozen = {model: MappingProxyType(dict(rows)) for model, rows in self.devices.items() if rows}
        object.__setattr__(self, "devices", MappingProxyType(frozen))
        object.__setattr__(self, "warnings", tuple(checks.check(self, TABLES)))

    def __reduce__(self) -> tuple[Any, ...]:
        plain = {f.name: getattr(self, f.name) for f in fields(self) if f.init and f.name != "warnings"}
        return _made, (plain | {"devices": {model: dict(rows) for model, rows in self.devices.items()}},)

    initialize = verb("stabctl.dynamics.coerce:initialize")
    power_flow = verb("stabctl.model.powerflow:solve")
    simulate = verb("stabctl.simulation.simulate:simulate")
    clearing_time = verb("stabctl.clearing:clearing_time")
    screen = verb("stabctl.clearing:screen")
    linearize = verb("stabctl.smallsignal:linearize")
    estimate = verb("stabctl.estimation.estimate:estimate")
    place = verb("stabctl.placement.place:place")

    def machine(self, number: int) -> Machine:
        """The machine of that number; `StudyError` where there is none."""
        for m in self.machines:
            if m.machine == number:
                return m
        numbers = ", ".join(str(m.machine) for m in self.machines)
        raise StudyError(f"There is no machine {number} in {self.name}; its machines are {numbers}.")

    def model(self, number: int, role_models: Iterable[str]) -> str | None:
        """Name of the model, one of `role_models`, that the machine has."""
        return next((m for m in role_models if number in self.devices.get(m, {})), None)

    def with_storage(self, devices: Iterable[Storage]) -> "Case":
        """The same case with these storage devices; nothing else is checked again."""
        case = object.__new__(Case)
        vars(case).update(vars(self), storage=tuple(devices))
        checks.storage(case, Storage)
        return case

    def classical(self) -> "Case":
        """The same case with every machine a constant voltage behind x'd, without controls (GENCLS)."""
        rows = {}
        for m in self.machines:
            p = self.devices["gencls"][m.machine] if m.machine in self.devices.get("gencls", {}) else None
            if p is None:
                full = self.devices["genrou"][m.machine]
                p = gencls.Par(0.0, 0.0, full.H, full.D, full.ra, full.x1d)
            rows[m.machine] = p
        return replace(self, devices={"gencls": rows}, title=f"{self.title}, classical machines")

    def __str__(self) -> str:
        shape = f"{len(self.machines)} machines, {len(self.buses)} buses, {len(self.branches)} branches"
        return f"{self.name}: {self.title} ({shape}, {len(self.loads)} loads, {len(self.links)} HVDC links)"

    __repr__ = __str__


def _made(parts: dict[str, Any]) -> Case:
    """A case from its parts (how it is copied between processes)."""
    return Case(**parts)
