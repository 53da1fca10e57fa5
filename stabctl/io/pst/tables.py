"""A data file of the Power System Toolbox (PST, PSTess): its matrices, evaluated from a few kinds of statements.

    bus = [ ... ];   lmon_con = [1:14]';            numbers, products and quotients of numbers, ranges
    bus(:,4:7) = bus(:,4:7)/100;                    columns: the same columns times or over a number, other columns, a
    mac_con(:,20:21) = zeros(16,2);                 number, zeros or ones
    mac_con([1,3],:) = [];                          rows that are removed
    ibus_con = zeros(10,1);   ibus_con(10) = 1;     zeros or ones, as long as mac_con if that is named; an element
    gov_flag = true;   if ~gov_flag ... end         a number, and what is left out because of it

Nothing is run. A statement of another kind is refused if it may change a matrix that is read, and otherwise listed.
"""

import re
from pathlib import Path
from typing import NamedTuple

from stabctl._util.errors import CaseError, shown

from .._lexer import Place
from .._matlab import Assignment, Code, statements

LEAST = {  # matrices that are read, and the columns that a row needs
    "bus": 10, "line": 7, "mac_con": 16, "exc_con": 9, "pss_con": 8, "tg_con": 10, "load_con": 5, "ibus_con": 1,
    "sw_con": 6,
}  # fmt: skip
LARGEST = 100_000  # elements that zeros and ones make
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?"
_CELL = re.compile(rf"{_NUMBER}(?:[*/]{_NUMBER})*", re.ASCII)
_RANGE = re.compile(rf"({_NUMBER}):({_NUMBER})", re.ASCII)
_FACTOR = rf"(?:\s*([*/])\s*({_NUMBER}))?"
_TARGET = re.compile(r"([A-Za-z]\w*)\s*(?:[({][^=]*[)}])?\s*=(?!=)\s*(.*?)[;,\s]*", re.ASCII | re.DOTALL)
_COLUMNS = re.compile(r"([A-Za-z]\w*)\s*\(\s*:\s*,\s*(\d+)\s*(?::\s*(\d+)\s*)?\)", re.ASCII)
_ELEMENT = re.compile(r"([A-Za-z]\w*)\s*\(\s*(\d+)\s*(?:,\s*(\d+)\s*)?\)", re.ASCII)
_ROWS = re.compile(r"([A-Za-z]\w*)\s*\(\s*(?:(\d+)|\[([\d\s,]+)\])\s*,\s*:\s*\)", re.ASCII)
_FILLED = re.compile(rf"(zeros|ones)\s*\((.*)\){_FACTOR}", re.ASCII)
_FLAG = re.compile(r"if\s*\(?\s*([~!]?)\s*([A-Za-z]\w*)\s*\)?\s*[;,]?", re.ASCII)
_HARMLESS = re.compile(r"(?:disp|fprintf|warning|clear|close|clc|format|global|return|cd|cdps|addpath)\b.*", re.DOTALL)


class Row(NamedTuple):
    """A row of a matrix and its line in the file."""

    values: list[float]
    place: Place


class Pst(NamedTuple):
    """What a PST file holds."""

    path: Path
    tables: dict[str, list[Row]]
    scalars: dict[str, float]
    unread: dict[str, Place]  # what is assigned to names that are not read

    def of(self, table: str) -> list[Row]:
        """The rows of a matrix; none if there is none."""
        return self.tables.get(table, [])


def read(path: Path) -> Pst:
    """The matrices of a PST file. Raises `CaseError` with the line for the first mistake."""
    found = Pst(path, {}, {}, {})
    inside: list[bool] = []  # of the `if` around a line: whether it applies
    last = ""  # name of the matrix before
    for one in statements(path, "", LEAST):
        if isinstance(one, Code) and _branch(one, found, inside):
            continue
        if not all(inside):
            continue
        if isinstance(one, Assignment):
            _assign(one, found)
            last = one.name
        elif one.text.rstrip("; ") == "'" and (last == "ibus_con" or last not in LEAST):
            continue  # a vector
        elif not _HARMLESS.fullmatch(one.text):
            _evaluate(one, found)
    if inside:
        raise CaseError(f"{path}: an if is not closed by end.")
    for name in ("bus", "line", "mac_con"):
        if not found.of(name):
            raise CaseError(f"{path}: there is no {name}; a PST file has bus, line and mac_con.")
    return found


