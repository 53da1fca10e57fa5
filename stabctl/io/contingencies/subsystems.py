"""Subsystems of a SUB file of PSS/E: named sets of buses.

The buses of all selectors in a subsystem are one set. In a JOIN ... END group, selectors of the same kind are united,
and a bus must be in all kinds that the group has: AREA 1 and KVRANGE 100 500 in a group are the buses of area 1 from
100 to 500 kV.
"""

from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from stabctl._util.errors import StudyError
from stabctl._util.wording import near
from stabctl.model.case import Case

from .statements import OutOfService, Statement, Word, bus, number, read

SELECTORS = {"AREAS": "area", "ZONES": "zone", "OWNERS": "owner", "BUSES": "bus", "BUS": "bus"}
SELECTORS |= {"KVRANGE": "rated", "KV": "rated"}
RANGES = "AREAS", "ZONES", "OWNERS", "BUSES", "KVRANGE"  # with two values; others have one
NEEDED = "AREA 1, ZONE 1, OWNER 1, BUS 7, KVRANGE 100 500, a range such as AREAS 1 5, JOIN or END"


class Subsystem(NamedTuple):
    """A named set of buses."""

    name: str
    buses: frozenset[int]


class Group:
    """Buses by the columns that select them."""

    def __init__(self, joined: bool, opened: Statement) -> None:
        self.joined, self.opened = joined, opened
        self.found: dict[str, set[int]] = {}

    @property
    def buses(self) -> set[int]:
        """The buses in all kinds of selectors of a JOIN group; elsewhere those in any."""
        sets = [*self.found.values()]
        return (set.intersection if self.joined else set.union)(*sets) if sets else set()


class Subsystems:
    """The subsystems of a file, by name."""

    def __init__(self, path: str | Path, case: Case) -> None:
        self.path, self.case = Path(path), case
        self.named: dict[str, Subsystem] = {}
        self.groups: list[Group] = []
        self.name, self.ended = "", False
        for statement in read(self.path):
            words = list(statement.words)
            while words:
                self._take(statement, words)
        if self.groups:
            raise self.groups[-1].opened.error("it has no END.")
        if self.named and not self.ended:
            raise statement.error("the END of the file is missing after it; every SUBSYSTEM and JOIN has one, too.")
        if not self.named:
            raise StudyError(f"{path} has no subsystem; write SUBSYSTEM 'name', {NEEDED}.")

    def buses(self, statement: Statement, word: Word) -> frozenset[int]:
        """The buses of a subsystem that a statement names. Raises `StudyError`."""
        if word.text.upper() not in self.named:
            known = [one.name for one in self.named.values()]
            raise statement.error(f"{self.path} has no subsystem {word}; {near(word.text, known)}")
        return self.named[word.text.upper()].buses

    def _take(self, statement: Statement, words: list[Word]) -> None:
        """Read the next keyword of a line with its values."""
        first = words.pop(0)
        if self.ended:
            raise statement.error("nothing may follow the END of the file.")
        if first.means("END"):
            self._end(statement)
        elif first.means("SUBSYSTEM") or first.means("SYSTEM"):
            self._begin(statement, words)
        elif not self.groups:
            raise statement.error(f"{first} is in no subsystem; begin one with SUBSYSTEM 'name'.")
        elif first.means("JOIN"):
            if len(self.groups) > 1:
                raise statement.error("a JOIN group cannot be in another one; close that with END first.")
            if words and (words[0].quoted or not any(words[0].means(k) for k in (*SELECTORS, "END"))):
                words.pop(0)  # its name
            self.groups.append(Group(True, statement))
        else:
            self._select(statement, first, words)

    def _begin(self, statement: Statement, words: list[Word]) -> None:
        if self.groups:
            raise statement.error(f"subsystem '{self.name}' has no END before it.")
        if not words:
            raise statement.error("the name of the subsystem is missing; write SUBSYSTEM 'name'.")
        self.name = words.pop(0).text.strip()
        if self.name.upper() in self.named:
            raise statement.error(f"there is a subsystem '{self.name}' above; give it another name.")
        self.groups.append(Group(False, statement))

    def _end(self, statement: Statement) -> None:
        if not self.groups:
            self.ended = True
            return
        group = self.groups.pop()
        if not group.buses:
            raise group.opened.error(f"no bus of {self.case.name} is selected; write {NEEDED}.")
        if self.groups:
            self.groups[-1].found[f"group {len(self.groups[-1].found)}"] = group.buses
        else:
            self.named[self.name.upper()] = Subsystem(self.name, frozenset(group.buses))

    def _select(self, statement: Statement, first: Word, words: list[Word]) -> None:
        """Read a selector and its values."""
        keyword = next((k for k in SELECTORS if first.means(k)), None)
        if keyword is None:
            raise statement.error(f"{first} is not allowed here; it must be {NEEDED}; {near(first.text, SELECTORS)}")
        column, plural = SELECTORS[keyword], first.text.upper() in RANGES
        values: list[Word] = []
        while words and len(values) < 1 + plural and _is_value(words[0], column):
            values.append(words.pop(0))
        if len(values) < 1 + plural:
            raise statement.error(f"a value of {first} is missing; write {NEEDED}.")
        name = "buses" if column == "bus" else column
        into = self.groups[-1].found.setdefault(column, set())
        with suppress(OutOfService):  # no contingency has such a bus
            into |= (chosen := self._chosen(statement, column, values))
            if not chosen:
                said, known = " to ".join(map(str, values)), sorted({str(getattr(b, column)) for b in self.case.buses})
                raise statement.error(f"{self.case.name} has no {name} {said}; {near(values[0].text, known)}")

    def _chosen(self, statement: Statement, column: str, values: list[Word]) -> set[int]:
        """The buses whose column is a value or in a range."""
        if column == "bus" and len(values) == 1:
            return {bus(statement, self.case, values[0])}
        low, *rest = (number(statement, word) for word in values)
        high = rest[0] if rest else low
        if low > high:
            raise statement.error(f"the range {low:g} to {high:g} is empty; give the lower value first.")
        return {b.bus for b in self.case.buses if low - 1e-6 <= getattr(b, column) <= high + 1e-6}


def named(statement: Statement, word: Word, subsystems: Subsystems | None) -> frozenset[int]:
    """The buses of a subsystem that a statement of another file names. Raises `StudyError`."""
    if subsystems is None:
        raise statement.error("the subsystems are missing; give their file, subsystems='FILE.sub'.")
    return subsystems.buses(statement, word)


def _is_value(word: Word, column: str) -> bool:
    return word.text[:1].isdigit() or word.text[:1] in "+-." or (column == "bus" and word.quoted)
