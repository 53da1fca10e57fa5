"""Paths to the values of a case: `pss.1.K`, `machines.2.p`, `branches.7-8#2.x`, `frequency_hz`."""

import difflib
from collections.abc import Mapping
from typing import Any

from stabctl.errors import StudyError, shown
from stabctl.schema import Field, fields
from stabctl.units import quantity

from . import catalog, fleet, keys
from .case import Case
from .tables import TABLES

ABOUT = {"name": "-", "title": "-", "source": "-", "base_mva": "MVA", "frequency_hz": "Hz"}  # entry -> unit


def resolve(case: Case, path: object) -> tuple[str, str, Field]:
    """Table, key and column of a path; a key (the name of a link) may hold dots, a column be a name or a header.

    Raises `StudyError` for a table or column that the case does not have, or if it is not a path.
    """
    table, _, rest = path.partition(".") if isinstance(path, str) else ("", "", "")
    key, _, column = (part.strip() for part in rest.rpartition("."))
    if not (table and key and column):
        raise not_a_path(path)
    table = keys.known_table(case, table.strip())
    known = fields(TABLES[table] if table in TABLES else catalog.models()[table].Par)
    for f in known.values():
        if column in (f.name, f.column):
            return table, key, f
    raise StudyError(f"{table} has no column {column!r}; {_near(column, known)}")


def _near(column: str, known: Mapping[str, Field]) -> str:
    """End of a sentence: the columns written like this or with it in their meaning, else all."""
    like = difflib.get_close_matches(column, list(known), 3, 0.6)
    like += [name for name, f in known.items() if column.lower() in f.meaning.lower() and name not in like]
    return f"did you mean {' or '.join(like)}?" if like else f"it has {', '.join(known)}."


def not_a_path(path: object) -> StudyError:
    """The error for text that is not a path."""
    known = ", ".join(ABOUT)
    return StudyError(
        f"{shown(path)} is not a value of a case; write table.key.column, such as pss.1.K, or one of {known}."
    )


def about(name: str, given: Any) -> Any:
    """A value of an entry of case.toml, text with a unit as a number."""
    return _read(name, given, ABOUT[name]) if isinstance(given, str) and ABOUT[name] != "-" else given


def value(case: Case, path: str, f: Field, given: Any, row: Any = None) -> Any:
    """A value in the unit of its column; anything but a number is kept, to be rejected later with its location."""
    if not isinstance(given, str) or f.kind is str:
        return given
    if f.kind is int:
        return int(given) if given.strip().isascii() and given.strip().isdigit() and len(given) < 19 else given
    if f.unit == "MW" and "%" in given and hasattr(row, "machine"):
        return fleet.megawatts(case, case.machine(row.machine), given)
    return _read(path, given, f.unit)


def _read(path: str, text: str, unit: str) -> float:
    try:
        return quantity(text, unit)
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None
