"""Names of circuits: `7-8`, `7-8#2` for the second between two buses, `7-8 ckt 2` by its identifier."""

import re
from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

from . import labels
from .tables import Branch

if TYPE_CHECKING:
    from .case import Case

_CIRCUIT = re.compile(r"(.+?)\s*(?:#\s*([0-9]{1,9})|(?<![^\s0-9])ckt\s*(\S+))?", re.IGNORECASE)
_NUMBERS = re.compile(r"([0-9]{1,18})\s*-\s*([0-9]{1,18})")


class Circuit(NamedTuple):
    """A circuit by its buses, and by its place among those between them (from 1) or by its identifier."""

    a: int
    b: int
    place: int | None
    id: str | None


def names(branches: Iterable[Branch]) -> list[str]:
    """Names of the branches, in order; the identifier is left out if it is 1 and there is no other circuit."""
    branches = tuple(branches)
    together = Counter(frozenset((k.from_bus, k.to_bus)) for k in branches)
    count: Counter[frozenset[int]] = Counter()
    found: dict[str, None] = {}
    for k in branches:
        ends, name = frozenset((k.from_bus, k.to_bus)), f"{k.from_bus}-{k.to_bus}"
        count[ends] += 1
        identified = f"{name} ckt {k.circuit}"
        if k.circuit and identified not in found and (together[ends] > 1 or k.circuit != "1"):
            name = identified
        elif count[ends] > 1:
            name = f"{name}#{count[ends]}"
        found[name] = None
    return list(found)


def parse(case: "Case", text: str) -> Circuit | None:
    """The circuit that a text names, whether or not the case has it; None if the text is not of that form."""
    match = _CIRCUIT.fullmatch(text.strip())
    if match is None:
        return None
    ends = _ends(case, match[1])
    return Circuit(*ends, int(match[2]) if match[2] else None, match[3]) if ends else None


def _ends(case: "Case", text: str) -> tuple[int, int] | None:
    """Bus numbers on both sides of a dash; a bus may be given by its name, which may hold dashes."""
    if match := _NUMBERS.fullmatch(text):
        return int(match[1]), int(match[2])
    for dash in re.finditer("-", text):
        sides = labels.bus_number(case, text[: dash.start()]), labels.bus_number(case, text[dash.end() :])
        if None not in sides:
            return sides  # type: ignore[return-value]
    return None


def rows(case: "Case", wanted: Circuit) -> list[int]:
    """Rows of the branches between the buses of a circuit; only its own if it is told from the others."""
    between = [i for i, k in enumerate(case.branches) if {k.from_bus, k.to_bus} == {wanted.a, wanted.b}]
    if wanted.id is not None:
        return [i for i in between if case.branches[i].circuit.upper() == wanted.id.upper()]
    if wanted.place is not None:
        return between[wanted.place - 1 : wanted.place] if wanted.place else []
    return between