def _branch(one: Code, found: Pst, inside: list[bool]) -> bool:
    """Whether a line is that of an `if` whose condition is known, of its `else`, or of its `end`."""
    if match := _FLAG.fullmatch(one.text):
        negated, name = match.groups()
        if all(inside) and name not in found.scalars:
            raise _refused(one)
        inside.append(bool(found.scalars.get(name)) != bool(negated))
    elif inside and (word := one.text.rstrip(";, ")) in ("else", "end"):
        last = inside.pop()
        if word == "else":
            inside.append(not last)
    else:
        return False
    return True


def _assign(one: Assignment, found: Pst) -> None:
    """Keep a matrix or a scalar."""
    if one.opening == "[" and one.name in LEAST:
        found.tables[one.name] = [
            Row(values, row.place) for row in one.rows for values in _values(row.text, row.place, one.name, found)
        ]
        _check_width(one, found.tables[one.name])
        return
    text = one.rows[0].text.lower() if not one.opening else ""
    if text in ("true", "false") or _CELL.fullmatch(text):
        found.scalars[one.name] = float(text == "true") if text in ("true", "false") else _number(text, one.place)
    elif one.name in LEAST:
        raise _refused(Code(f"{one.name} = {text or one.opening}", one.place))
    elif one.opening != "[" or one.rows:  # an empty matrix says that there is nothing
        found.unread[one.name] = one.place


def _check_width(one: Assignment, rows: list[Row]) -> None:
    for row in rows:
        if len(row.values) != len(rows[0].values) or len(row.values) < LEAST[one.name]:
            wanted = len(rows[0].values)
            least = wanted if wanted >= LEAST[one.name] else f"at least {LEAST[one.name]}"
            raise row.place.error(f"the row has {len(row.values)} columns; a row of {one.name} needs {least}.")


def _values(text: str, place: Place, name: str, known: Pst) -> list[list[float]]:
    """The numbers of a row; a list of flags is a row for each."""
    found: list[float] = []
    for cell in re.sub(r"\s*([*/:])\s*", r"\1", text).split():
        if span := _RANGE.fullmatch(cell):
            low, high = (_number(end, place) for end in span.groups())
            if not 0 <= high - low < LARGEST:
                raise place.error(f"{shown(cell)} is not a range that is read.", name)
            found += [low + k for k in range(int(high - low) + 1)]
        elif _CELL.fullmatch(cell):
            found.append(_number(cell, place))
        elif cell in known.scalars:
            found.append(known.scalars[cell])
        else:
            raise place.error(f"{shown(cell)} is not a number.", name)
    return [[value] for value in found] if name == "ibus_con" else [found] if found else []


def _number(text: str, place: Place) -> float:
    """A number, or a product or quotient of numbers."""
    first, *rest = re.split(r"([*/])", text.replace("d", "e").replace("D", "e"))
    value = float(first)
    for sign, other in zip(rest[::2], map(float, rest[1::2]), strict=True):
        if sign == "/" and other == 0:
            raise place.error(f"{shown(text)} is divided by zero.")
        value = value / other if sign == "/" else value * other
    if not abs(value) < 1e300:
        raise place.error(f"{shown(text)} is not a finite number.")
    return value


