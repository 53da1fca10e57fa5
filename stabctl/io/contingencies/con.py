"""Contingencies of a CON file of PSS/E.

The file says what is lost, and not why. Here a fault causes it: a bolted three-phase one at each end of the first
branch (two contingencies), at a bus that is disconnected, at the high side of a machine that is removed, or at the bus
of a load or shunt. When the fault is cleared, everything that the statement names is lost at once.
"""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from stabctl._util.errors import StudyError, is_line
from stabctl._util.wording import listed
from stabctl.devices.loads import zip_load
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.events import Event, LoadStep, SwitchShunt
from stabctl.simulation.outage import Outages

from .automatic import AUTOMATIC, Automatic
from .statements import (
    Form,
    OutOfService,
    Statement,
    Word,
    bus,
    circuits,
    machine,
    nothing_follows,
    number,
    read,
    understood,
)
from .subsystems import Subsystems

OPEN = "OPEN|TRIP|DISCONNECT|REMOVE"
CIRCUIT = "[CIRCUIT|CKT <circuit>]"
FORMS = (
    Form("branch", f"{OPEN} BRANCH|LINE FROM BUS <bus> TO [BUS] <bus> {CIRCUIT}"),
    Form("transformer", f"{OPEN} BRANCH|LINE FROM BUS <bus> TO [BUS] <bus> TO [BUS] <bus> {CIRCUIT}"),
    Form("transformer", f"{OPEN} THREEWINDING AT BUS <bus> TO [BUS] <bus> TO [BUS] <bus> {CIRCUIT}"),
    Form("bus", f"{OPEN} BUS <bus>"),
    Form("machine", f"{OPEN} MACHINE|UNIT <id> FROM BUS <bus>"),
    Form("load", f"{OPEN} LOAD [<id>] FROM BUS <bus>"),
    Form("shunt", f"{OPEN} SHUNT|SWSHUNT [<id>] FROM BUS <bus>"),
    Form("set", "SET BUS <bus> LOAD|SHUNT|GENERATION TO <number> MW|MVAR|PERCENT"),
    Form("change", "CHANGE|ALTER|MODIFY BUS <bus> LOAD|SHUNT|GENERATION BY <number> MW|MVAR|PERCENT"),
    Form("increase", "INCREASE|RAISE BUS <bus> LOAD|SHUNT|GENERATION BY <number> MW|MVAR|PERCENT"),
    Form("decrease", "DECREASE|REDUCE BUS <bus> LOAD|SHUNT|GENERATION BY <number> MW|MVAR|PERCENT"),
)
UNREPRESENTED = {
    "CLOSE": "a branch that is not in service is not in the case, so it cannot be closed",
    "ADD": "what is not in service is not in the case, so it cannot be added",
    "MOVE": "load and generation cannot be moved",
    "BLOCK": "HVDC links cannot be blocked",
    "DISPATCH": "generation is not dispatched again",
    "DEFAULT": "generation is not dispatched again",
    "BUSNAMES": "buses are given by number or name without it; remove the line",
    "BUSNUMBERS": "buses are given by number or name without it; remove the line",
}


class Contingencies(tuple[Contingency, ...]):
    """Contingencies of a file.

    Attributes
    ----------
    left_out : tuple of str
        A sentence about each that is left out, because it names something that is out of service.
    """

    left_out: tuple[str, ...]

    def __new__(cls, found: Iterable[Contingency], left_out: Iterable[str] = ()) -> "Contingencies":
        """The contingencies, and the sentences."""
        new = super().__new__(cls, found)
        new.left_out = tuple(left_out)
        return new


