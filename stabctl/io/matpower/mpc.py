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

from .._lexer import Place
from .._matlab import CLOSING, Assignment, Code, statements

LEAST = {"bus": 13, "gen": 10, "branch": 11, "dcline": 17}  # columns of a table
_LABELED = {"bus_name": "bus", "genfuel": "gen", "gentype": "gen"}
READ = {*LEAST, "version", "baseMVA", "bus_name", "genfuel", "gentype"}
LIMITS = ("QMAX", "QMIN", "PMAX", "PMIN")  # may be infinite
LARGEST = 1e12  # of a whole number
_HARMLESS = re.compile(r"(?:function\s+mpc\s*=\s*\w+|end|endfunction|return)[;,]?")
_OLD = re.compile(r"function\s*\[")


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
    value = _parsed(scalar)
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
    width, found, parsed = 0, [], _parsed(table)
    if len(parsed) != len(table.rows):  # a quote takes several rows for one text
        bad = next((row for row in table.rows if {*row.text} & {*"'\""}), table.rows[0])
        raise bad.place.error(f"{shown(bad.text.strip())} is not a row of numbers.")
    for row, values in zip(table.rows, parsed, strict=True):
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
    texts = [row.text.strip().strip("'\"").replace("''", "'").strip() for row in cells.rows]
    if cells.opening != "{" or len(texts) != rows:
        raise cells.place.error(f"mpc.{cells.name} must contain {rows} texts in braces, one for each row of its table.")
    return texts


def assignments(path: Path) -> dict[str, Assignment]:
    """The assignments of a file by name. Raises `CaseError` with the line for anything else in it."""
    found: dict[str, Assignment] = {}
    for made in statements(path, "mpc."):
        if isinstance(made, Code):
            if not _HARMLESS.fullmatch(made.text):
                raise _refused(made.place, made.text)
        elif made.name in found:
            text = f"mpc.{made.name} is assigned again, first in line {found[made.name].place.line}."
            raise made.place.error(text)
        else:
            found[made.name] = made
    return found


def _parsed(assigned: Assignment) -> list[list[int | float | str]]:
    """The rows as `matpowercaseframes` reads them; what is no number remains text."""
    closing = CLOSING.get(assigned.opening, "")
    body = "\n".join(row.text for row in assigned.rows)
    text = f"{assigned.opening}\n{body}\n{closing}" if closing else body
    return reader.parse_file(assigned.name, f"mpc.{assigned.name} = {text};") or []


def _refused(place: Place, text: str) -> Exception:
    if _OLD.match(text.strip()):
        return place.error("this is a file of MATPOWER version 1; load and save it in MATPOWER (loadcase, savecase).")
    return place.error(
        f"{shown(text.strip())} is not data but code, which is not run; save the case with MATPOWER's savecase."
    )
