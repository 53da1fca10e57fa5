"""Locations in the network: a bus `83`, a circuit `7-8`, `7-8#2` or `7-8 ckt 2`, a point on a circuit `7-8@0.4`."""

import re
from typing import NamedTuple

from stabctl._util.errors import StudyError, shown

from . import naming
from .case import Case

_NUMBER = re.compile(r"[0-9]{1,18}")
_POINT = re.compile(r"(.+)@([0-9.eE+-]+)")


class Location(NamedTuple):
    """The row of a bus, or of a branch with the fraction of its length from its from end."""

    bus: int | None
    branch: int | None = None
    fraction: float | None = None


def _no_bus(case: Case, bus: int) -> str:
    return f"There is no bus {bus} in {case.name}; {_near(case, bus)}."


def _near(case: Case, bus: int) -> str:
    numbers = sorted((b.bus for b in case.buses), key=lambda other: abs(other - bus))[:3]
    return f"the nearest numbers are {', '.join(map(str, sorted(numbers)))}"


def _no_branch(case: Case, a: int, b: int) -> str:
    missing = {a, b} - {k.bus for k in case.buses}
    if missing:
        bus = min(missing)
        return f"There is no branch {a}-{b} in {case.name}, because there is no bus {bus}; {_near(case, bus)}."
    ends = {k.from_bus + k.to_bus - a for k in case.branches if a in (k.from_bus, k.to_bus)}
    others = ", ".join(f"{a}-{other}" for other in sorted(ends))
    verb = "branch at bus {a} is" if len(ends) == 1 else "branches at bus {a} are"
    return f"There is no branch {a}-{b} in {case.name}; the {verb.format(a=a)} {others}."


def locate(case: Case, text: str) -> Location:
    """The location that a text names in the case.

    Raises
    ------
    StudyError
        If the case has no such bus or circuit, or the text is not a location.
    """
    text = str(text)
    if (number := naming.bus_number(case, text)) is not None:
        return Location(next(i for i, bus in enumerate(case.buses) if bus.bus == number))
    if _NUMBER.fullmatch(text.strip()):
        raise StudyError(_no_bus(case, int(text)))
    name, position = _parts(case, text)
    wanted = naming.parse_circuit(case, name)
    if wanted is None:
        raise StudyError(
            f"{shown(text)} is not a location; write 83 for a bus, 7-8 or 7-8#2 for a circuit, 7-8@0.4 for a point on "
            "it."
        )
    a, b = wanted.a, wanted.b
    row = _circuit_row(case, wanted)
    if position is None:
        return Location(None, row)
    try:
        along = float(position)
    except ValueError:
        along = -1.0
    if not 0 <= along <= 1:
        raise StudyError(
            f"The position {position} along {a}-{b} is not allowed; it must be from 0 (bus {a}) to 1 (bus {b})."
        )
    return Location(None, row, along if case.branches[row].from_bus == a else 1 - along)


def _parts(case: Case, text: str) -> tuple[str, str | None]:
    """The circuit and the position along it; the identifier of a circuit may itself begin with `@`."""
    wanted = naming.parse_circuit(case, text)
    point = None if wanted and naming.circuit_rows(case, wanted) else _POINT.fullmatch(text.rstrip())
    return (point[1], point[2]) if point else (text, None)


def faulted(case: Case, text: str) -> str | None:
    """Name of the circuit of a location, without the position along it; None if it is a bus."""
    if locate(case, text).branch is None:
        return None
    name, _ = _parts(case, str(text))
    return name if name in naming.circuit_names(case.branches) else name.strip()


def _circuit_row(case: Case, wanted: naming.Circuit) -> int:
    """Row of a circuit; the first of those between its buses if it is not told from the others."""
    a, b = wanted.a, wanted.b
    if rows := naming.circuit_rows(case, wanted):
        return rows[0]
    among = naming.circuit_rows(case, wanted._replace(place=None, id=None))
    if not among:
        raise StudyError(_no_branch(case, a, b))
    if wanted.id is None:
        count = f"{len(among)} circuit{'s' * (len(among) > 1)}"
        raise StudyError(f"Branch {a}-{b} of {case.name} has {count}, but no circuit {wanted.place}.")
    known = ", ".join(case.branches[i].circuit or "none" for i in among)
    raise StudyError(f"Branch {a}-{b} of {case.name} has no circuit {wanted.id}; its identifiers are {known}.")


def circuit(case: Case, text: str) -> tuple[int, bool]:
    """Row of the circuit named `7-8` or `7-8#2`, and whether the first bus named is its from end."""
    where = locate(case, text)
    if where.branch is None or where.fraction is not None:
        raise StudyError(f"{text!r} is not a circuit; write 7-8, or 7-8#2 for the second circuit.")
    wanted = naming.parse_circuit(case, str(text))
    return where.branch, wanted is not None and case.branches[where.branch].from_bus == wanted.a
