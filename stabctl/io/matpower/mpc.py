"""A MATPOWER file: its assignments, and its tables as records, each value checked.

A file that holds code is refused: nothing is run. `matpowercaseframes` searches the text for `mpc.bus = [ ... ];` and
passes over everything else, also over a line that changes the data afterwards. It is therefore given one assignment at
a time, comments removed, a row to a line, after a check that the file holds nothing but assignments of data.

Columns are named as in MATPOWER's manual, appendix B, and in `matpowercaseframes`; only those that are used are here.
"""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from matpowercaseframes import reader
from matpowercaseframes.constants import COLUMNS

from stabctl._util.errors import CaseError, shown

from .._lexer import Place, lines

LEAST = {"bus": 13, "gen": 10, "branch": 11, "dcline": 17}  # columns of a table
_LABELED = {"bus_name": "bus", "genfuel": "gen", "gentype": "gen"}
READ = {*LEAST, "version", "baseMVA", "bus_name", "genfuel", "gentype"}
LIMITS = ("QMAX", "QMIN", "PMAX", "PMIN")  # may be infinite
LARGEST = 1e12  # of a whole number
_ASSIGNMENT = re.compile(r"\s*mpc\.([A-Za-z]\w*(?:\.[A-Za-z]\w*)*)\s*=\s*")
_HARMLESS = re.compile(r"(?:function\s+mpc\s*=\s*\w+|end|endfunction|return)[;,]?")
_OLD = re.compile(r"function\s*\[")
_PIECE = re.compile(r"""'(?:[^'\n]|'')*'|"[^"\n]*"|\.\.\.|(?:[^'"%;,=()\[\]{}.]|\.(?!\.\.))+|.""", re.DOTALL)
_SCALAR = re.compile(r"""\s*('(?:[^'\n]|'')*'|"[^"\n]*"|[^\s;,'"]+)\s*(?:[;,]|$)""")
_CLOSING = {"[": "]", "{": "}"}


class Bus(NamedTuple):
    """A bus with its demand (MW, Mvar), its shunt (MW, Mvar at 1 pu) and its stored voltage (pu, deg)."""

    BUS_I: int
    BUS_TYPE: int
    PD: float
    QD: float
    GS: float
    BS: float
    BUS_AREA: int
    VM: float
    VA: float
    BASE_KV: float
    ZONE: int


class Gen(NamedTuple):
    """A generator: power and its limits (MW, Mvar), voltage (pu), rating (MVA), status."""

    GEN_BUS: int
    PG: float
    QG: float
    QMAX: float
    QMIN: float
    VG: float
    MBASE: float
    GEN_STATUS: float
    PMAX: float
    PMIN: float


class Branch(NamedTuple):
    """A branch: impedance and charging (pu), turns ratio (0: a line), phase shift (deg), status."""

    F_BUS: int
    T_BUS: int
    BR_R: float
    BR_X: float
    BR_B: float
    TAP: float
    SHIFT: float
    BR_STATUS: float


class DcLine(NamedTuple):
    """A DC line: status, power into it (MW), reactive power produced at both ends (Mvar), losses (MW, share)."""

    F_BUS: int
    T_BUS: int
    BR_STATUS: float
    PF: float
    QF: float
    QT: float
    LOSS0: float
    LOSS1: float


RECORDS: dict[str, type] = {"bus": Bus, "gen": Gen, "branch": Branch, "dcline": DcLine}


class Row(NamedTuple):
    """A row of a matrix, as text, and its line in the file."""

    text: str
    place: Place


class Assignment(NamedTuple):
    """`mpc.name = value`: the rows of a matrix or a cell array, or one row for a scalar."""

    name: str
    place: Place
    opening: str  # [, { or nothing
    rows: list[Row]

    def parsed(self) -> list[list[int | float | str]]:
        """The rows as `matpowercaseframes` reads them; what is no number remains text."""
        closing = _CLOSING.get(self.opening, "")
        body = "\n".join(row.text for row in self.rows)
        text = f"mpc.{self.name} = {self.opening}\n{body}\n{closing};" if closing else f"mpc.{self.name} = {body};"
        return reader.parse_file(self.name, text) or []

    def strings(self) -> list[str]:
        """The quoted texts of a cell array, one for each row."""
        return [row.text.strip().strip("'\"").replace("''", "'").strip() for row in self.rows]


