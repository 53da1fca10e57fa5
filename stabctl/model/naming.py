"""Names and keys of rows: bus 7, machine 30/1, circuit 7-8#2, storage 14@33; `#2` is the second with the same name.

Machine 30/1 is the one with identifier 1 at bus 30; a bus may have a name. A circuit may also be given by its
identifier: `7-8 ckt 2`, or with blanks and signs in quotes, `7-8 ckt 'A B'`. Devices are keyed by machine number, load
models by bus number: the first of a model at machine 2 has the key 2 (int), the second "2#2" (str).
"""

import re
from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

from stabctl._util.errors import StudyError, shown
from stabctl._util.wording import near, numbered

from . import tables
from .tables import TABLES, Branch, Bus, Key, OutOfService, Tables

STORAGE = "ESD "  # begins the names of storage devices in messages: ESD 1@2
_NOUNS = {
    "buses": "bus",
    "branches": "branch",
    "machines": "machine",
    "loads": "load at bus",
    "links": "HVDC link",
    "storage": "storage device",
    "out_of_service": "element out of service at bus",
}
REPEATED = re.compile(r"([1-9][0-9]{0,17})#([2-9]|[1-9][0-9]{1,8})")
_CIRCUIT = re.compile(r"(.+?)\s*(?:#\s*([0-9]{1,9})|(?<![^\s0-9])ckt\s*(\S.*))?", re.IGNORECASE)
_QUOTED = r"'(?:[^']|'')*'"
_LISTED = re.compile(rf"(?:^|,)((?:{_QUOTED}|[^,])*)")
_PLAIN = re.compile(r"@?[\w&*+.-]+")
_STAR, _TERMINAL = re.compile(r"star ([0-9]+-[0-9]+-[0-9]+)"), re.compile(r"terminal ([0-9]+)/.+")
_PLACED = re.compile(r"\A(.+?)((?:@[0-9]+)?(?:#[0-9]+)?)\Z")
_NUMBERS = re.compile(r"([0-9]{1,18})\s*-\s*([0-9]{1,18})")


class Circuit(NamedTuple):
    """A circuit by its buses, and by its place among those between them (from 1) or its identifier; a point on it."""

    a: int
    b: int
    place: int | None = None
    id: str | None = None
    at: float | None = None  # of its length from bus a, if it is a point

    def __str__(self) -> str:
        told = f"#{self.place}" if self.place is not None else "" if self.id is None else f" ckt {quoted(self.id)}"
        return f"{self.a}-{self.b}{told}" + ("" if self.at is None else f"@{self.at}")

    def __repr__(self) -> str:
        return repr(str(self))


def quoted(id: str) -> str:
    """An identifier as it is written, in quotes if it holds blanks or signs that have a meaning elsewhere."""
    return id if _PLAIN.fullmatch(id) else "'" + id.replace("'", "''") + "'"


def _unquoted(text: str) -> str:
    return text[1:-1].replace("''", "'") if re.fullmatch(_QUOTED, text) else text


def listed(text: str) -> list[str]:
    """The names in a text, separated by commas; a comma in quotes is part of a name."""
    return [name.strip() for name in _LISTED.findall(text)]


def row(case: Tables, table: str, key: Key) -> int:
    """Row of a table (from 0) with that key; a circuit may be named from either end, buses and machines by name.

    Raises
    ------
    StudyError
        If the case has no such table or row; it names similar ones.
    """
    known = {str(k): i for i, k in enumerate(keys(case, known_table(case, table)))}
    wanted = key.strip() if isinstance(key, str) else shown(key)
    if wanted in known:
        return known[wanted]
    if table == "branches" and (circuit := parse_circuit(case, wanted)) and (rows := circuit_rows(case, circuit)):
        return rows[0]
    at_bus = table in ("buses", "loads") or (table not in TABLES and tables.at_bus(table))
    find = bus_number if at_bus else machine_number
    number = find(case, wanted)
    if table == "storage":
        if (machines := [s.machine for s in case.storage]).count(number) == 1:  # type: ignore[arg-type]
            return machines.index(number)  # type: ignore[arg-type]
        known = {str(k): i for i, k in enumerate(numbered(f"{s.machine}@{s.bus}" for s in case.storage))}
    for name, place in ((wanted, ""), *_PLACED.findall(wanted)):  # 30/1#2 is a device, 30/1@33 storage
        if (same := f"{find(case, name)}{place}") in known:
            return known[same]
    names = [str(called(case, table, k)) for k in keys(case, table)]
    of_circuit = table == "branches" and idle_circuit(case, parse_circuit(case, wanted))
    if said := of_circuit or idle(case, _NOUNS.get(table, ""), id=wanted):
        raise StudyError(f"{said}; {near(wanted, names)}")
    name = wanted if len(wanted) <= 40 else f"{wanted[:36]}..."
    what = f"{_NOUNS[table]} {name}" if table in _NOUNS else f"{table} at {name}"
    raise StudyError(f"{case.name} has no {what}; {near(wanted, names)}")


