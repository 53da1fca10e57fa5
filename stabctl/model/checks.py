"""Checks of the tables of a case: the first error is raised with its location.

First come the values of every row, then the tables together: each row of a device table, for example, belongs to a
machine or a bus, and is compatible with the other devices there.
"""

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from stabctl import devices
from stabctl._util.errors import CaseError, StudyError, is_line, shown
from stabctl._util.schema import fields
from stabctl._util.validation import Invalid, checked
from stabctl.devices.storage import joined

from . import naming, tables
from .tables import Storage, Tables

LEAST_IMPEDANCE = 1e-9  # pu on 100 MVA
CONTROLS = sum(tables.LEFT_BY.values(), ())  # roles


class RowError(CaseError):
    """An error in a row of a table (0 is the first below the header).

    Parameters
    ----------
    table, column : str
        Where it is; the column by its header.
    row : int
        Row of the table, from 0.
    text : str
        The message. If two rows contradict each other, `{rows}` in it stands for both row numbers.
    first : int, optional
        The other of the two rows.
    """

    def __init__(self, table: str, row: int, column: str, text: str, first: int | None = None) -> None:
        self.table, self.row, self.column, self.text, self.first = table, row, column, text, first
        super().__init__(self.located(f"{table}.csv", lambda row: row + 2))

    def located(self, path: Path | str, line: Callable[[int], int]) -> str:
        """The sentence with its place in a file; `line` gives the line of a row."""
        text = self.text
        if self.first is not None:
            text = text.replace("{rows}", f"rows {line(self.first)} and {line(self.row)}")
        return f"{path} row {line(self.row)}, column {self.column}: {text}"

    def __reduce__(self) -> tuple[Any, ...]:
        return RowError, (self.table, self.row, self.column, self.text, self.first)


def values(table: str, record: type, rows: Sequence[Any]) -> tuple[Any, ...]:
    """The rows with every value of the right kind, finite and within its limits. Raises `RowError`."""
    for row in rows:
        if not isinstance(row, record):
            raise CaseError(f"{table}: {shown(row)} is not a row; create it with {record.__name__}(...).")
    try:
        return checked(record, rows)
    except Invalid as fault:
        text = f"{shown(fault.value)} is not allowed; it must be {fault.expected}."
        raise RowError(table, fault.row, fault.field.column, text) from None


def device_values(devices: Mapping[str, Mapping[Any, Any]]) -> Mapping[str, Mapping[Any, Any]]:
    """The device tables with every value allowed, frozen; a table without rows is left out. Raises `RowError`."""
    found = {}
    for model, rows in devices.items():
        if model not in tables.models():
            raise CaseError(
                f"{model}.csv: there is no device model {model!r}; choose one of {', '.join(tables.models())}."
            )
        if rows:
            record = tables.models()[model].Par
            found[model] = MappingProxyType(dict(zip(rows, values(model, record, tuple(rows.values())), strict=True)))
    return MappingProxyType(found)


def check(case: Tables) -> None:
    """Raise the first inconsistency between the tables of a case."""
    _about(case)
    for table in ("buses", "machines"):
        if not getattr(case, table):
            raise CaseError(f"{table}.csv: the table is empty; a case needs at least one row.")
    _unique("buses", "bus", [b.bus for b in case.buses])
    _unique("machines", "machine", [m.machine for m in case.machines])
    _unique("machines", "name", [m.name or m.machine for m in case.machines])
    _unique("links", "link", [k.link for k in case.links])
    _references(case)
    _kinds(case)
    _branches(case)
    _loads(case)
    check_devices(case)
    storage(case)
    _connected(case)


def _about(case: Tables) -> None:
    """The entries of case.toml."""
    for name in ("base_mva", "frequency_hz"):
        value = getattr(case, name)
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and 1e-6 <= value <= 1e9):
            raise CaseError(f"case.toml, {name}: {shown(value)} is not allowed; it must be a number from 1e-6 to 1e9.")
    if not is_line(case.name):
        raise CaseError(f"case.toml, name: {shown(case.name)} is not allowed; it must be one line of text.")
    for name in ("title", "source"):
        value = getattr(case, name)
        if not (isinstance(value, str) and all(c.isprintable() or c in "\n\t" for c in value)):
            raise CaseError(
                f"case.toml, {name}: {shown(value)} is not allowed; it must be text without control characters."
            )


def _unique(table: str, column: str, keys: Sequence[Hashable]) -> None:
    seen: dict[Hashable, int] = {}
    for i, key in enumerate(keys):
        if key in seen:
            raise RowError(table, i, column, f"{column} {key} appears twice ({{rows}}); give each its own.", seen[key])
        seen[key] = i