class Mpc(NamedTuple):
    """What a MATPOWER file holds."""

    path: Path
    base_mva: float
    tables: dict[str, list[tuple[Any, Place]]]  # records and their places
    labels: dict[str, list[str]]  # bus_name, genfuel, gentype: a text for each row of its table
    unread: dict[str, Place]  # names that are not represented

    def of(self, table: str) -> Iterator[tuple[Any, Place]]:
        """The records of a table with their places."""
        return iter(self.tables.get(table, ()))


def read(path: Path) -> Mpc:
    """The tables of a MATPOWER file. Raises `CaseError` with line and field for the first mistake."""
    found = assignments(path)
    if "version" in found and found["version"].rows[0].text.strip("'\"") != "2":
        text = f"{shown(found['version'].rows[0].text)} is not supported; it must be '2'."
        raise found["version"].place.error(text, "version")
    for name in ("baseMVA", "bus", "gen", "branch"):
        if name not in found:
            raise CaseError(f"{path}: there is no mpc.{name}; a MATPOWER case has baseMVA, bus, gen and branch.")
    tables = {name: _records(found[name]) for name in LEAST if name in found}
    labels = {name: _labels(found[name], len(tables[of])) for name, of in _LABELED.items() if name in found}
    unread = {name: assigned.place for name, assigned in found.items() if name not in READ}
    return Mpc(path, _base(found["baseMVA"]), tables, labels, unread)


def _base(scalar: Assignment) -> float:
    value = scalar.parsed()
    if scalar.opening or len(value) != 1 or len(value[0]) != 1 or not scalar.rows[0].text.isascii():
        raise scalar.place.error("it must be a number.", "baseMVA")
    base = _number(value[0][0], scalar.place, "baseMVA")
    if not base > 0:
        raise scalar.place.error(f"{base:g} MVA is not allowed; it must be more than 0.", "baseMVA")
    return base


def _records(table: Assignment) -> list[tuple[Any, Place]]:
    """The rows of a table as records."""
    if table.opening != "[":
        raise table.place.error("it must be a matrix, in square brackets.", table.name)
    record, columns = RECORDS[table.name], COLUMNS[table.name]
    kinds = [(name, columns.index(name), record.__annotations__[name] is int) for name in record._fields]  # type: ignore[attr-defined]
    width, found = 0, []
    for row, values in zip(table.rows, table.parsed(), strict=True):
        width = width or len(values)
        if len(values) != width or width < LEAST[table.name]:
            least = width if width >= LEAST[table.name] else f"at least {LEAST[table.name]}"
            raise row.place.error(f"the row has {len(values)} columns; a row of mpc.{table.name} needs {least}.")
        if not row.text.isascii() or "_" in row.text:
            raise row.place.error(f"{shown(row.text.strip())} is not a row of numbers.")
        cells = [
            (_whole if whole else _number)(values[i] if i < width else 0, row.place, name) for name, i, whole in kinds
        ]
        found.append((record(*cells), row.place))
    return found


def _number(value: Any, place: Place, field: str) -> float:
    if isinstance(value, str):
        raise place.error(f"{shown(value)} is not a number.", field)
    if math.isnan(value) or (math.isinf(value) and field not in LIMITS):
        raise place.error(f"{value} is not allowed; it must be finite.", field)
    return float(value)


def _whole(value: Any, place: Place, field: str) -> int:
    number = _number(value, place, field)
    if not (number == int(number) and abs(number) < LARGEST):
        raise place.error(f"{shown(value)} is not a whole number.", field)
    return int(number)