def read_con(path: str | Path, case: Case, subsystems: Subsystems | None = None) -> Contingencies:
    """The contingencies of a CON file, without clearing times, those of its blocks before the automatic ones.

    Raises `StudyError` with file, line and text of the first mistake, and for a statement that is not represented:
    nothing of a file is left out in silence.
    """
    path, outages = Path(path), Outages(case)
    found, left_out = list[Contingency](), list[str]()
    automatic, named = Automatic(outages, subsystems), dict[str, int]()
    statements = read(path)
    for statement in statements:
        if statement.begins("CONTINGENCY"):
            if len(statement.words) != 2:
                raise statement.error("it must be CONTINGENCY and a name, in quotes if the name has blanks.")
            name = statement.words[1].text.strip()
            if not is_line(name):
                raise statement.error("the name must be one line of text without control characters.")
            if name in named:
                raise statement.error(f"line {named[name]} has a contingency of this name, too; give it another one.")
            named[name] = statement.line
            block = _Block(outages, name, statement)
            found += block.read(statements)
            left_out += filter(None, [block.idle])
        elif statement.ends:
            nothing_follows(statements)
        elif statement.begins("SKIP") and len(statement.words) == 1:
            automatic.skip(statement, statements)
        else:
            automatic.add(statement, *_represented(statement, (Form("block", "CONTINGENCY <name>"), *AUTOMATIC)))
    found += automatic.contingencies()
    left_out += automatic.left_out
    if not found and left_out:
        raise StudyError(f"{path}: all contingencies name something that is out of service: {left_out[0]}")
    if not found:
        raise StudyError(
            f"{path} has no contingencies; write CONTINGENCY 'name', OPEN BRANCH FROM BUS 7 TO BUS 8 and END."
        )
    return Contingencies(found, left_out)


def _represented(statement: Statement, forms: Iterable[Form]) -> tuple[str, list[Word]]:
    """The form of a statement, and its values. Raises `StudyError`, with the reason if it is only not represented."""
    try:
        return understood(statement, forms)
    except StudyError:
        for keyword, why in UNREPRESENTED.items():
            if statement.begins(keyword) or (keyword == "DISPATCH" and statement.words[-1].means(keyword)):
                raise statement.error(f"{keyword} is not represented, because {why}.") from None
        raise


