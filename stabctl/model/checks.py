"""Checks of the tables of a case: the first error is raised with its location."""

import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from stabctl import devices
from stabctl._util.validation import Invalid, checked
from stabctl.devices.storage import joined
from stabctl.devices.storage.models import TABLES
from stabctl.errors import CaseError, StudyError, shown

from . import catalog, device_checks
from .row_error import RowError
from .tables import Storage

if TYPE_CHECKING:
    from .case import Case

LEAST_IMPEDANCE = 1e-9  # pu on 100 MVA


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
        if model not in catalog.models():
            raise CaseError(
                f"{model}.csv: there is no device model {model!r}; choose one of {', '.join(catalog.models())}."
            )
        if rows:
            record = catalog.models()[model].Par
            found[model] = MappingProxyType(dict(zip(rows, values(model, record, tuple(rows.values())), strict=True)))
    return MappingProxyType(found)


def check(case: "Case") -> Iterator[str]:
    """Raise the first inconsistency between the tables of a case; yield a warning for everything unusual."""
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
    yield from _branches(case)
    _loads(case)
    yield from device_checks.check(case)
    storage(case)
    _connected(case)


def storage(case: "Case") -> None:
    """Raise the first storage device that repeats another, whose bus or machine does not exist, or with too few MVA."""
    buses, machines = {b.bus for b in case.buses}, {m.machine for m in case.machines}
    first: dict[Storage, int] = {}
    for i, s in enumerate(case.storage):
        if first.setdefault(s, i) != i:
            text = f"the device of machine {s.machine} at bus {s.bus} is given twice ({{rows}}); remove one of them."
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
    if s.storage_model == "ideal":
        if s.converter:
            text = f"{shown(s.converter)} applies only to devices behind a converter; set storage_model to regc."
            raise RowError("storage", i, "converter", text)
        return
    if s.characteristic != "power":
        text = (
            f"{s.characteristic} applies only to ideal devices; a converter ({s.storage_model}) "
            "keeps its power constant."
        )
        raise RowError("storage", i, "characteristic", text)
    wrong = _setting(s.storage_model, s.converter)
    if wrong:
        raise RowError("storage", i, "converter", wrong)


@cache
def _setting(model: str, text: str) -> str:
    """What is wrong with the parameters of a converter, as a sentence; empty if nothing is."""
    try:
        joined.parameters(devices.every()[TABLES[model]].kit, text)
    except StudyError as error:
        return str(error)
    return ""


def _about(case: "Case") -> None:
    """The entries of case.toml."""
    for name in ("base_mva", "frequency_hz"):
        value = getattr(case, name)
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and 1e-6 <= value <= 1e9):
            raise CaseError(f"case.toml, {name}: {shown(value)} is not allowed; it must be a number from 1e-6 to 1e9.")
    if not (isinstance(case.name, str) and case.name.isprintable()):
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
            what = "names" if isinstance(key, str) else "numbers"
            text = f"{column} {key} appears twice ({{rows}}); {column} {what} must be unique."
            raise RowError(table, i, column, text, seen[key])
        seen[key] = i


def _references(case: "Case") -> None:
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


def _kinds(case: "Case") -> None:
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


def _branches(case: "Case") -> Iterator[str]:
    """Raise the first branch without impedance or to itself; yield a warning for each without reactance."""
    least = LEAST_IMPEDANCE * case.base_mva / 100
    for i, k in enumerate(case.branches):
        if math.hypot(k.r, k.x) < least:
            text = f"branch {k.from_bus}-{k.to_bus} has no impedance; r or x must be at least {least:g} pu in size."
            raise RowError("branches", i, "x_pu", text)
        if k.from_bus == k.to_bus:
            text = f"branch {k.from_bus}-{k.to_bus} connects a bus to itself; give two different buses."
            raise RowError("branches", i, "to_bus", text)
        if k.x == 0:
            yield f"branches.csv, branch {k.from_bus}-{k.to_bus}: x = 0 is unusual for a line or a transformer."


def _loads(case: "Case") -> None:
    for i, load in enumerate(case.loads):
        for part in "pq":
            total = getattr(load, f"{part}_power") + getattr(load, f"{part}_current")
            if total > 1 + 1e-9:
                text = f"the shares {part}_power and {part}_current add up to {total:g}; they must not exceed 1."
                raise RowError("loads", i, f"{part}_current", text)


def _connected(case: "Case") -> None:
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
