"""Locations in the network: a bus `83`, a circuit `7-8` or `7-8#2`, a point on a circuit `7-8@0.4`."""

import re
from typing import NamedTuple

from stabctl.errors import StudyError, shown

from .case import Case

_NUMBER = r"([0-9]{1,18})"
_LINE = re.compile(rf"^{_NUMBER}-{_NUMBER}(?:#{_NUMBER})?(?:@([0-9.eE+-]+))?$")


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
    text = str(text).strip()
    if re.fullmatch(_NUMBER, text):
        for i, bus in enumerate(case.buses):
            if bus.bus == int(text):
                return Location(i)
        raise StudyError(_no_bus(case, int(text)))
    match = _LINE.match(text)
    if not match:
        raise StudyError(
            f"{shown(text)} is not a location; write 83 for a bus, 7-8 or 7-8#2 for a circuit, 7-8@0.4 for a point on "
            "it."
        )
    a, b, circuit = int(match[1]), int(match[2]), int(match[3] or 1)
    rows = [i for i, k in enumerate(case.branches) if {k.from_bus, k.to_bus} == {a, b}]
    if not rows:
        raise StudyError(_no_branch(case, a, b))
    if not 1 <= circuit <= len(rows):
        raise StudyError(
            f"Branch {a}-{b} of {case.name} has {len(rows)} circuit{'s' * (len(rows) > 1)}, but no circuit {circuit}."
        )
    row = rows[circuit - 1]
    if match[4] is None:
        return Location(None, row)
    try:
        along = float(match[4])
    except ValueError:
        along = -1.0
    if not 0 <= along <= 1:
        raise StudyError(
            f"The position {match[4]} along {a}-{b} is not allowed; it must be from 0 (bus {a}) to 1 (bus {b})."
        )
    return Location(None, row, along if case.branches[row].from_bus == a else 1 - along)


def circuit(case: Case, text: str) -> tuple[int, bool]:
    """Row of the circuit named `7-8` or `7-8#2`, and whether the first bus named is its from end."""
    where = locate(case, text)
    if where.branch is None or where.fraction is not None:
        raise StudyError(f"{text!r} is not a circuit; write 7-8, or 7-8#2 for the second circuit.")
    return where.branch, case.branches[where.branch].from_bus == int(str(text).split("-")[0])
