"""The rows of a results file, and a table of what varies and what was found."""

import json
import re
from collections.abc import Container, Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stabctl._util.errors import StudyError
from stabctl._util.schema import fields
from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb
from stabctl.jobs import store
from stabctl.jobs.task import COMPUTED

from .job import JOB, SWEEP, Job

if TYPE_CHECKING:
    import pandas as pd

ANSWERS = tuple(c for c in SWEEP.columns if c not in (*JOB, "key"))  # columns of what was found
DATA = "data"  # column that tells apart rows of the same inputs
DEFAULTS = {f.column: f.default for f in fields(Job).values()}


@dataclass(frozen=True, repr=False)
class Results(Tabular):
    """The rows of a results file, in order; changes of the case are columns of their own in tables, as `pss.1.K`.

    Rows whose inputs are the same, because the case or a file of a controller was edited between them, have a column
    `data`, which says when they were computed: "earlier" or "latest".

    Attributes
    ----------
    rows : tuple of dict
        A dictionary per job, by column.

    Examples
    --------
    >>> done = st.run_sweep("places.toml", "places.db", workers=1)
    >>> st.read_sweep("places.db").df[["fault", "storage", "cycles"]].tail(2)
         fault storage  cycles
    4  7-8@0.4    50MW  26.000
    5  7-8@0.4    none  20.375
    """

    rows: tuple[dict[str, Any], ...]

    report = verb("stabctl.view.pages.pattern:report")

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Columns of the jobs."""
        changes = dict.fromkeys(path for row in self.rows for path in _changes(row))
        data = [DATA] if any(row.get(DATA) for row in self.rows) else []
        return (*(name for column in JOB for name in (changes if column == "set" else [column])), *data)

    @cached_property
    def varying(self) -> tuple[str, ...]:
        """Columns of the jobs that differ between rows."""
        return tuple(c for c in self.inputs if len({_value(row, c) for row in self.rows}) > 1)

    @cached_property
    def common(self) -> dict[str, Any]:
        """Column -> value, of the columns that are the same in every row and not the default."""
        shared = ((c, _value(row, c)) for row in self.rows[:1] for c in self.inputs if c not in self.varying)
        return {c: value for c, value in shared if value not in (None, DEFAULTS.get(c))}

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """What varies and what was found."""
        found = [c for c in ANSWERS if c not in (*COMPUTED, "message") and any(row[c] is not None for row in self.rows)]
        return (*self.varying, *(c for c in found if c != "status" or self.errors))

    @cached_property
    def cells(self) -> tuple[tuple[Any, ...], ...]:
        """A row for every job, of `columns`."""
        return tuple(tuple(_value(row, c) for c in self.columns) for row in self.rows)

    @cached_property
    def errors(self) -> tuple[tuple[str, str], ...]:
        """What varies in each job that failed, and its message."""
        wrong = [row for row in self.rows if row["status"] != "ok"]
        return tuple((", ".join(f"{c} {_value(row, c)}" for c in self.varying), row["message"]) for row in wrong)

    @property
    def df(self) -> "pd.DataFrame":
        """Every column of every row; whole numbers stay whole where some are missing."""
        import pandas as pd

        values = {c: [_value(row, c) for row in self.rows] for c in ("key", *self.inputs, *ANSWERS)}
        return pd.DataFrame({c: pd.Series(given, dtype=_dtype(c, given)) for c, given in values.items()})

    def __str__(self) -> str:
        earlier = sum(row.get(DATA) == "earlier" for row in self.rows)
        text = f"{len(self.rows) - len(self.errors)} ok, {len(self.errors)} with an error"
        return text + (f"; {earlier} computed earlier, from other data or by another version" if earlier else "")

    def _head(self) -> str:
        return ", ".join(f"{c} {value}" for c, value in self.common.items()) + f"\n{self}"


def read(path: str | Path) -> Results:
    """Read the results of a sweep.

    Parameters
    ----------
    path : str or Path
        Results file of `run_sweep`.

    Returns
    -------
    Results
        Its rows, in the order of their jobs.

    Raises
    ------
    StudyError
        If there is no such file, or it is not a results file.

    Examples
    --------
    >>> done = st.run_sweep("places.toml", "places.db", workers=1)
    >>> st.read_sweep("places.db").varying
    ('fault', 'storage')
    """
    return of(rows(path))


def rows(path: str | Path, own: Container[tuple[str, ...]] | None = None) -> list[dict[str, Any]]:
    """The rows of a results file, all or its `own`: column -> value, `set` as a mapping of the changes."""
    found = [row for row in store.rows(path, SWEEP) if own is None or SWEEP.row(row) in own]
    try:
        changes = [json.loads(row["set"] or "{}") for row in found]
    except ValueError:
        changes = [None]
    if not all(isinstance(one, dict) for one in changes):
        raise StudyError(f"{path}: {store.SENTENCES['SQLITE_CORRUPT']}.")
    return [row | {"set": one or None} for row, one in zip(found, changes, strict=True)]


def cell(column: str, value: object) -> str:
    """A value of a results file in a table."""
    if column == "monotone" and value is not None:
        return "yes" if value else "no"
    if column == "outcome" and value is not None:
        return str(value).replace("_", " ")
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def of(rows: Iterable[dict[str, Any]]) -> Results:
    """The rows sorted by their jobs, numbers in text by their size: 5%mva before 10%mva; then by time of completion."""
    ordered = sorted(rows, key=lambda row: ([_natural(row[c]) for c in JOB], row["finished"] or ""))
    same: dict[str, list[int]] = {}
    for k, row in enumerate(ordered):
        same.setdefault(_inputs(row), []).append(k)
    told = {k: "earlier" for places in same.values() for k in places[:-1]}
    told |= {places[-1]: "latest" for places in same.values() if len(places) > 1}
    return Results(tuple(row | ({DATA: told[k]} if k in told else {}) for k, row in enumerate(ordered)))


def _inputs(row: dict[str, Any]) -> str:
    return repr([row[c] for c in JOB])


def _changes(row: dict[str, Any]) -> dict[str, Any]:
    return row["set"] or {}


def _value(row: dict[str, Any], column: str) -> Any:
    return row[column] if column in row else _changes(row).get(column)


def _dtype(column: str, values: Iterable[Any]) -> str | None:
    """The type of a column for pandas, of a change of the case by its values; None for text and what is mixed."""
    if column == "monotone":
        return "boolean"
    kinds = {SWEEP.columns[column]} if column in SWEEP.columns else {type(v) for v in values if v is not None}
    return {int: "Int64", float: "float64"}.get(kinds.pop()) if len(kinds) == 1 else None


def _natural(value: object) -> list[tuple[int, Any]]:
    """A key that sorts None first, numbers by size, and text by its words and the numbers in it."""
    if value is None:
        return []
    value = str(value) if isinstance(value, dict) else value
    parts: list[Any] = re.split(r"(\d+(?:\.\d+)?(?:e[+-]?\d+)?)", value) if isinstance(value, str) else ["", value]
    return [(1, part) if k % 2 == 0 else (0, float(part)) for k, part in enumerate(parts) if k % 2 or part]
