"""Checks of a case: the first mistake is raised with its place, unusual rows are returned as sentences."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from stabctl.devices import models
from stabctl.errors import CaseError
from stabctl.schema import fields

if TYPE_CHECKING:
    from .case import Case


LARGEST = 1e12  # beyond it numbers are taken for mistakes
LEAST_IMPEDANCE = 1e-9  # pu


def fail(table: str, row: int, column: str, text: str) -> NoReturn:
    """Raise a `CaseError` at a row (0 is the first below the header) and column of a table."""
    error = CaseError(f"{table}.csv row {row + 2}, column {column}: {text}")
    error.table, error.row, error.column, error.text = table, row, column, text
    raise error


def check(case: "Case", tables: Mapping[str, type]) -> Iterator[str]:
    """Raise the first mistake of the case (`tables`: its tables and their records); yield sentences on the unusual."""
    for quantity in ("base_mva", "frequency_hz"):
        value = getattr(case, quantity)
        if not (isinstance(value, int | float) and 1e-6 <= value <= 1e9):
            raise CaseError(
                f"case.toml, {quantity}: {_short(value)} is not allowed; it must be a number from 1e-6 to 1e9."
            )
    if not _text(case.name):
        raise CaseError(f"case.toml, name: {case.name!r} is not allowed; it must be a text of one line.")
    for name, record in tables.items():
        if name != "storage":
            _values(name, record, getattr(case, name))
    for name in ("buses", "machines"):
        if not getattr(case, name):
            raise CaseError(f"{name}.csv: the table has no row; a case needs at least one.")
    _unique("buses", "bus", [b.bus for b in case.buses])
    _unique("machines", "machine", [m.machine for m in case.machines])
    _unique("links", "link", [k.link for k in case.links])
    _buses(case)
    _branches(case)
    _loads(case)
    yield from _devices(case)
    storage(case, tables["storage"])
    _connected(case)


def storage(case: "Case", record: type) -> None:
    """Raise the first mistake in the storage devices (their record) of a case that is sound otherwise."""
    _values("storage", record, case.storage)
    buses, numbers = {b.bus for b in case.buses}, {m.machine for m in case.machines}
    for i, s in enumerate(case.storage):
        if s.bus not in buses:
            fail("storage", i, "bus", f"there is no bus {s.bus}; name a bus of buses.csv.")
        if s.machine not in numbers:
            fail("storage", i, "machine", f"there is no machine {s.machine}; name a machine of machines.csv.")


def _values(table: str, record: type, rows: Sequence[Any]) -> None:
    """Every value of the right kind, finite and within its range."""
    for f in fields(record).values():
        for i, row in enumerate(rows):
            value = getattr(row, f.name)
            good = value in f.choices if f.choices else _text(value) if f.kind is str else _number(value, f)
            if not good:
                large = isinstance(value, int | float) and abs(value) > LARGEST
                limit = f" of at most {LARGEST:g} in size" if large else ""
                fail(table, i, f.column, f"{_short(value)} is not allowed; it must be {f.expected()}{limit}.")


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) < 40 else text[:36] + "..."


def _text(value: object) -> bool:
    return isinstance(value, str) and value.isprintable()


def _number(value: object, f: Any) -> bool:
    whole = isinstance(value, int) and not isinstance(value, bool)
    kind = whole if f.kind is int else whole or isinstance(value, float)
    return kind and -LARGEST <= value <= LARGEST and value in f.allowed


def _unique(table: str, column: str, keys: Sequence[object]) -> None:
    seen: dict[object, int] = {}
    for i, key in enumerate(keys):
        if key in seen:
            fail(table, i, column, f"{column} {key} stands already in row {seen[key] + 2}; each may stand once.")
        seen[key] = i


def _buses(case: "Case") -> None:
    """Every bus that is named exists; one bus swings, and it has a machine, as every pv bus has."""
    known = {b.bus for b in case.buses}
    places = (
        ("branches", case.branches, ("from_bus", "to_bus")),
        ("machines", case.machines, ("bus", "storage_bus")),
        ("loads", case.loads, ("bus",)),
        ("links", case.links, ("from_bus", "to_bus")),
    )
    for table, rows, columns in places:
        for i, row in enumerate(rows):
            for column in columns:
                if getattr(row, column) not in known:
                    fail(table, i, column, f"there is no bus {getattr(row, column)}; name a bus of buses.csv.")
    swings = [i for i, b in enumerate(case.buses) if b.kind == "swing"]
    if not swings:
        raise CaseError("buses.csv, column kind: no bus is the swing bus; exactly one must be.")
    if len(swings) > 1:
        first = case.buses[swings[0]].bus
        fail("buses", swings[1], "kind", f"bus {first} is the swing bus already; exactly one bus may be.")
    driven = {m.bus for m in case.machines}
    for i, b in enumerate(case.buses):
        if b.kind != "pq" and b.bus not in driven:
            fail("buses", i, "kind", f"{b.kind!r} bus {b.bus} has no machine; it must be pq.")
        if b.kind == "pq" and b.bus in driven:
            fail("buses", i, "kind", f"bus {b.bus} has a machine; it must be pv or swing, not pq.")


def _branches(case: "Case") -> None:
    for i, k in enumerate(case.branches):
        if abs(complex(k.r, k.x)) < LEAST_IMPEDANCE:
            text = f"has no impedance; r or x must be at least {LEAST_IMPEDANCE:g} pu in size."
            fail("branches", i, "x_pu", f"branch {k.from_bus}-{k.to_bus} {text}")
        if k.from_bus == k.to_bus:
            fail("branches", i, "to_bus", f"branch {k.from_bus}-{k.to_bus} ends where it starts; name two buses.")


def _loads(case: "Case") -> None:
    for i, load in enumerate(case.loads):
        for part in "pq":
            total = getattr(load, f"{part}_power") + getattr(load, f"{part}_current")
            if total > 1 + 1e-9:
                fail("loads", i, f"{part}_current", f"shares of {part} sum to {total:g}; they must not exceed 1.")


def _devices(case: "Case") -> Iterator[str]:
    """Parameters in range; one machine model each; controls that belong to the machine and to each other."""
    numbers = {m.machine for m in case.machines}
    has: dict[tuple[int, str], str] = {}
    for model, rows in case.devices.items():
        if model not in models():
            raise CaseError(f"{model}.csv: there is no such device; known are {', '.join(models())}.")
        device, table = models()[model], list(rows.items())
        _values(model, device.Par, [par for _, par in table])
        for i, (number, par) in enumerate(table):
            if number not in numbers:
                fail(model, i, "machine", f"there is no machine {number}; name a machine of machines.csv.")
            if (number, device.ROLE) in has:
                other = has[number, device.ROLE]
                fail(model, i, "machine", f"machine {number} has its {device.ROLE} in {other}.csv already; keep one.")
            has[number, device.ROLE] = model
            columns = {f.name: f.column for f in fields(device.Par).values()}
            for name, column in columns.items():
                top = name[:-3] + "max"
                if name.endswith("min") and top in columns and getattr(par, name) > getattr(par, top):
                    fail(model, i, column, f"{getattr(par, name):g} is above {top} = {getattr(par, top):g}.")
            for name, text in getattr(par, "errors", tuple)():
                fail(model, i, columns[name], f"{getattr(par, name):g} of machine {number} {text}.")
            for name, text in getattr(par, "warnings", tuple)():
                value = getattr(par, name)
                yield f"{model}.csv row {i + 2}, column {columns[name]}: {value:g} of machine {number} {text}."
    for i, m in enumerate(case.machines):
        if (m.machine, "machine") not in has:
            fail("machines", i, "machine", f"machine {m.machine} has no row in genrou.csv or gencls.csv; give it one.")
    for model, rows in case.devices.items():
        for i, number in enumerate(rows):
            role = models()[model].ROLE
            if role == "exciter" and has[number, "machine"] == "gencls":
                fail(model, i, "machine", f"machine {number} is classical (gencls.csv) and takes no exciter.")
            if role == "stabilizer" and (number, "exciter") not in has:
                fail(model, i, "machine", f"machine {number} has no exciter for its stabilizer to act on.")


def _connected(case: "Case") -> None:
    """Every bus is reached from the swing bus."""
    neighbors: dict[int, list[int]] = {b.bus: [] for b in case.buses}
    for k in case.branches:
        neighbors[k.from_bus].append(k.to_bus)
        neighbors[k.to_bus].append(k.from_bus)
    reached = {next(b.bus for b in case.buses if b.kind == "swing")}
    front = list(reached)
    while front:
        front = [n for bus in front for n in neighbors[bus] if n not in reached and not reached.add(n)]
    for i, b in enumerate(case.buses):
        if b.bus not in reached:
            fail("buses", i, "bus", f"bus {b.bus} is cut off from the swing bus; connect it by a branch or remove it.")
