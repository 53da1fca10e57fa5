"""Statements of the CON, SUB and MON files of PSS/E: a line of keywords and values, and what a line should be.

A keyword is in any case, and may be cut after its third letter. Text with blanks is in quotes. A line that begins with
COM, / or ! is a comment, and so is what follows a / after a blank. A form is written as the manual of a program would:
"OPEN|TRIP BRANCH FROM BUS <bus> TO BUS <bus> [CIRCUIT <circuit>]", with alternatives, values and what may be left out.
"""

import difflib
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from stabctl._util.errors import CaseError, StudyError, shown
from stabctl._util.wording import near
from stabctl.io import _lexer
from stabctl.model import location, naming
from stabctl.model.case import Case

_WORD = re.compile(r"""'((?:[^']|'(?![\s,]|$))*)'(?=[\s,]|$)|"([^"]*)"(?=[\s,]|$)|([^\s,'"][^\s,]*)""")
_GROUP = re.compile(r"\[([^\[\]]*)\]")
_COMMENT = re.compile(r"\s*(?:[/!]|COM(?:\s|$))", re.IGNORECASE)
SHORTEST = 3  # letters of a keyword
END = "END"


class Word(NamedTuple):
    """A word of a statement."""

    text: str
    quoted: bool = False

    def __str__(self) -> str:
        return f"'{self.text}'" if self.quoted else self.text

    def means(self, keyword: str) -> bool:
        """Whether it is a keyword, or its beginning."""
        text = self.text.upper()
        shortest = SHORTEST + keyword.startswith("BUS")  # BUS is itself, not the beginning of BUSNAMES or BUSDOUBLE
        return not self.quoted and keyword.startswith(text) and len(text) >= min(shortest, len(keyword))


class OutOfService(StudyError):
    """What a statement names is out of service."""


class Statement(NamedTuple):
    """A line of a file that is not empty and no comment."""

    path: Path
    line: int
    words: tuple[Word, ...]

    def error(self, what: str) -> StudyError:
        """The error with a sentence about this line."""
        return StudyError(f"{self.path} line {self.line}, {shown(str(self), 80)}: {what}")

    def refuse_idle(self, case: Case, element: str, ends: Iterable[int] = (), id: str | None = None) -> None:
        """Raise `OutOfService` if an element at these buses, or with this name, is."""
        if said := naming.idle(case, element, ends, id):
            raise OutOfService(str(self.error(f"{said[0].lower()}{said[1:]}")))

    @property
    def ends(self) -> bool:
        """Whether it closes what was opened last."""
        return len(self.words) == 1 and self.words[0].means(END)

    def begins(self, *keywords: str) -> bool:
        """Whether its first word is one of the keywords."""
        return any(self.words[0].means(k) for k in keywords)

    def __str__(self) -> str:
        return " ".join(map(str, self.words))


def read(path: Path) -> Iterator[Statement]:
    """The statements of a file. Raises `StudyError` if it cannot be read, or for a quote that is not closed."""
    try:
        lines = _lexer.lines(path)
    except CaseError as error:
        raise StudyError(str(error)) from None
    for number, line in enumerate(lines, start=1):
        if not line.strip(", \t") or _COMMENT.match(line):
            continue
        statement = Statement(path, number, tuple(_words(line)))
        if re.search("['\"]", _WORD.sub("", _uncommented(line))):
            raise Statement(path, number, (Word(line.strip()),)).error("a quote is not closed.")
        if statement.words:
            yield statement


def nothing_follows(statements: Iterator[Statement]) -> None:
    """Raise `StudyError` for what follows the END of a file; another END does not matter."""
    if after := next((one for one in statements if not one.ends), None):
        raise after.error("nothing may follow the END of the file.")


def _words(line: str) -> Iterator[Word]:
    for single, double, plain in _WORD.findall(line):
        if plain.startswith("/"):
            return
        yield Word(plain) if plain else Word(single or double, True)


def _uncommented(line: str) -> str:
    """A line without the comment at its end."""
    comment = next((m.start() for m in _WORD.finditer(line) if (m[3] or "").startswith("/")), len(line))
    return line[:comment]


class Form:
    """A form of statements."""

    def __init__(self, name: str, written: str) -> None:
        self.name, self.written = name, written
        self.choices = _choices(written)

    def values(self, words: Sequence[Word]) -> "list[Word] | Mismatch":
        """The words in place of the values, in order; or how far the words are of this form, and what it then needs."""
        worst = Mismatch(-1, ())
        for parts in self.choices:
            found = _values(parts, words)
            if isinstance(found, list):
                return found
            if found.at > worst.at:
                worst = found
            elif found.at == worst.at:
                worst = Mismatch(worst.at, (*worst.expected, *found.expected))
        return worst


class Mismatch(NamedTuple):
    """Where words are no longer of a form, and what is expected there."""

    at: int
    expected: tuple[str, ...]


def _choices(written: str) -> list[list[str]]:
    """The parts of a form, with and without each group in brackets."""
    if group := _GROUP.search(written):
        before, after = written[: group.start()], written[group.end() :]
        return _choices(before + group[1] + after) + _choices(before + after)
    return [written.split()]