class _Block:
    """The statements from CONTINGENCY to END."""

    def __init__(self, outages: Outages, name: str, opened: Statement) -> None:
        self.outages, self.case, self.name, self.opened = outages, outages.case, name, opened
        self.faults: tuple[int, ...] = ()
        self.branches: list[int] = []
        self.machines: list[int] = []
        self.after: list[Event] = []
        self.taken: set[tuple[str, int]] = set()  # branches, machines, loads and shunts that are named
        self.idle = ""  # what it names that is out of service, in a sentence
        self.first = ""  # what kind the first element is

    def read(self, statements: Iterator[Statement]) -> list[Contingency]:
        """The contingencies of the block. Raises `StudyError`."""
        for statement in statements:
            if statement.ends:
                return self._contingencies()
            if statement.begins("CONTINGENCY"):
                raise statement.error(f"contingency '{self.name}' of line {self.opened.line} has no END before it.")
            try:
                self._take(statement)
            except OutOfService as error:
                self.idle = self.idle or f"{error}; contingency '{self.name}' is left out."
        raise self.opened.error("it has no END.")

    def _contingencies(self) -> list[Contingency]:
        if self.idle:
            return []
        if not self.faults:
            raise self.opened.error("nothing is lost; write OPEN BRANCH FROM BUS 7 TO BUS 8 before the END.")
        several = self.first in ("branch", "transformer")
        return [
            self.outages.contingency(
                fault,
                self.branches,
                self.machines,
                name=f"{self.name}, fault at bus {fault}" if several else self.name,
                after=self.after,
            )
            for fault in self.faults
        ]

    def _take(self, statement: Statement) -> None:
        kind, words = _represented(statement, FORMS)
        self.first = self.first or kind
        step: dict[str, Callable[[Statement, list[Word]], tuple[int, ...]]] = {
            "branch": self._branch,
            "transformer": self._branch,
            "bus": self._bus,
            "machine": self._machine,
            "load": self._load,
            "shunt": self._shunt,
        }
        at = step[kind](statement, words) if kind in step else self._changed(kind, statement, words)
        self.faults = self.faults or at

    def _branch(self, statement: Statement, words: list[Word]) -> tuple[int, ...]:
        count = 3 if sum(word.means("TO") for word in statement.words if not word.quoted) > 1 else 2
        ends = tuple(bus(statement, self.case, word) for word in words[:count])
        rows = circuits(statement, self.case, ends, words[count] if len(words) > count else None)
        self._take_once(statement, "branch", rows)
        self.branches += rows
        return ends

    def _bus(self, statement: Statement, words: list[Word]) -> tuple[int, ...]:
        at = bus(statement, self.case, words[0])
        self.branches += self.outages.beside[at]
        self.machines += (m.machine for m in self.case.machines if m.bus == at)
        return (at,)

    def _machine(self, statement: Statement, words: list[Word]) -> tuple[int, ...]:
        number = machine(statement, self.case, bus(statement, self.case, words[1]), words[0])
        self._take_once(statement, "machine", [number])
        self.machines.append(number)
        return (self.case.machine(number).storage_bus,)

    def _load(self, statement: Statement, words: list[Word]) -> tuple[int, ...]:
        at = bus(statement, self.case, words[-1])
        ids = [*dict.fromkeys(id for _, id in naming.loads_at(self.case, at))]
        wanted = words[0].text.strip() if len(words) > 1 else ""
        if not ids or wanted not in ("", *ids):
            statement.refuse_idle(self.case, "load", [at], wanted or None)
            what = f"load {words[0]}" if wanted else "load"
            raise statement.error(f"{self.case.name} has no {what} at bus {at}; it has {listed(ids) or 'none there'}.")
        return self._step(statement, at, wanted if len(ids) > 1 else "", -1.0)

    def _drawn(self, at: int, id: str = "") -> complex:
        """What the loads at a bus, or the one with an identifier, draw in the power flow (MVA)."""
        V = self.outages.voltage[self.case.row_of_bus[at]]
        return sum((zip_load.drawn(self.case.loads[row], V) for row, _ in naming.loads_at(self.case, at, id)), 0j)

    def _shunt(self, statement: Statement, words: list[Word]) -> tuple[int, ...]:
        """The shunt of a bus, which is one in a case, whichever of the shunts of a file is named."""
        at = bus(statement, self.case, words[-1])
        row = self.case.buses[self.case.row_of_bus[at]]
        if len(words) > 1 and statement.words[1].means("SHUNT"):
            statement.refuse_idle(self.case, "shunt", [at], words[0].text.strip())
        if not (row.g or row.b):
            statement.refuse_idle(self.case, "shunt", [at])
            raise statement.error(f"{self.case.name} has no shunt at bus {at}.")
        gone = SwitchShunt(at, 0.0, -row.g, -row.b)
        return (at,) if gone in self.after else self._switch(statement, at, gone)

    def _changed(self, kind: str, statement: Statement, words: list[Word]) -> tuple[int, ...]:
        """A load or shunt that is set to a value or changed by one, at constant power factor."""
        at, value = bus(statement, self.case, words[0]), number(statement, words[1])
        what, unit = statement.words[3], statement.words[-1]
        if what.means("GENERATION"):
            raise statement.error("GENERATION is not represented, because generation is not dispatched again.")
        row = self.case.buses[self.case.row_of_bus[at]]
        of_load = what.means("LOAD")
        size = self._drawn(at).real if of_load else row.b
        if not size:
            statement.refuse_idle(self.case, "load" if of_load else "shunt", [at])
        if not size or (not unit.means("PERCENT") and unit.means("MW") != of_load):
            raise statement.error(
                f"it needs a {'load with active power' if of_load else 'shunt'} at the bus, and "
                f"{'MW' if of_load else 'MVAR'} or PERCENT."
            )
        share = value / 100 if unit.means("PERCENT") else value / size
        share = {"set": share - 1, "decrease": -share}.get(kind, share)
        if not share or (of_load and share < -1):
            raise statement.error("it changes nothing." if not share else f"only {abs(size):g} can be taken away.")
        if of_load:
            return self._step(statement, at, "", share)
        return self._switch(statement, at, SwitchShunt(at, 0.0, 0.0, share * row.b))

    def _step(self, statement: Statement, at: int, id: str, share: float) -> tuple[int, ...]:
        """Change the loads at a bus, or the one with an identifier, by a share of themselves."""
        self._take_once(statement, "load", [row for row, _ in naming.loads_at(self.case, at, id)])
        change = share * self._drawn(at, id)
        if not change:
            raise statement.error("it changes nothing.")
        self.after.append(LoadStep(at, 0.0, change.real, change.imag, id))
        return (at,)

    def _switch(self, statement: Statement, at: int, event: SwitchShunt) -> tuple[int, ...]:
        self._take_once(statement, "shunt", [at])
        self.after.append(event)
        return (at,)

    def _take_once(self, statement: Statement, what: str, which: Iterable[int]) -> None:
        """Raise `StudyError` if an element is named above, too."""
        if self.taken & (new := {(what, one) for one in which}):
            raise statement.error(f"the {what} is named above, too; remove one of the statements.")
        self.taken |= new