def _evaluate(one: Code, found: Pst) -> None:
    """Change columns or an element of a matrix. Raises `CaseError` for what is not understood, if it may matter."""
    match = _TARGET.fullmatch(one.text)
    if match is None:
        if re.match(r"load\b", one.text):
            found.unread.setdefault(one.text.rstrip("; "), one.place)
            return
        raise _refused(one)
    name, value = match.groups()
    target = one.text[: match.start(2)].rstrip("= \t")
    if name not in LEAST:
        found.unread.setdefault(name, one.place)
    elif target == name and (filled := _FILLED.fullmatch(value)):
        found.tables[name] = [Row([_fill(filled, one)], one.place) for _ in range(_count(filled[2], found, one))]
    elif (removed := _ROWS.fullmatch(target)) and value == "[]" and name in found.tables:
        gone = {int(number) for number in re.findall(r"\d+", removed[2] or removed[3])}
        if not all(1 <= number <= len(found.tables[name]) for number in gone):
            raise one.place.error(f"{shown(target)} are not rows of {name}.")
        found.tables[name] = [row for k, row in enumerate(found.tables[name], 1) if k not in gone]
    elif (columns := _COLUMNS.fullmatch(target)) and name in found.tables:
        _set_columns(_span(columns, one), value, found.tables[name], one)
    elif (element := _ELEMENT.fullmatch(target)) and _CELL.fullmatch(value) and name in found.tables:
        row, column = (int(element[2]), int(element[3] or 1)) if element[3] or name == "ibus_con" else (0, 0)
        rows = found.tables[name]
        if not (1 <= row <= len(rows) and 1 <= column <= len(rows[row - 1].values)):
            raise one.place.error(f"{shown(target)} is not an element of {name}.")
        rows[row - 1].values[column - 1] = _number(value, one.place)
    else:
        raise _refused(one)


def _span(columns: re.Match[str], one: Code) -> range:
    low, high = int(columns[2]), int(columns[3] or columns[2])
    if not 1 <= low <= high < 100:
        raise one.place.error(f"{shown(columns[0])} are not columns that a matrix has.")
    return range(low - 1, high)


def _given(value: str, one: Code) -> tuple[range | None, float]:
    """What a statement gives columns: those that it copies, with their factor, or no columns and a number."""
    if _CELL.fullmatch(value):
        return None, _number(value, one.place)
    if filled := _FILLED.fullmatch(value):
        return None, _fill(filled, one)
    match = re.fullmatch(rf"(.*?\)){_FACTOR}", value)
    source = _COLUMNS.fullmatch(match[1]) if match else None
    if match is None or source is None or source[1] != one.text[: len(source[1])]:
        raise _refused(one)
    return _span(source, one), _factor(match[2], match[3], one)


def _set_columns(places: range, value: str, rows: list[Row], one: Code) -> None:
    """Give columns their values; new ones may follow the last."""
    source, number = _given(value, one)
    for row in rows:
        copied = [row.values[i] * number for i in source if i < len(row.values)] if source else [number] * len(places)
        if len(copied) != len(places) or places.start > len(row.values):
            raise one.place.error(f"{shown(one.text)} does not fit a row of {len(row.values)} columns.")
        row.values[places.start : places.stop] = copied


def _fill(filled: re.Match[str], one: Code) -> float:
    return float(filled[1] == "ones") * _factor(filled[3], filled[4], one)


def _factor(sign: str | None, number: str | None, one: Code) -> float:
    return _number(f"1{sign}{number}", one.place) if sign else 1.0


def _count(size: str, found: Pst, one: Code) -> int:
    """Rows of zeros or ones: a number, or as many as mac_con has."""
    first = size.partition(",")[0].strip()
    if first.isascii() and first.isdecimal() and int(first) <= LARGEST:
        return int(first)
    if re.match(r"(?:length|size)\s*\(\s*mac_con\b", size) and "mac_con" in found.tables:
        return len(found.tables["mac_con"])
    raise _refused(one)


def _refused(one: Code) -> CaseError:
    return one.place.error(f"{shown(one.text)} is not data but code, which is not run; write the values instead.")
