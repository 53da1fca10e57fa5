"""A CSV table of a case: rows by field name, every mistake told with file, row, column, value and what is allowed."""

import csv
import difflib
import io
from pathlib import Path
from typing import Any

from stabctl.errors import CaseError
from stabctl.schema import Field

Row = dict[str, Any]


def rows_of(path: Path, columns: dict[str, Field], partial_key: str | None) -> tuple[list[Row], list[int]]:
    """Rows by field name, and their lines in the file. With `partial_key` only that column must be there."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (UnicodeDecodeError, OSError) as error:
        raise CaseError(
            f"{path}: it cannot be read as a UTF-8 text ({getattr(error, 'strerror', None) or error})."
        ) from None
    by_header = {f.column: f for f in columns.values()}
    rows, lines, header = [], [], None
    try:
        reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        for cells in reader:
            cells = [c.strip() for c in cells]
            if not any(cells):
                continue
            if header is None:
                header = _header(path, cells, by_header, partial_key)
                continue
            if len(cells) != len(header):
                text = f"has {len(cells)} cells; the header has {len(header)}."
                raise CaseError(f"{path} row {reader.line_num}: the row {text}")
            given = zip(header, cells, strict=True)
            row = {f.name: _value(path, reader.line_num, f, c) for f, c in given if c or f.required}
            if partial_key is None:
                row = {f.name: f.default for f in columns.values() if not f.required} | row
            rows.append(row)
            lines.append(reader.line_num)
    except csv.Error as error:
        raise CaseError(f"{path}: it cannot be read as CSV ({error}).") from None
    if header is None:
        raise CaseError(f"{path}: the table has no header; it must be {', '.join(by_header)}.")
    return rows, lines


def _header(path: Path, cells: list[str], by_header: dict[str, Field], partial_key: str | None) -> list[Field]:
    for i, cell in enumerate(cells):
        if cell not in by_header:
            near = difflib.get_close_matches(cell, by_header, 1, 0.5)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(by_header)}."
            hint = "separate the cells by commas." if ";" in cell else hint
            raise CaseError(f"{path} row 1: {cell!r} is not a column of this table; {hint}")
        if cell in cells[:i]:
            raise CaseError(f"{path} row 1: column {cell!r} stands twice; each may stand once.")
    needed = [c for c, f in by_header.items() if (f.name == partial_key if partial_key else f.required)]
    for column in needed:
        if column not in cells:
            raise CaseError(f"{path} row 1: column {column!r} ({by_header[column].meaning}) is missing.")
    return [by_header[c] for c in cells]


def _value(path: Path, line: int, f: Field, cell: str) -> Any:
    try:
        if "_" in cell and f.kind is not str:
            raise ValueError
        return f.kind(cell)
    except ValueError:
        raise CaseError(
            f"{path} row {line}, column {f.column}: {cell!r} is not allowed; it must be {f.expected()}."
        ) from None


def save(path: Path, columns: Any, cells: list[list[Any]]) -> None:
    """Write the columns and rows of cells as a CSV file; numbers as short as they read back the same."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([f.column for f in columns.values()])
        writer.writerows(
            [format(c, ".15g") if isinstance(c, float) and float(format(c, ".15g")) == c else c for c in row]
            for row in cells
        )