def _references(case: Tables) -> None:
    """Check that every bus that is named exists."""
    known = {b.bus for b in case.buses}
    columns = {
        "branches": ("from_bus", "to_bus"),
        "machines": ("bus", "storage_bus"),
        "loads": ("bus",),
        "links": ("from_bus", "to_bus"),
    }
    for table, names in columns.items():
        for i, row in enumerate(getattr(case, table)):
            for name in names:
                if getattr(row, name) not in known:
                    raise RowError(table, i, name, f"there is no bus {getattr(row, name)} in buses.csv.")


def _kinds(case: Tables) -> None:
    """Check that there is a swing bus, that swing and pv buses have machines, and those at pq buses a q or a name."""
    if not any(b.kind == "swing" for b in case.buses):
        raise CaseError("buses.csv, column kind: there is no swing bus; make one bus with a machine the swing bus.")
    at_machines = {m.bus for m in case.machines}
    unscheduled = {m.bus for m in case.machines if not (m.q or m.name)}
    for i, b in enumerate(case.buses):
        if b.kind != "pq" and b.bus not in at_machines:
            raise RowError("buses", i, "kind", f"bus {b.bus} is a {b.kind} bus but has no machine; make it pq.")
        if b.kind == "pq" and b.bus in unscheduled:
            text = f"bus {b.bus} has a machine; make it pv or swing, not pq."
            raise RowError("buses", i, "kind", text)


def _branches(case: Tables) -> None:
    """Raise the first branch without impedance or to itself."""
    least = LEAST_IMPEDANCE * case.base_mva / 100
    for i, k in enumerate(case.branches):
        if math.hypot(k.r, k.x) < least:
            text = f"branch {k.from_bus}-{k.to_bus} has no impedance; r or x must be at least {least:g} pu in size."
            raise RowError("branches", i, "x_pu", text)
        if k.from_bus == k.to_bus:
            text = f"branch {k.from_bus}-{k.to_bus} connects a bus to itself; give two different buses."
            raise RowError("branches", i, "to_bus", text)


def _loads(case: Tables) -> None:
    for i, load in enumerate(case.loads):
        for part in "pq":
            total = getattr(load, f"{part}_power") + getattr(load, f"{part}_current")
            if total > 1 + 1e-9:
                text = f"the shares {part}_power and {part}_current add up to {total:g}; they must not exceed 1."
                raise RowError("loads", i, f"{part}_current", text)


def check_devices(case: Tables) -> None:
    """Raise the first error in the device tables."""
    _owners(case)
    _one_of_a_kind(case)
    _every_unit_has_a_model(case)
    _controls(case)
    for model, rows in case.devices.items():
        for i, (key, par) in enumerate(rows.items()):
            parameters(model, i, key, par)


def _owners(case: Tables) -> None:
    """Check that every device belongs to a machine, to a bus, or (load models) to a row of loads.csv."""
    machines, buses = {m.machine for m in case.machines}, {b.bus for b in case.buses}
    loads = set(naming.keys(case, "loads"))
    for model, rows in case.devices.items():
        column = key_column(model)
        for i, key in enumerate(rows):
            if not (isinstance(key, int) and not isinstance(key, bool)) and not naming.REPEATED.fullmatch(str(key)):
                text = f"{key!r} is not allowed; it must be a {column} number, or 2#2 for the second device at 2."
                raise RowError(model, i, column, text)
            if tables.role(model) == "load" and key not in loads:
                text = f"there is no load at bus {key} in loads.csv; add it there, with its p and q."
                raise RowError(model, i, column, text)
            if naming.number(key) not in (buses if column == "bus" else machines):
                table = "buses.csv" if column == "bus" else "machines.csv"
                raise RowError(model, i, column, f"there is no {column} {naming.number(key)} in {table}.")


def _one_of_a_kind(case: Tables) -> None:
    """Check that a machine has at most one model, one exciter and one governor, and a load one model."""
    first: dict[tuple[naming.Key, str], tuple[str, int]] = {}
    for model, rows in case.devices.items():
        role = tables.role(model)
        if role not in (*tables.SINGLE_ROLES, "load"):
            continue
        place, kind = key_column(model), "unit" if role in tables.UNIT_ROLES else role
        for i, key in enumerate(rows):
            owner = key if role == "load" else naming.number(key)
            if (owner, kind) not in first:
                first[owner, kind] = model, i
                continue
            other, row = first[owner, kind]
            noun = {"unit": "models", "load": "models"}.get(kind, kind + "s")
            if other == model:
                text = f"{place} {owner} appears twice ({{rows}}); it can have only one row in this table."
                raise RowError(model, i, place, text, row)
            text = f"{place} {owner} has two {noun}, in {other}.csv and {model}.csv; keep one."
            raise RowError(model, i, place, text)