def known_table(case: Tables, name: str) -> str:
    """The name of a table that has rows in the case. Raises `StudyError` if there is none, with similar names."""
    known = [table for table in TABLES if getattr(case, table)] + list(case.devices)
    if name in known:
        return name
    if name in TABLES or name in tables.models():
        raise StudyError(f"{case.name} has no rows in {name}; it has {', '.join(known)}.")
    raise StudyError(f"There is no table {name!r} in {case.name}; {near(name, known)}")


def keys(case: Tables, table: str) -> list[Key]:
    """Keys of the rows of a table of the case, in order."""
    if table not in TABLES:
        return list(case.devices[table])
    rows = getattr(case, table)
    match table:
        case "branches":
            return list(map(str, circuits(rows)))
        case "storage":
            return numbered(device(case, s.machine, s.bus) for s in rows)
        case _:
            return numbered(row[0] for row in rows)


def circuits(branches: Iterable[Branch]) -> list[Circuit]:
    """The branches, in order; the identifier is left out if it is 1 and there is no other circuit."""
    branches = tuple(branches)
    together = Counter(frozenset((k.from_bus, k.to_bus)) for k in branches)
    count: Counter[frozenset[int]] = Counter()
    found: dict[Circuit, None] = {}
    for k in branches:
        ends, circuit = frozenset((k.from_bus, k.to_bus)), Circuit(k.from_bus, k.to_bus)
        count[ends] += 1
        identified = circuit._replace(id=k.circuit)
        if k.circuit and identified not in found and (together[ends] > 1 or k.circuit != "1"):
            circuit = identified
        elif count[ends] > 1:
            circuit = circuit._replace(place=count[ends])
        found[circuit] = None
    return list(found)


def circuit(case: Tables, row: int) -> Circuit:
    """The branch in a row, as `circuits` has it."""
    among = circuit_rows(case, Circuit(*case.branches[row][:2]))
    return circuits(case.branches[i] for i in among)[among.index(row)]


def parse_circuit(case: Tables | None, text: str) -> Circuit | None:
    """The circuit that a text names, whether or not the case has it, or None; without a case, buses have no names."""
    match = _CIRCUIT.fullmatch(text.strip())
    if match is None:
        return None
    ends = _ends(case, match[1])
    return Circuit(*ends, int(match[2]) if match[2] else None, match[3] and _unquoted(match[3])) if ends else None


def _ends(case: Tables | None, text: str) -> tuple[int, int] | None:
    """Bus numbers on both sides of a dash; a bus may be given by its name, which may hold dashes."""
    if match := _NUMBERS.fullmatch(text):
        return int(match[1]), int(match[2])
    if case is None:
        return None
    for dash in re.finditer("-", text):
        sides = bus_number(case, text[: dash.start()]), bus_number(case, text[dash.end() :])
        if None not in sides:
            return sides  # type: ignore[return-value]
    return None


def circuit_rows(case: Tables, wanted: Circuit) -> list[int]:
    """Rows of the branches between the buses of a circuit; only its own if it is told from the others."""
    between = list(case.rows_between.get(frozenset((wanted.a, wanted.b)), ()))
    if wanted.id is not None:
        same = [i for i in between if case.branches[i].circuit == wanted.id]
        return same or [i for i in between if case.branches[i].circuit.upper() == wanted.id.upper()]
    if wanted.place is not None:
        return between[wanted.place - 1 : wanted.place] if wanted.place else []
    return between


def loads_at(case: Tables, bus: int, id: str = "") -> list[tuple[int, str]]:
    """Row and identifier of the loads at a bus, or of that with `id`; one without an identifier has its place there."""
    rows = [i for i, load in enumerate(case.loads) if load.bus == bus and load.kind == "load"]
    named = [(row, case.loads[row].id or str(i)) for i, row in enumerate(rows, start=1)]
    return [(row, name) for row, name in named if id in ("", name)]


def machine_number(case: Tables, name: object) -> int | None:
    """Number of the machine with this number or name; the bus before the slash of a name may be given by its own."""
    text = _plain(name)
    if text.isdecimal():
        return next((m.machine for m in case.machines if str(m.machine) == text), None)
    called = str(name)
    ends = [(bus_number(case, called[: k.start()]), called[k.end() :].strip()) for k in re.finditer("/", called)]
    forms = [called, *(f"{bus}/{_unquoted(id)}" for bus, id in ends)]
    known = {m.name: m.machine for m in case.machines if m.name}
    alike = {_plain(name): number for name, number in known.items()}
    found = [known[form] for form in forms if form in known] + [alike[f] for f in map(_plain, forms) if f in alike]
    return found[0] if found else None


