"""Rows of a results file as a table that shows what varies and what came of it."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from stabctl.schema import fields

from .job import Job
from .result import ABOUT
from .store import JOB, RESULT

DEFAULTS = {f.column: f.default for f in fields(Job).values()}


@dataclass(frozen=True)
class Overview:
    """What is common to all rows, and a table of the rest, in the order of what varies."""

    common: dict[str, Any]  # column -> value, where it is not the default
    columns: tuple[str, ...]
    cells: tuple[tuple[Any, ...], ...]
    ok: int
    errors: tuple[tuple[str, str], ...]  # what varies in a row that is no result, its sentence

    def __str__(self) -> str:
        return f"{self.ok} ok, {len(self.errors)} with an error"


def overview(rows: Sequence[dict[str, Any]]) -> Overview:
    """The overview of the rows of a results file."""
    varying = [c for c in JOB if len({row[c] for row in rows}) > 1]
    findings = [c for c in RESULT if c not in (*ABOUT, "message") and any(row[c] is not None for row in rows)]
    rows = in_order(rows)
    wrong = [row for row in rows if row["status"] != "ok"]
    columns = (*varying, *(c for c in findings if c != "status" or wrong))
    return Overview(
        {c: rows[0][c] for c in JOB if rows and c not in varying and rows[0][c] not in (None, DEFAULTS[c])},
        columns,
        tuple(tuple(row[c] for c in columns) for row in rows),
        len(rows) - len(wrong),
        tuple((", ".join(f"{c} {row[c]}" for c in varying), row["message"]) for row in wrong),
    )


def cell(column: str, value: object) -> str:
    """A value of a results file in a table."""
    if column == "monotone" and value is not None:
        return "yes" if value else "no"
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value).replace("_", " ")


def in_order(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows, numbers in texts counted as numbers: 5%mva before 10%mva."""
    return sorted(rows, key=lambda row: [_natural(row[c]) for c in JOB])


def _natural(value: object) -> list[tuple[int, Any]]:
    """A key that sorts None first, numbers by size, texts by their words and the numbers in them."""
    if value is None:
        return []
    parts = re.split(r"(\d+(?:\.\d+)?(?:e[+-]?\d+)?)", value) if isinstance(value, str) else ["", value]
    return [(1, part) if k % 2 == 0 else (0, float(part)) for k, part in enumerate(parts) if k % 2 or part]
