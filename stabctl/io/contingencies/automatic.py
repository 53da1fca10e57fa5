"""Contingencies that a CON file of PSS/E asks for by subsystem: every branch, pairs of them, every machine or bus."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from itertools import combinations

from stabctl.simulation.contingency import Contingency
from stabctl.simulation.outage import Element, Outages

from .statements import Form, OutOfService, Statement, Word, bus, circuits, understood
from .subsystems import Subsystems, named

OF = "SUBSYSTEM|SYSTEM <name>"
ORDER = "SINGLE|DOUBLE|BUSDOUBLE|PARALLEL"
AUTOMATIC = (
    Form("inside", f"{ORDER} BRANCH|LINE IN {OF}"),
    Form("ties", f"{ORDER} BRANCH|LINE|TIE FROM {OF}"),
    Form("at", f"{ORDER} BRANCH|LINE FROM BUS <bus>"),
    Form("machines", f"SINGLE|DOUBLE MACHINE|UNIT IN|FROM {OF}"),
    Form("buses", f"SINGLE|DOUBLE BUS|BUSES IN|FROM {OF}"),
    Form("buses", f"BUS|BUSES IN|FROM {OF}"),
)
SKIPPED = (Form("skip", "[FROM] [BUS] <bus> TO [BUS] <bus> [CIRCUIT|CKT <circuit>]"),)
MOST = 20_000  # contingencies of a statement


class Automatic:
    """The statements of a file that ask for contingencies by subsystem."""

    def __init__(self, outages: Outages, subsystems: Subsystems | None) -> None:
        self.outages, self.case, self.subsystems = outages, outages.case, subsystems
        self.asked: list[tuple[Statement, str, list[Word]]] = []
        self.skipped: set[int] = set()
        self.left_out: list[str] = []  # statements that name a bus that is out of service

    def skip(self, opened: Statement, statements: Iterator[Statement]) -> None:
        """Read the branches of a SKIP ... END block, which are in no automatic contingency. Raises `StudyError`."""
        for statement in statements:
            if statement.ends:
                return
            _, words = understood(statement, SKIPPED)
            with suppress(OutOfService):  # no contingency has it
                ends = [bus(statement, self.case, word) for word in words[:2]]
                self.skipped |= {*circuits(statement, self.case, ends, words[2] if len(words) > 2 else None)}
        raise opened.error("it has no END.")

    def add(self, statement: Statement, kind: str, words: list[Word]) -> None:
        """Ask for the contingencies of a statement."""
        self.asked.append((statement, kind, words))

    def contingencies(self) -> list[Contingency]:
        """The contingencies asked for, each element or pair once. Raises `StudyError`."""
        found: dict[str, list[Contingency]] = {}
        for statement, kind, words in self.asked:
            try:
                several = list(self._combined(statement, kind, words))
            except OutOfService as error:
                self.left_out.append(f"{error}; its contingencies are left out.")
                continue
            if not several:
                raise statement.error("there is nothing of that kind.")
            if len(several) > MOST:
                raise statement.error(f"these are {len(several)} contingencies, more than {MOST}; choose fewer buses.")
            for elements in several:
                name = " and ".join(one.name for one in elements)
                if name not in found:
                    found[name] = self.outages.of(elements, name)
        return [one for several in found.values() for one in several]

    def _combined(self, statement: Statement, kind: str, words: list[Word]) -> Iterator[tuple[Element, ...]]:
        """The elements of a statement, one by one or in pairs."""
        elements = list(self._elements(statement, kind, words[0]))
        order = statement.words[0]
        if order.means("DOUBLE"):
            count = len(elements) * (len(elements) - 1) // 2
            if count > MOST:
                raise statement.error(f"these are {count} contingencies, more than {MOST}; choose fewer buses.")
            yield from combinations(elements, 2)
        elif order.means("BUSDOUBLE"):
            yield from (pair for pair in combinations(elements, 2) if {*pair[0].ends} & {*pair[1].ends})
        elif order.means("PARALLEL"):
            yield from (pair for pair in combinations(elements, 2) if {*pair[0].ends} == {*pair[1].ends})
        else:
            yield from ((one,) for one in elements)

    def _elements(self, statement: Statement, kind: str, word: Word) -> Iterable[Element]:
        if kind == "at":
            at = bus(statement, self.case, word)
            return self._among(lambda ends: at in ends)
        buses = named(statement, word, self.subsystems)
        if kind == "inside":
            return self._among(buses.issuperset)
        if kind == "ties":
            return self._among(lambda ends: 0 < sum(end in buses for end in ends) < len(ends))
        if kind == "machines":
            return (
                one
                for one in self.outages.machines
                if self.outages.seen(self.case.machine(one.machines[0]).bus) in buses
            )
        return (one for one in self.outages.buses if one.at in buses)

    def _among(self, wanted: Callable[[tuple[int, ...]], bool]) -> Iterator[Element]:
        """The branches whose ends are wanted, without those to be skipped."""
        return (one for one in self.outages.branches if wanted(one.ends) and not {*one.rows} & self.skipped)
