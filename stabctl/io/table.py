"""A CSV table of a case: rows by field name. Errors give file, row, column, value and what is allowed."""

import csv
import difflib
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from stabctl._util.errors import CaseError, shown
from stabctl._util.schema import NAMED, Field
from stabctl._util.tabular import inert, plain
from stabctl.model.naming import REPEATED

Row = dict[str, Any]

LARGEST_FILE = 64_000_000  # bytes


class Table(NamedTuple):
    """Rows by field name, and the line of each in its file."""

    rows: list[Row]
    lines: list[int]


def read(path: Path, columns: Mapping[str, Field], *, partial: str | None = None, device: bool = False) -> Table:
    """The rows of a CSV file.

    Parameters
    ----------
    path : Path
        The file.
    columns : mapping of str to Field
        Columns by field name.
    partial : str, optional
        The only required column; columns that are omitted are then not filled with defaults.
    device : bool
        The first column is the key of a device, which may be written 2#2.

    Raises
    ------
    CaseError
        If the file or one of its cells cannot be read.
    """
    text = text_of(path)
    by_header = {f.column: f for f in columns.values()}
    key = next(iter(columns)) if device else None
    defaults = {} if partial else {f.name: f.default for f in columns.values() if not f.required}
    table, header = Table([], []), None
    try:
        reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        for cells in reader:
            cells = [c.strip() for c in cells]
            if not any(cells):
                continue
            if header is None:
                header = _header(path, cells, by_header, partial)
                continue
            if len(cells) != len(header):
                raise CaseError(
                    f"{path} row {reader.line_num}: the row has {len(cells)} cells, the header has {len(header)}."
                )
            given = {
                f.name: _value(path, reader.line_num, f, c, f.name == key)
                for f, c in zip(header, cells, strict=True)
                if c or f.required
            }
            table.rows.append(defaults | given)
            table.lines.append(reader.line_num)
    except csv.Error as error:
        raise CaseError(f"{path}: it cannot be read as CSV ({error}).") from None
    if header is None:
        raise CaseError(f"{path}: the table has no header; it must be {', '.join(by_header)}.")
    return table


def text_of(path: Path) -> str:
    """The text of a file in UTF-8. Raises `CaseError` if it is not a regular file, too large or not text."""
    try:
        if path.exists() and not path.is_file():
            raise CaseError(f"{path}: it is not a regular file.")
        if path.stat().st_size > LARGEST_FILE:
            raise CaseError(f"{path}: the file has more than {LARGEST_FILE / 1e6:g} MB, the largest that is read.")
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise CaseError(f"{path}: the file is missing; a case folder needs one.") from None
    except (UnicodeDecodeError, OSError) as error:
        reason = getattr(error, "strerror", None) or error
        raise CaseError(f"{path}: it cannot be read as UTF-8 text ({reason}).") from None


def text_from(columns: Mapping[str, Field], cells: Sequence[Sequence[Any]]) -> str:
    """Columns and rows of cells as CSV; numbers have the fewest digits that read back the same."""
    file = io.StringIO(newline="")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([f.column for f in columns.values()])
    writer.writerows([[_cell(c) for c in row] for row in cells])
    return file.getvalue()


def _cell(value: Any) -> Any:
    if isinstance(value, str):
        return inert(value)
    if not isinstance(value, float):
        return value
    short = format(value, ".15g")
    return short if float(short) == value else repr(value)


def _header(path: Path, cells: list[str], by_header: Mapping[str, Field], partial: str | None) -> list[Field]:
    """The fields of the columns; each must be known and appear once, and none may be missing."""
    for i, cell in enumerate(cells):
        if cell not in by_header:
            near = difflib.get_close_matches(cell, by_header, 1, 0.5)
            hint = f"did you mean {near[0]}?" if near else f"the columns are {', '.join(by_header)}."
            hint = "separate the cells by commas." if ";" in cell else hint
            raise CaseError(f"{path} row 1: {cell!r} is not a column of this table; {hint}")
        if cell in cells[:i]:
            raise CaseError(f"{path} row 1: column {cell!r} appears twice; keep one.")
    needed = (f for f in by_header.values() if (f.name == partial if partial else f.required))
    missing = [f"{f.column!r} ({f.meaning})" for f in needed if f.column not in cells]
    if missing:
        noun, verb = ("column", "is") if len(missing) == 1 else ("columns", "are")
        raise CaseError(f"{path} row 1: {noun} {', '.join(missing)} {verb} missing.")
    return [by_header[c] for c in cells]


def _value(path: Path, line: int, f: Field, cell: str, key: bool) -> Any:
    """The value in a cell; numbers in ASCII digits."""
    if key and REPEATED.fullmatch(cell):
        return cell
    if f.kind is str or (f.kind == NAMED and not cell.isdecimal()):
        return plain(cell)
    try:
        if "_" in cell or not cell.isascii():
            raise ValueError
        return int(cell) if f.kind == NAMED else f.kind(cell)
    except ValueError:
        text = f"{shown(cell)} is not allowed; it must be {f.expected()}."
        raise CaseError(f"{path} row {line}, column {f.column}: {text}") from None
