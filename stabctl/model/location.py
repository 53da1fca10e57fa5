"""Locations in the network: a bus `83`, a circuit `7-8`, `7-8#2` or `7-8 ckt 2`, a point on a circuit `7-8@0.4`.

Text is read here, and is then the number of a bus or a `Circuit`, whose text is read back as the same.
"""

import re
from typing import Any, NamedTuple

from stabctl._util.errors import StudyError, shown
from stabctl._util.wording import near

from . import naming
from .case import Case
from .naming import Circuit

_NUMBER = re.compile(r"[0-9]{1,18}")
_POINT = re.compile(r"(.+)@([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)")
Place = str | Circuit  # a bus by its number


class Location(NamedTuple):
    """The row of a bus, or of a branch with the fraction of its length from its from end."""

    bus: int | None
    branch: int | None = None
    fraction: float | None = None


def _no_branch(case: Case, a: int, b: int) -> str:
    missing = {a, b} - {k.bus for k in case.buses}
    idle = (naming.idle(case, "bus", [bus]) for bus in sorted(missing))
    if said := naming.idle(case, "branch", (a, b)) or next(filter(None, idle), ""):
        return f"{said}, so there is no branch {a}-{b}."
    if missing:
        bus, others = min(missing), near(str(min(missing)), (str(k.bus) for k in case.buses))
        return f"There is no branch {a}-{b} in {case.name}, because there is no bus {bus}; {others}"
    others = branches_at(case, a)
    verb = "branches at bus {a} are" if ", " in others else "branch at bus {a} is"
    return f"There is no branch {a}-{b} in {case.name}; the {verb.format(a=a)} {others}."


def branches_at(case: Case, bus: int) -> str:
    """The branches at a bus: `2-1, 2-3, 2-101 (star 2-7-11)`."""
    ends = {k.from_bus + k.to_bus - bus for k in case.branches if bus in (k.from_bus, k.to_bus)}
    return ", ".join(f"{bus}-{naming.told(case.buses[case.row_of_bus[end]])}" for end in sorted(ends))


def read(case: Case, text: str) -> Place:
    """The location that a text names, from the end named first; whether the case has such a circuit is not checked."""
    text = text.strip()
    if (number := naming.bus_number(case, text)) is not None:
        return str(number)
    if said := naming.idle(case, "bus", id=text):
        raise StudyError(f"{said}; choose another location.")
    if _NUMBER.fullmatch(text):
        raise StudyError(f"There is no bus {text} in {case.name}; {near(text, (str(b.bus) for b in case.buses))}")
    if (found := _circuit(case, text)) is None:
        raise StudyError(
            f"{shown(text)} is not a location; write 83 for a bus, 7-8, 7-8#2 or 7-8 ckt 'A B' for a circuit, 7-8@0.4 "
            "for a point on it."
        )
    return found


def written(place: Any) -> Any:
    """The circuit or the point that a text names by numbers of buses; anything else as it is."""
    return (_circuit(None, place.strip()) if isinstance(place, str) else None) or place


def _circuit(case: Case | None, text: str) -> Circuit | None:
    """A point on a circuit, or a circuit; its identifier may begin with `@`."""
    point = _POINT.fullmatch(text)
    if point and (on := naming.parse_circuit(case, point[1])):
        return on._replace(at=float(point[2]))
    return naming.parse_circuit(case, text)


def locate(case: Case, place: Place) -> Location:
    """The rows of a location.

    Raises
    ------
    StudyError
        If the case has no such bus or circuit, or a text is not a location.
    """
    found = read(case, place) if isinstance(place, str) else place
    if isinstance(found, str):
        return Location(case.row_of_bus[int(found)])
    row, (a, b, *_, along) = _circuit_row(case, found), found
    if along is not None and not 0 <= along <= 1:
        raise StudyError(
            f"The position {along:g} along {a}-{b} is not allowed; it must be from 0 (bus {a}) to 1 (bus {b})."
        )
    return Location(None, row, along if along is None or case.branches[row].from_bus == a else 1 - along)


def placed(case: Case, place: Place) -> Place:
    """The same location by the number of the bus, or by the circuit as the case has it, from its from end."""
    bus, row, along = locate(case, place)
    if row is None:
        return str(case.buses[bus or 0].bus)
    return naming.circuit(case, row)._replace(at=None if along is None else round(along, 12))


def _circuit_row(case: Case, wanted: Circuit) -> int:
    """Row of a circuit; the first of those between its buses if it is not told from the others."""
    a, b = wanted.a, wanted.b
    if rows := naming.circuit_rows(case, wanted):
        return rows[0]
    among = naming.circuit_rows(case, wanted._replace(place=None, id=None))
    if among and (said := naming.idle_circuit(case, wanted)):
        known = ", ".join(str(naming.circuit(case, row)) for row in among)
        raise StudyError(f"{said}; in service is {known}.")
    if not among:
        raise StudyError(_no_branch(case, a, b))
    if wanted.id is None:
        count = f"{len(among)} circuit{'s' * (len(among) > 1)}"
        raise StudyError(f"Branch {a}-{b} of {case.name} has {count}, but no circuit {wanted.place}.")
    known = ", ".join(naming.quoted(case.branches[i].circuit) for i in among)
    raise StudyError(f"Branch {a}-{b} of {case.name} has no circuit {wanted.id}; its identifiers are {known}.")


def circuit(case: Case, place: Place) -> tuple[int, bool]:
    """Row of the circuit named `7-8` or `7-8#2`, and whether the first bus named is its from end."""
    found = read(case, place) if isinstance(place, str) else place
    if isinstance(found, str) or found.at is not None:
        raise StudyError(f"{place!r} is not a circuit; write 7-8, or 7-8#2 for the second circuit.")
    row = _circuit_row(case, found)
    return row, case.branches[row].from_bus == found.a