def _every_unit_has_a_model(case: Tables) -> None:
    """Check that every machine has a model, unless none has: such a case has a power flow only."""
    known = tables.of_role(*tables.UNIT_ROLES)
    if not any(tables.role(model) in devices.UNIT_ROLES for model in case.devices):
        return
    modeled = {naming.number(key) for model in known for key in case.devices.get(model, ())}
    for i, m in enumerate(case.machines):
        if m.machine not in modeled:
            text = (
                f"machine {m.called} has no model; add a row for it to one of {', '.join(f'{k}.csv' for k in known)}."
            )
            raise RowError("machines", i, "machine", text)


def _controls(case: Tables) -> None:
    """Check that every control has something to act on."""
    for model, rows in case.devices.items():
        role = tables.role(model)
        for i, key in enumerate(rows):
            number = naming.number(key)
            called = case.called.get(number)
            unit = case.model(number, "machine") or case.model(number, "converter")
            if unit and role in CONTROLS and not tables.takes(unit, role):
                text = f"machine {called} is modeled by {unit}, which has no {role}; remove this row."
                raise RowError(model, i, "machine", text)
            if role == "plant control" and not case.model(number, "electrical control"):
                text = f"machine {called} has no electrical control for its plant control to act on; add one."
                raise RowError(model, i, "machine", text)
            if role == "stabilizer" and unit and not case.model(number, "exciter"):
                text = f"machine {called} has no exciter for its stabilizer to act on; add one or remove this row."
                raise RowError(model, i, "machine", text)


def parameters(model: str, i: int, key: naming.Key, par: Any) -> None:
    """Raise the first invalid combination of parameters."""
    kind: type = type(par)
    of = fields(kind)
    owner = f"{key_column(model)} {key}"
    for name, f in of.items():
        top = name.removesuffix("min") + "max"
        if name.endswith("min") and top in of and getattr(par, name) > getattr(par, top):
            text = f"{name} = {getattr(par, name):g} is above {top} = {getattr(par, top):g}."
            raise RowError(model, i, f.column, text)
    for name, text in getattr(par, "errors", tuple)():
        raise RowError(model, i, of[name].column, f"{name} = {getattr(par, name):g} of {owner} {text}.")


def key_column(model: str) -> str:
    """Name of the column that keys a model's table."""
    return tables.key_field(model).name


def storage(case: Tables) -> None:
    """Raise the first storage device that repeats another, whose bus or machine does not exist, or with too few MVA."""
    buses, machines = {b.bus for b in case.buses}, {m.machine for m in case.machines}
    first: dict[Storage, int] = {}
    for i, s in enumerate(case.storage):
        if first.setdefault(s, i) != i:
            called = case.called.get(s.machine, s.machine)
            text = f"the device of machine {called} at bus {s.bus} is given twice ({{rows}}); remove one of them."
            raise RowError("storage", i, "machine", text, first[s])
        if s.bus not in buses:
            raise RowError("storage", i, "bus", f"there is no bus {s.bus} in buses.csv.")
        if s.machine not in machines:
            raise RowError("storage", i, "machine", f"there is no machine {s.machine} in machines.csv.")
        if 0 < s.mva < s.rating:
            raise RowError("storage", i, "mva", f"{s.mva:g} MVA is less than its rating of {s.rating:g} MW; raise it.")
        _converter(i, s)


def _converter(i: int, s: Storage) -> None:
    """Raise the first wrong parameter of a converter of storage, or what an ideal device or a converter has not."""
    device = devices.every()[s.device]
    if device.kit.finite and not s.energy:
        text = f"must be above 0 for a {s.storage_model}, whose power depends on its stored energy."
        raise RowError("storage", i, "energy", text)
    if device.current_limit and s.characteristic != "power":
        text = (
            f"{s.characteristic} applies only to ideal devices; a converter ({s.storage_model}) "
            "keeps its power constant."
        )
        raise RowError("storage", i, "characteristic", text)
    wrong = _setting(s.device, s.converter)
    if wrong:
        raise RowError("storage", i, "converter", wrong)


@cache
def _setting(device: str, text: str) -> str:
    """What is wrong with the parameters of a converter, as a sentence; empty if nothing is."""
    try:
        joined.parameters(devices.every()[device].kit, text)
    except StudyError as error:
        return str(error)
    return ""


def _connected(case: Tables) -> None:
    """Check that there is one swing bus in every island of the network."""
    from . import network

    island = network.islands(network.build(case)).tolist()
    swing: dict[int, int] = {}
    for i, b in enumerate(case.buses):
        if b.kind != "swing":
            continue
        if island[i] in swing:
            first = swing[island[i]]
            text = f"buses {case.buses[first].bus} and {b.bus} are both swing buses ({{rows}}); keep exactly one."
            raise RowError("buses", i, "kind", text, first)
        swing[island[i]] = i
    for i, b in enumerate(case.buses):
        if island[i] not in swing:
            text = f"bus {b.bus} is not connected to the swing bus; add a branch or remove the bus."
            raise RowError("buses", i, "bus", text)