def _values(parts: Sequence[str], words: Sequence[Word]) -> "list[Word] | Mismatch":
    found = []
    for i, part in enumerate(parts):
        if i == len(words) or not (part.startswith("<") or any(words[i].means(k) for k in part.split("|"))):
            return Mismatch(i, tuple(part.split("|")))
        if part.startswith("<"):
            found.append(words[i])
    return found if len(words) == len(parts) else Mismatch(len(parts), ("the end of the line",))


def understood(statement: Statement, forms: Iterable[Form]) -> tuple[str, list[Word]]:
    """The name of the form that a statement has, and its values. Raises `StudyError` with what is expected."""
    best = Mismatch(-1, ())
    for form in forms:
        found = form.values(statement.words)
        if isinstance(found, list):
            return form.name, found
        if found.at >= best.at:
            same = best.expected if found.at == best.at else ()
            best = Mismatch(found.at, (*same, *found.expected))
    expected = [*dict.fromkeys(best.expected)]
    said = ", ".join(expected[:-1]) + " or " * (len(expected) > 1) + expected[-1]
    if best.at == len(statement.words):
        raise statement.error(f"the line ends too early; {said.replace('<', 'a <', 1)} must follow.")
    word = statement.words[best.at]
    similar = difflib.get_close_matches(word.text.upper(), expected, 1, 0.6)
    hint = f"; did you mean {similar[0]}?" if similar else "."
    raise statement.error(f"{word} is not allowed here; it must be {said}{hint}")


def number(statement: Statement, word: Word) -> float:
    """A finite number. Raises `StudyError`."""
    text = word.text.removesuffix("%")
    if word.quoted or not _lexer.NUMBER.fullmatch(text) or not math.isfinite(value := float(text.replace("D", "e"))):
        raise statement.error(f"{word} is not a number.")
    return value


def bus(statement: Statement, case: Case, word: Word) -> int:
    """The number of a bus, given by its number or name. Raises `StudyError`."""
    found = naming.bus_number(case, word.text)
    if found is None:
        statement.refuse_idle(case, "bus", id=word.text)
        known = (str(b.bus) for b in case.buses)
        raise statement.error(f"{case.name} has no bus {word}; {near(word.text, known)}")
    return found


def circuits(statement: Statement, case: Case, ends: Sequence[int], id: Word | None) -> list[int]:
    """Rows of the branch between two buses, or of the windings of a transformer between three. Raises `StudyError`.

    Without an identifier it is 1. Where the case keeps no identifiers, circuit 2 is the second between the buses.
    """
    wanted = "1" if id is None else id.text.strip()
    if len(ends) == 3:
        return _windings(statement, case, ends, wanted)
    rows = list(case.rows_between.get(frozenset(ends), ()))
    name = "-".join(map(str, ends))
    ids = [case.branches[row].circuit or str(i) for i, row in enumerate(rows, start=1)]
    if wanted not in ids:
        statement.refuse_idle(case, "branch", ends, wanted)
    if not rows or len(set(ends)) < 2:
        there = location.branches_at(case, ends[0])
        raise statement.error(f"{case.name} has no branch {name}; the branches at bus {ends[0]} are {there or 'none'}.")
    if wanted in ids:
        return [rows[ids.index(wanted)]]
    if id is None and len(rows) == 1:
        return rows
    raise statement.error(f"branch {name} of {case.name} has no circuit {wanted}; it has {', '.join(ids)}.")


def _windings(statement: Statement, case: Case, ends: Sequence[int], wanted: str) -> list[int]:
    stars = [b.bus for b in case.buses if {*naming.star(b).split("-")} == {*map(str, ends)}]
    found = [[i for i, k in enumerate(case.branches) if star in (k.from_bus, k.to_bus)] for star in stars]
    rows = next((rows for rows in found if rows and case.branches[rows[0]].circuit == wanted), None)
    if rows is None:
        statement.refuse_idle(case, "branch", ends, wanted)
        raise statement.error(f"{case.name} has no transformer {'-'.join(map(str, ends))} with circuit {wanted}.")
    return rows


def machine(statement: Statement, case: Case, at: int, id: Word) -> int:
    """The number of a machine by its bus and identifier. Raises `StudyError`.

    Where the case keeps no identifiers, machine 2 is the second at the bus.
    """
    found = naming.machine_number(case, f"{at}/{id.text.strip()}")
    here = [m for m in case.machines if m.bus == at or m.name.startswith(f"{at}/")]  # or behind its transformer
    if found is None and not any(m.name for m in here):
        found = next((m.machine for i, m in enumerate(here, start=1) if str(i) == id.text.strip()), None)
    if found is None:
        statement.refuse_idle(case, "machine", id=f"{at}/{id.text.strip()}")
        names = ", ".join(str(m.name or i) for i, m in enumerate(here, start=1))
        raise statement.error(f"{case.name} has no machine {id} at bus {at}; it has {names or 'none there'}.")
    return found
