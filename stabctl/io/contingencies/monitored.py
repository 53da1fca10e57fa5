"""Voltage ranges of a MON file of PSS/E, by bus. What else it monitors is checked, and listed as not used."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from stabctl._util.errors import StudyError
from stabctl._util.wording import listed
from stabctl.model.case import Case

from .statements import Form, Statement, Word, bus, circuits, nothing_follows, number, read, understood
from .subsystems import Subsystems, named

SCOPE = "[ALL] BUSES", "SUBSYSTEM|SYSTEM <name>", "BUS <bus>", "AREA|ZONE|OWNER|KV <number>"
FORMS = (
    *(Form("range", f"MONITOR VOLTAGE RANGE {scope} <low> [<high>]") for scope in SCOPE),
    *(Form("deviation", f"MONITOR VOLTAGE DEVIATION {scope} <down> [<up>]") for scope in SCOPE),
    Form("flows", "MONITOR BRANCHES|LINES|TIES IN|FROM SUBSYSTEM|SYSTEM <name>"),
    Form("block", "MONITOR BRANCHES|LINES"),
    Form("block", "MONITOR INTERFACE <name> [RATING <number> [MW]]"),
)
MEMBER = (Form("branch", "<bus> <bus> [<circuit>]"),)
COLUMNS = {"AREA": "area", "ZONE": "zone", "OWNER": "owner", "KV": "rated"}
UNUSED = {
    "deviation": "voltage deviations after a contingency",
    "flows": "flows of branches, which have no ratings in a case",
    "block": "flows of branches and interfaces, which have no ratings in a case",
}


class Monitored(NamedTuple):
    """What is monitored in normal operation."""

    voltages: Mapping[int, tuple[float, float]]  # bus -> lowest and highest voltage, pu
    unused: tuple[str, ...] = ()  # what the file monitors, too

    def remarks(self) -> list[str]:
        """What is not monitored, in a sentence."""
        return [f"Monitored by the file, but not here: {listed(self.unused)}."] if self.unused else []


def read_mon(path: str | Path, case: Case, subsystems: Subsystems | None = None) -> Monitored:
    """The voltage ranges of a MON file; of several for a bus, the last counts. Raises `StudyError`."""
    ranges: dict[int, tuple[float, float]] = {}
    unused: dict[str, None] = {}
    statements = read(Path(path))
    for statement in statements:
        if statement.ends:
            nothing_follows(statements)
            break
        kind, words = understood(statement, FORMS)
        if kind == "range":
            buses, limits = _scope(statement, case, words, subsystems)
            low, high = limits[0], limits[1] if len(limits) > 1 else float("inf")
            if not 0 <= low < high:
                raise statement.error(f"the range {low:g} to {high:g} pu is empty; give the lower voltage first.")
            ranges |= dict.fromkeys(buses, (low, high))
            continue
        unused[UNUSED[kind]] = None
        if kind == "deviation":
            _scope(statement, case, words, subsystems)
        elif kind == "flows":
            named(statement, words[0], subsystems)
        else:
            _members(statement, statements, case)
    if not ranges and not unused:
        raise StudyError(f"{path} monitors nothing; write MONITOR VOLTAGE RANGE ALL BUSES 0.95 1.05.")
    return Monitored(ranges, tuple(unused))


def _scope(
    statement: Statement, case: Case, words: list[Word], subsystems: Subsystems | None
) -> tuple[frozenset[int], list[float]]:
    """The buses of a statement on voltages, and its limits."""
    of = statement.words[3]
    first = 0 if of.means("ALL") or of.means("BUSES") else 1
    limits = [number(statement, word) for word in words[first:]]
    if not first:
        return frozenset(b.bus for b in case.buses), limits
    if of.means("SUBSYSTEM") or of.means("SYSTEM"):
        return named(statement, words[0], subsystems), limits
    if of.means("BUS"):
        return frozenset((bus(statement, case, words[0]),)), limits
    column = COLUMNS[next(k for k in COLUMNS if of.means(k))]
    value = number(statement, words[0])
    found = frozenset(b.bus for b in case.buses if abs(getattr(b, column) - value) < 1e-6)
    if not found:
        raise statement.error(f"{case.name} has no bus with {of} {words[0]}.")
    return found, limits


def _members(opened: Statement, statements: Iterator[Statement], case: Case) -> None:
    """Check the branches of a block, which ends with END."""
    for statement in statements:
        if statement.ends:
            return
        _, words = understood(statement, MEMBER)
        ends = [bus(statement, case, word) for word in words[:2]]
        circuits(statement, case, ends, words[2] if len(words) > 2 else None)
    raise opened.error("it has no END.")