def bus_number(case: Tables, name: object) -> int | None:
    """Number of the bus with this number, or with this name if only one has it; capitals do not matter."""
    text = _plain(name)
    if text.isdecimal():
        return int(text) if text.isascii() and len(text) < 19 and int(text) in case.row_of_bus else None
    found = [b.bus for b in case.buses if b.name and _plain(b.name) == text]
    return found[0] if len(found) == 1 else None


def idle(case: Tables, element: str, ends: Iterable[int] = (), id: str | None = None) -> str:
    """A clause that says which element, at these buses or with this name, is out of service; empty if none is."""
    ends, name = {*ends}, None if id is None else _plain(id)
    for one in case.out_of_service:
        number = {"bus": str(one.bus), "machine": one.id.partition("/")[0]}.get(element, one.id)
        known = name in (None, _plain(one.id), _plain(number))
        if one.element == element and known and (not ends or ends == {one.bus, one.to_bus, one.third_bus} - {0}):
            return f"{_called(one)} is out of service in {case.name}"
    return ""


def idle_circuit(case: Tables, wanted: Circuit | None) -> str:
    """The same of a circuit; its place among those between its buses may be its identifier."""
    if wanted is None:
        return ""
    return idle(case, "branch", wanted[:2], wanted.id if wanted.place is None else str(wanted.place))


def _called(one: OutOfService) -> str:
    """The name of an element, as a sentence begins."""
    match one.element:
        case "branch":
            ends = "-".join(str(bus) for bus in (one.bus, one.to_bus, one.third_bus) if bus)
            return f"Branch {ends}" + (f" ckt {quoted(one.id)}" if one.id else "")
        case "bus" | "machine":
            return f"Bus {one.bus}" if one.element == "bus" else f"Machine {one.id}"
    return f"{one.element.capitalize()} {one.id}".rstrip() + f" at bus {one.bus}"


def _plain(name: object) -> str:
    """A name in capitals, with single blanks; a number without leading zeros."""
    text = " ".join(str(name).split()).upper()
    return text.lstrip("0") or text if text.isdecimal() else text


def called(case: Tables, table: str, key: Key) -> Key:
    """The key of a machine or of a device at one, with what the machine is called; any other key as it is."""
    if table != "machines" and (table in TABLES or tables.at_bus(table)):
        return key
    head, mark, count = str(key).partition("#")
    name = case.called[int(head)]
    return f"{name}#{count}" if mark else name


def device(case: Tables, machine: int, bus: int) -> str:
    """A storage device by what its machine is called and its bus: `14@33`, `30/1@33`."""
    return f"{case.called[machine]}@{bus}"


def number(key: Key) -> int:
    """Machine or bus number of a device's key."""
    return int(str(key).partition("#")[0])


def moved(key: Key, shift: int) -> Key:
    """The key with its machine or bus number increased by `shift`."""
    head, mark, count = str(key).partition("#")
    return f"{int(head) + shift}#{count}" if mark else int(head) + shift


def bus(case: Tables, number: int) -> str:
    """A bus in words: `bus 7`, or `bus 7 (NORTH)` if it has a name."""
    name = case.buses[case.row_of_bus[number]].name if number in case.row_of_bus else ""
    return f"bus {number} ({name})" if name else f"bus {number}"


def star(bus: Bus) -> str:
    """The transformer with three windings, `2-7-11`, whose star point a bus is; empty if it is none."""
    match = _STAR.fullmatch(bus.name)
    return match[1] if match else ""


def behind(bus: Bus) -> int:
    """The bus itself; for a terminal behind the step-up transformer of a machine's record, the bus of that."""
    match = _TERMINAL.fullmatch(bus.name)
    return int(match[1]) if match else bus.bus


def internal(bus: Bus) -> bool:
    """Whether a bus is such a star point or terminal, which a RAW file does not number."""
    return bool(star(bus)) or behind(bus) != bus.bus


def told(bus: Bus) -> str:
    """The number of a bus, and the name of one that a file does not number: `101 (star 2-7-11)`."""
    return f"{bus.bus} ({bus.name})" if internal(bus) else str(bus.bus)


def unit(name: int | str) -> str:
    """What lost synchronism in words: `machine 3`, or `storage device ESD 1@2`."""
    return f"storage device {name}" if str(name).startswith(STORAGE) else f"machine {name}"


def order(name: int | str) -> tuple[int, str]:
    """Key for sorting names of machines: numbers by size."""
    return len(str(name)), str(name)