def _labels(cells: Assignment, rows: int) -> list[str]:
    """The texts of a cell array, one for each row of a table."""
    texts = cells.strings()
    if cells.opening != "{" or len(texts) != rows:
        raise cells.place.error(f"mpc.{cells.name} must contain {rows} texts in braces, one for each row of its table.")
    return texts


def assignments(path: Path) -> dict[str, Assignment]:
    """The assignments of a file by name. Raises `CaseError` with the line for anything else in it."""
    found: dict[str, Assignment] = {}
    code = _code(path)
    for place, text in code:
        rest = text
        while rest.strip(" \t;,"):
            match = _ASSIGNMENT.match(rest)
            if match is None:
                if _HARMLESS.fullmatch(rest.strip()):
                    break
                raise _refused(place, rest)
            rest = rest[match.end() :]
            made, rest = _value(match[1], place, rest, code)
            if made.name in found:
                raise place.error(f"mpc.{made.name} is assigned again, first in line {found[made.name].place.line}.")
            found[made.name] = made
    return found


def _code(path: Path) -> Iterator[tuple[Place, str]]:
    """The lines of the file without comments. Raises `CaseError` for a block comment that is not closed."""
    blocks: list[Place] = []  # where those that are open begin
    for i, line in enumerate(lines(path), 1):
        marker = line.strip()
        if marker == "%{":
            blocks.append(Place(path, i))
        elif marker == "%}":
            del blocks[-1:]
        elif not blocks:
            yield Place(path, i), _without_comment(line)
    if blocks:
        raise blocks[0].error("the block comment %{ is not closed; write %} on a line of its own after it.")


def _without_comment(line: str) -> str:
    if "%" not in line:
        return line
    for piece in _PIECE.finditer(line):
        if piece[0] == "%":
            return line[: piece.start()]
    return line


def _value(name: str, place: Place, rest: str, code: Iterator[tuple[Place, str]]) -> tuple[Assignment, str]:
    """The assignment of the value that begins with the text, and what follows on its last line."""
    opening = rest[:1]
    if opening not in _CLOSING:
        match = _SCALAR.match(rest)
        if match is None:
            raise _refused(place, f"mpc.{name} = {rest}")
        return Assignment(name, place, "", [Row(match[1], place)]), rest[match.end() :]
    made = Assignment(name, place, opening, [])
    begun, at, rest, here = "", place, rest[1:], place
    while True:
        for piece in _PIECE.finditer(rest):
            c = piece[0]
            if c == _CLOSING[opening] or c == ";":
                if begun.strip():
                    made.rows.append(Row(begun, at))
                begun = ""
                if c != ";":
                    return made, _end(here, rest[piece.end() :])
            elif c == "...":
                break
            elif c in "[]{}=()":
                raise here.error(f"{c!r} is not allowed within mpc.{name}; it must contain data only.")
            else:
                at = at if begun.strip() else here
                begun += " " if c == "," else _plain(c)
        else:
            if begun.strip():
                made.rows.append(Row(begun, at))
            begun = ""
        following = next(code, None)
        if following is None:
            raise place.error(f"mpc.{name} is not closed by {_CLOSING[opening]!r}.")
        here, rest = following
        if _ASSIGNMENT.match(rest):
            raise place.error(f"mpc.{name} is not closed by {_CLOSING[opening]!r} before line {here.line}.")


def _plain(piece: str) -> str:
    """A piece of a row without what `matpowercaseframes` takes for a comment or the end of a row."""
    return "".join(c if c.isprintable() and c not in "%;" else " " for c in piece)


def _end(place: Place, rest: str) -> str:
    """What follows a bracket, which must be the end of the statement."""
    text = rest.lstrip()
    if text and text[0] not in ";,":
        raise _refused(place, rest)
    return text


def _refused(place: Place, text: str) -> Exception:
    if _OLD.match(text.strip()):
        return place.error("this is a file of MATPOWER version 1; load and save it in MATPOWER (loadcase, savecase).")
    return place.error(
        f"{shown(text.strip())} is not data but code, which is not run; save the case with MATPOWER's savecase."
    )
