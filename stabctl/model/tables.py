"""The tables of a case: a row is a record, a field is a column with its unit, meaning and allowed values.

A device model has a table of its own, `<model>.csv`. A load model is keyed by bus and gives dynamic parameters to a row
of loads.csv. A shunt is also keyed by bus, and may be at any bus. Every other model is keyed by machine.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple

from annotated_types import Ge, Interval

from stabctl._util.schema import NOT_NEGATIVE, POSITIVE, RATIO, SHARE, Field, fields
from stabctl.devices import OF_CONVERTER, models
from stabctl.devices.device import AT_BUS
from stabctl.devices.storage import MODELS, StorageModel

Key = int | str
LoadKind = Literal["load", "injection", "hvdc"]
ElementKind = Literal["bus", "branch", "machine", "load", "shunt"]
Characteristic = Literal["power", "current", "conductance"]
LEFT_BY = {"converter": ("exciter", "governor", "stabilizer"), "machine": OF_CONVERTER}  # role -> controls
UNIT_ROLES = ("machine", "converter")  # every row of machines.csv has exactly one model with one of these
SINGLE_ROLES = *UNIT_ROLES, "exciter", "governor", *OF_CONVERTER  # a machine has at most one model with each
_OWNERS = {"load": "loads", "shunt": "buses"}  # role -> table of what a device belongs to; of the others: machines


class Bus(NamedTuple):
    """A bus with its shunt."""

    bus: Annotated[int, "-", "bus number", POSITIVE]
    kind: Annotated[Literal["swing", "pv", "pq"], "-", "role in the power flow"]
    v: Annotated[float, "pu", "voltage set-point (swing, pv) or initial guess (pq)", RATIO] = 1.0
    angle: Annotated[float, "deg", "voltage angle of the swing bus; initial guess elsewhere"] = 0.0
    g: Annotated[float, "MW", "shunt conductance: power consumed at 1 pu voltage"] = 0.0
    b: Annotated[float, "Mvar", "shunt susceptance: reactive power produced at 1 pu voltage"] = 0.0
    rated: Annotated[
        float, "kV", "rated voltage: tells lines from transformers in a screen, chooses buses of criteria", NOT_NEGATIVE
    ] = 0.0
    name: Annotated[str, "-", "name of the bus"] = ""
    area: Annotated[int, "-", "area: chooses buses of criteria", NOT_NEGATIVE] = 0
    zone: Annotated[int, "-", "zone, for information only", NOT_NEGATIVE] = 0
    owner: Annotated[int, "-", "owner, for information only", NOT_NEGATIVE] = 0
    x: Annotated[float, "-", "position in diagrams, to the right (x = y = 0: automatic)"] = 0.0
    y: Annotated[float, "-", "position in diagrams, upward, in the unit of x"] = 0.0


class Branch(NamedTuple):
    """A circuit of a line, or a transformer with its tap on the from side."""

    from_bus: Annotated[int, "-", "bus at the from end"]
    to_bus: Annotated[int, "-", "bus at the to end"]
    r: Annotated[float, "pu", "series resistance"]
    x: Annotated[float, "pu", "series reactance (negative: series capacitor)"]
    b: Annotated[float, "pu", "total line charging susceptance"] = 0.0
    tap: Annotated[float, "-", "turns ratio on the from side (1 for a line)", RATIO] = 1.0
    phase: Annotated[float, "deg", "phase shift by which the voltage of the from side leads"] = 0.0
    circuit: Annotated[str, "-", "circuit identifier; the circuit is then named 7-8 ckt 2"] = ""
    g_from: Annotated[float, "pu", "shunt conductance at the from end, switched with the branch"] = 0.0
    b_from: Annotated[float, "pu", "shunt susceptance at the from end, switched with the branch"] = 0.0
    g_to: Annotated[float, "pu", "shunt conductance at the to end, switched with the branch"] = 0.0
    b_to: Annotated[float, "pu", "shunt susceptance at the to end, switched with the branch"] = 0.0


class Machine(NamedTuple):
    """A generating unit: a synchronous machine, or the converter that takes its place."""

    machine: Annotated[int, "-", "machine number", POSITIVE]
    bus: Annotated[int, "-", "terminal bus"]
    base: Annotated[float, "MVA", "rating, the base of its per-unit parameters", Ge(1e-6)]
    p: Annotated[float, "MW", "scheduled active power (initial guess at the swing bus)"]
    storage_bus: Annotated[int, "-", "bus for its storage device: high-voltage side (0: the terminal bus)"] = 0
    q: Annotated[float, "Mvar", "reactive power: fixed at a pq bus, elsewhere its share before the rest is split"] = 0.0
    name: Annotated[str, "-", "name used instead of the number: 30/1 is identifier 1 at bus 30"] = ""

    @property
    def called(self) -> int | str:
        """What it is called: its name, or its number if it has none."""
        return self.name or self.machine


class Load(NamedTuple):
    """A load; the share of its power that is neither constant power nor constant current is constant admittance.

    If a load model such as cim has a row for it, this model draws `model_share` of p and q, and all of this applies to
    the rest.
    """

    bus: Annotated[int, "-", "bus number"]
    p: Annotated[float, "MW", "active power consumed (negative: infeed)"]
    q: Annotated[float, "Mvar", "reactive power consumed"]
    p_power: Annotated[float, "-", "constant-power share of p", SHARE] = 0.0
    q_power: Annotated[float, "-", "constant-power share of q", SHARE] = 0.0
    p_current: Annotated[float, "-", "constant-current share of p", SHARE] = 0.0
    q_current: Annotated[float, "-", "constant-current share of q", SHARE] = 0.0
    v_low: Annotated[float, "pu", "voltage below which the whole load is an admittance", POSITIVE] = 0.5
    v: Annotated[float, "pu", "voltage at which p and q are consumed (0: the power-flow voltage)", NOT_NEGATIVE] = 0.0
    id: Annotated[str, "-", "identifier of the load at its bus"] = ""
    kind: Annotated[LoadKind, "-", "load, or what --loads keeps: another injection, end of an HVDC line"] = "load"
    model_share: Annotated[float, "-", "share of p and q that its load model draws, if it has one", SHARE] = 1.0


class Link(NamedTuple):
    """An HVDC link, represented by a constant-current injection at each terminal."""

    link: Annotated[str, "-", "name of the link"]
    from_bus: Annotated[int, "-", "rectifier bus"]
    to_bus: Annotated[int, "-", "inverter bus"]
    p: Annotated[float, "MW", "power drawn at the rectifier"]
    loss: Annotated[float, "MW", "power lost between rectifier and inverter"] = 0.0


class Storage(NamedTuple):
    """An energy storage device (ESD) that belongs to a machine; the defaults are the ideal device of the paper.

    Examples
    --------
    >>> device = st.Storage(machine=1, bus=5, rating=50, energy=0.1, lag=0.02)
    >>> st.load("two_area").with_storage(device).storage[0].energy
    0.1
    """

    machine: Annotated[int, "-", "machine whose speed controls it"]
    bus: Annotated[int, "-", "bus to which it is connected"]
    rating: Annotated[float, "MW", "power rating at 1 pu voltage", NOT_NEGATIVE]
    characteristic: Annotated[Characteristic, "-", "what remains constant when the voltage changes"] = "power"
    energy: Annotated[float, "MWh", "energy capacity (0: unlimited)", NOT_NEGATIVE] = 0.0
    charge: Annotated[float, "-", "initial state of charge", SHARE] = 0.5
    ramp: Annotated[float, "MW/s", "ramp-rate limit (0: none)", NOT_NEGATIVE] = 0.0
    lag: Annotated[float, "s", "time constant from order to power", NOT_NEGATIVE] = 0.0
    efficiency: Annotated[float, "-", "round-trip efficiency", Interval(ge=0.01, le=1)] = 1.0
    mva: Annotated[float, "MVA", "apparent power rating (0: the power rating)", NOT_NEGATIVE] = 0.0
    storage_model: Annotated[StorageModel, "-", "store and converter: ideal, regc, supercap_regc, ..."] = "ideal"
    converter: Annotated[str, "-", "parameters of converter and store that are not the default: Imax=1.3 Lvplsw=0"] = ""

    @property
    def device(self) -> str:
        """The name of its device model."""
        return MODELS[self.storage_model].device


class OutOfService(NamedTuple):
    """An element that is out of service: its name is known, and nothing else of it is in the case."""

    element: Annotated[ElementKind, "-", "kind of the element"]
    bus: Annotated[int, "-", "its bus, or the first one", POSITIVE]
    to_bus: Annotated[int, "-", "bus at the other end of a branch", NOT_NEGATIVE] = 0
    third_bus: Annotated[int, "-", "third bus of a transformer with three windings", NOT_NEGATIVE] = 0
    id: Annotated[str, "-", "identifier; of a bus or machine the name"] = ""


TABLES: Mapping[str, type] = MappingProxyType(
    {
        "buses": Bus,
        "branches": Branch,
        "machines": Machine,
        "loads": Load,
        "links": Link,
        "storage": Storage,
        "out_of_service": OutOfService,
    }
)


@dataclass(frozen=True, repr=False)
class Tables:
    """The tables of a system, not yet checked: what checks, names and the network read of a `Case`."""

    name: str
    buses: tuple[Bus, ...]
    branches: tuple[Branch, ...]
    machines: tuple[Machine, ...]
    devices: Mapping[str, Mapping[Key, Any]]
    loads: tuple[Load, ...] = ()
    links: tuple[Link, ...] = ()
    storage: tuple[Storage, ...] = ()
    out_of_service: tuple[OutOfService, ...] = ()
    base_mva: float = 100.0
    frequency_hz: float = 60.0
    title: str = ""
    source: str = ""
    notes: tuple[str, ...] = field(default=(), compare=False)

    @cached_property
    def row_of_bus(self) -> Mapping[int, int]:
        """Row of every bus, by its number."""
        return {b.bus: row for row, b in enumerate(self.buses)}

    @cached_property
    def called(self) -> Mapping[int, int | str]:
        """What every machine is called, by its number."""
        return {m.machine: m.called for m in self.machines}

    @cached_property
    def rows_between(self) -> Mapping[frozenset[int], Sequence[int]]:
        """Rows of the branches between two buses."""
        found: dict[frozenset[int], list[int]] = {}
        for row, k in enumerate(self.branches):
            found.setdefault(frozenset((k.from_bus, k.to_bus)), []).append(row)
        return found

    def model(self, number: int, role: str) -> str | None:
        """Name of the first model with a role that a machine has.

        Parameters
        ----------
        number : int
            Number of the machine.
        role : str
            "machine", "exciter", "governor" ...

        Returns
        -------
        str or None
            Name of the model, such as "genrou"; None if the machine has none.
        """
        return next((model for model in of_role(role) if number in self.devices.get(model, ())), None)


def role(model: str) -> str:
    """Role of a model: machine, converter, exciter, governor, stabilizer, load ..."""
    return models().roles[model]


def of_role(*roles: str) -> list[str]:
    """Names of the models with one of these roles."""
    return models().of_role(*roles)


def takes(model: str, control: str) -> bool:
    """Whether a unit of this model may have a control of that role: one in its CONTROLS, or any of its kind of unit."""
    allowed = models()[model].controls
    return control not in LEFT_BY[role(model)] if allowed is None else control in allowed


def parameters(model: str, /, **values: Any) -> Any:
    """Parameters of a model from the columns of a row; fields that are filled from the case are 0."""
    record = models()[model].Par
    unfilled = {name: 0.0 for name in record._fields if name not in fields(record)}
    return record(**unfilled, **values)


def device_columns(model: str) -> dict[str, Field]:
    """Every column of a model's table, its key first."""
    key = key_field(model)
    return {key.name: key, **fields(models()[model].Par)}


def key_field(model: str) -> Field:
    """The column that says what a row of a model's table belongs to: `bus` or `machine`."""
    return fields(TABLES[_OWNERS.get(role(model), "machines")])["bus" if at_bus(model) else "machine"]


def at_bus(model: str) -> bool:
    """Whether the model is keyed by bus."""
    return role(model) in AT_BUS
