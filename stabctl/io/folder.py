"""A case as a folder: one CSV table for each kind of row, units in the header, and `case.toml`.

Tables: buses, branches, machines, loads, links, storage, and one for each device model, keyed by machine (load models:
by bus). A folder whose case.toml says `extends = "other"` holds only what differs (`overlay`).
"""

import tomllib
from collections.abc import Hashable, Iterable, Mapping
from pathlib import Path
from typing import Any

from stabctl.errors import CaseError, shown
from stabctl.model import catalog
from stabctl.model.case import Case
from stabctl.model.keys import Key
from stabctl.model.row_error import RowError
from stabctl.model.tables import TABLES
from stabctl.schema import fields

from .table import Row, Table, read, text_of

PACKAGED = Path(__file__).parent.parent / "model" / "cases"
ABOUT = {"name": str, "title": str, "source": str, "base_mva": float, "frequency_hz": float, "extends": str}
NEEDED = "buses", "branches", "machines"  # tables that every folder has
OVERLAID = {"buses": "bus", "machines": "machine"}  # tables of which an overlay gives single rows, and their keys


def packaged() -> list[str]:
    """Names of the cases that come with the package."""
    return sorted(p.parent.name for p in PACKAGED.glob("*/case.toml"))


def load(name: str | Path) -> Case:
    """Read a case.

    Parameters
    ----------
    name : str or Path
        A packaged case by its name, or a folder.

    Raises
    ------
    CaseError
        For the first error, with file, row, column, value and what is allowed.
    """
    from . import overlay

    folder = find(name)
    about = read_about(folder)
    tables = read_tables(folder, about)
    if "extends" in about:
        return overlay.load(folder, about, tables)
    for table in NEEDED:
        if table not in tables:
            raise CaseError(f"{folder / table}.csv: the table is missing; a case folder needs one.")
    rows = {name: tuple(TABLES[name](**row) for row in tables[name].rows) for name in TABLES if name in tables}
    devices = {
        model: dict(zip(device_keys(folder, model, tables[model]), _parameters(model, tables[model].rows), strict=True))
        for model in tables
        if model not in TABLES
    }
    return located({"name": folder.name} | about | rows | {"devices": devices}, tables, folder)


def find(name: str | Path) -> Path:
    """The folder of a case. Raises `CaseError` if there is none."""
    if isinstance(name, str) and name in packaged():
        return PACKAGED / name
    text = str(name)
    try:
        found = isinstance(name, str | Path) and bool(text.strip()) and "\0" not in text and Path(name).is_dir()
    except OSError as error:
        raise CaseError(f"{text}: the folder cannot be read ({error.strerror}).") from None
    if not found:
        raise CaseError(f"There is no case {text!r}: give a folder, or one of {', '.join(packaged())}.")
    return Path(name)


def read_about(folder: Path) -> Row:
    """The entries of case.toml."""
    path = folder / "case.toml"
    try:
        about = tomllib.loads(text_of(path))
    except (ValueError, RecursionError) as error:
        raise CaseError(f"{path}: it cannot be read as TOML ({error}).") from None
    for key, value in about.items():
        if key not in ABOUT:
            raise CaseError(f"{path}: {key!r} is not a valid entry; choose one of {', '.join(ABOUT)}.")
        wanted = (str, "text") if ABOUT[key] is str else (int | float, "a number")
        if isinstance(value, bool) or not isinstance(value, wanted[0]):
            raise CaseError(f"{path}, {key}: {shown(value)} is not allowed; it must be {wanted[1]}.")
    return about


def read_tables(folder: Path, about: Row) -> dict[str, Table]:
    """Every table in the folder; of an overlay with the columns given."""
    tables: dict[str, Table] = {}
    try:
        paths = sorted(path for path in folder.iterdir() if path.suffix == ".csv")
    except OSError as error:
        raise CaseError(f"{folder}: the folder cannot be read ({error.strerror}).") from None
    for path in paths:
        name, known = path.stem, [*TABLES, *catalog.models()]
        if name not in known:
            raise CaseError(
                f"{path}: there is no table {name!r}; the tables are {', '.join(known)}; register your own device with "
                "st.register or --device."
            )
        device = name not in TABLES
        columns = catalog.columns(name) if device else fields(TABLES[name])
        key = next(iter(columns)) if device or name in OVERLAID else None
        tables[name] = read(path, columns, partial=key if "extends" in about else None, device=device)
        if device or name == "loads":
            _refuse_copies(path, tables[name], device)
    return tables


def _refuse_copies(path: Path, table: Table, device: bool) -> None:
    """Raise `CaseError` for a row that repeats another one, and would count twice."""
    instead = "number the second device, as 2#2" if device else "give the second load an id"
    first: dict[Hashable, int] = {}
    for row, line in zip(table.rows, table.lines, strict=True):
        seen = first.setdefault(tuple(row.items()), line)
        if seen != line:
            raise CaseError(f"{path} row {line}: it repeats row {seen}; remove it, or {instead}.")


def device_keys(folder: Path, model: str, table: Table) -> list[Key]:
    """Keys of the rows of a device table; the second row for machine 2 has the key 2#2, which may be implicit."""
    column = catalog.key_field(model).name
    found: dict[Key, int] = {}
    for row, line in zip(table.rows, table.lines, strict=True):
        key, count = row[column], 1
        while key in found and isinstance(row[column], int):
            count += 1
            key = f"{row[column]}#{count}"
        if key in found:
            text = f"{column} {key} appears twice (rows {found[key]} and {line}); each may appear once."
            raise CaseError(f"{folder / model}.csv row {line}, column {column}: {text}")
        found[key] = line
    return list(found)


def _parameters(model: str, rows: Iterable[Row]) -> list[Any]:
    column = catalog.key_field(model).name
    return [catalog.parameters(model, **{k: v for k, v in row.items() if k != column}) for row in rows]


def located(parts: dict[str, Any], tables: Mapping[str, Table], folder: Path, base: Path | None = None) -> Case:
    """The case; an error in it is reported with file and line (line 0 of a table: a row of the folder `base`)."""
    try:
        return Case(**parts)
    except RowError as error:
        lines = tables[error.table].lines if error.table in tables else []
        own = error.row < len(lines) and lines[error.row] > 0
        path = (folder if own or base is None else base) / f"{error.table}.csv"
        sentence = error.located(path, lambda row: (lines[row] if row < len(lines) else 0) or row + 2)
        raise CaseError(sentence) from None
    except CaseError as error:
        raise CaseError(f"{folder}/{error}") from None
