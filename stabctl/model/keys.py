"""Keys of table rows: bus 7, machine 2, circuit 7-8, storage device 14@33; `#2` is the second with the same name.

Devices are keyed by machine number, load models by bus number: the first of a model at machine 2 has the key 2 (int),
the second "2#2" (str).
"""

import difflib
import re
from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

from stabctl.errors import StudyError, shown

from . import catalog, circuits, labels
from .tables import TABLES

if TYPE_CHECKING:
    from .case import Case

Key = int | str

_NOUNS = {
    "buses": "bus",
    "branches": "branch",
    "machines": "machine",
    "loads": "load at bus",
    "links": "HVDC link",
    "storage": "storage device",
}
REPEATED = re.compile(r"([1-9][0-9]{0,17})#([2-9]|[1-9][0-9]{1,8})")


def number(key: Key) -> int:
    """Machine or bus number of a device's key."""
    return int(str(key).partition("#")[0])


def moved(key: Key, shift: int) -> Key:
    """The key with its machine or bus number increased by `shift`."""
    head, mark, count = str(key).partition("#")
    return f"{int(head) + shift}#{count}" if mark else int(head) + shift


def numbered(names: Iterable[Key]) -> list[Key]:
    """The names made unique: the second of a name gets `#2`."""
    seen: Counter[Key] = Counter()
    found: list[Key] = []
    for name in names:
        seen[name] += 1
        found.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return found


def keys(case: "Case", table: str) -> list[Key]:
    """Keys of the rows of a table of the case, in order."""
    if table not in TABLES:
        return list(case.devices[table])
    rows = getattr(case, table)
    match table:
        case "branches":
            return list(circuits.names(rows))
        case "storage":
            return numbered(f"{s.machine}@{s.bus}" for s in rows)
        case _:
            return numbered(row[0] for row in rows)


def row(case: "Case", table: str, key: Key) -> int:
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
    if table == "branches" and (circuit := circuits.parse(case, wanted)) and (rows := circuits.rows(case, circuit)):
        return rows[0]
    at_bus = table in ("buses", "loads") or (table not in TABLES and catalog.at_bus(table))
    number = labels.bus_number(case, wanted) if at_bus else labels.machine_number(case, wanted)
    if number is not None and str(number) in known:
        return known[str(number)]
    if table == "storage":
        of_machine = [i for k, i in known.items() if k.partition("@")[0] == wanted]
        if len(of_machine) == 1:
            return of_machine[0]
    name = wanted if len(wanted) <= 40 else f"{wanted[:36]}..."
    what = f"{_NOUNS[table]} {name}" if table in _NOUNS else f"{table} at {name}"
    raise StudyError(f"{case.name} has no {what}; {near(wanted, known)}")


def known_table(case: "Case", name: str) -> str:
    """The name of a table that has rows in the case. Raises `StudyError` if there is none, with similar names."""
    known = [table for table in TABLES if getattr(case, table)] + list(case.devices)
    if name in known:
        return name
    if name in TABLES or name in catalog.models():
        raise StudyError(f"{case.name} has no rows in {name}; it has {', '.join(known)}.")
    raise StudyError(f"There is no table {name!r} in {case.name}; {near(name, known)}")


def near(wanted: str, known: Iterable[str]) -> str:
    """End of a sentence: the names most similar to the one wanted, or the first few."""
    known = list(known)
    if re.fullmatch(r"[0-9]{1,18}", wanted) and all(name.isdecimal() for name in known):
        known.sort(key=lambda name: abs(int(name) - int(wanted)))
        return f"the nearest numbers are {', '.join(sorted(known[:3], key=int))}."
    similar = difflib.get_close_matches(wanted, known, 3, 0.5)
    if similar:
        return f"did you mean {' or '.join(similar)}?"
    return f"it has {', '.join(known[:8])}" + (f" and {len(known) - 8} more." if len(known) > 8 else ".")
