"""A case as a folder of CSV tables and `case.toml`: read, laid over another case, and written.

A table has its units in the header. Tables: buses, branches, machines, loads, links, storage, and one for each device
model, keyed by machine (load models: by bus).

A folder whose case.toml says `extends = "other"` is an overlay: it changes rows and columns of another case. A row of
buses, machines or a device table replaces the columns given in the row of the other case with the same key; any other
table replaces the whole table.
"""

import tomllib
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping
from pathlib import Path
from typing import Any

from stabctl._util import files
from stabctl._util.errors import CaseError, StudyError, shown
from stabctl._util.schema import fields
from stabctl._util.toml_file import as_text
from stabctl.model import conventions, tables
from stabctl.model.case import Case, as_case
from stabctl.model.checks import RowError
from stabctl.model.naming import Key
from stabctl.model.tables import TABLES

from .table import Row, Table, read, text_from, text_of

PACKAGED = Path(__file__).parent.parent / "model" / "cases"
ABOUT = {"name": str, "title": str, "source": str, "base_mva": float, "frequency_hz": float}  # of a case
ENTRIES = {**ABOUT, "extends": str, "conventions": str}  # of case.toml
NEEDED = "buses", "branches", "machines"  # tables that every folder has
OVERLAID = {"buses": "bus", "machines": "machine"}  # tables of which an overlay gives single rows, and their keys


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
    folder = find(name)
    about = read_about(folder)
    chosen = about.pop("conventions", None)
    case = _read(folder, about)
    return case if chosen is None else conventions.with_conventions(case, chosen)


def _read(folder: Path, about: Row) -> Case:
    """The case with the parameters of its tables."""
    found = read_tables(folder, about)
    if "extends" in about:
        return load_overlay(folder, about, found)
    for table in NEEDED:
        if table not in found:
            raise CaseError(f"{folder / table}.csv: the table is missing; a case folder needs one.")
    rows = {name: tuple(TABLES[name](**row) for row in found[name].rows) for name in TABLES if name in found}
    devices = {
        model: dict(zip(device_keys(folder, model, found[model]), _parameters(model, found[model].rows), strict=True))
        for model in found
        if model not in TABLES
    }
    return located({"name": folder.name} | about | rows | {"devices": devices}, found, folder)


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
        if text.lower().endswith(".dyr"):
            raise CaseError(f"{text!r} is no case: give the RAW file, and the DYR file with --dyr (dyr=... in Python).")
        raise CaseError(f"There is no case {text!r}: give a folder, or one of {', '.join(packaged())}.")
    return Path(name)


def packaged() -> list[str]:
    """Names of the cases that come with the package.

    Examples
    --------
    >>> st.cases()[:2]
    ['ieee39', 'two_area']
    """
    return sorted(p.parent.name for p in PACKAGED.glob("*/case.toml"))


def read_about(folder: Path) -> Row:
    """The entries of case.toml."""
    path = folder / "case.toml"
    try:
        about = tomllib.loads(text_of(path))
    except (ValueError, RecursionError) as error:
        raise CaseError(f"{path}: it cannot be read as TOML ({error}).") from None
    for key, value in about.items():
        if key not in ENTRIES:
            raise CaseError(f"{path}: {key!r} is not a valid entry; choose one of {', '.join(ENTRIES)}.")
        wanted = (str, "text") if ENTRIES[key] is str else (int | float, "a number")
        if isinstance(value, bool) or not isinstance(value, wanted[0]):
            raise CaseError(f"{path}, {key}: {shown(value)} is not allowed; it must be {wanted[1]}.")
    if about.get("conventions", "pst") not in conventions.KNOWN:
        known = ", ".join(conventions.KNOWN)
        raise CaseError(f"{path}, conventions: {shown(about['conventions'])} is not allowed; choose one of {known}.")
    return about


def read_tables(folder: Path, about: Row) -> dict[str, Table]:
    """Every table in the folder; of an overlay with the columns given."""
    found: dict[str, Table] = {}
    try:
        paths = sorted(path for path in folder.iterdir() if path.suffix == ".csv")
    except OSError as error:
        raise CaseError(f"{folder}: the folder cannot be read ({error.strerror}).") from None
    for path in paths:
        name, known = path.stem, [*TABLES, *tables.models()]
        if name not in known:
            raise CaseError(
                f"{path}: there is no table {name!r}; the tables are {', '.join(known)}; register your own device with "
                "st.register or --device."
            )
        device = name not in TABLES
        columns = tables.device_columns(name) if device else fields(TABLES[name])
        key = next(iter(columns)) if device or name in OVERLAID else None
        found[name] = read(path, columns, partial=key if "extends" in about else None, device=device)
        if device or name == "loads":
            _refuse_copies(path, found[name], device)
    return found


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
    column = tables.key_field(model).name
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
    column = tables.key_field(model).name
    return [tables.parameters(model, **{k: v for k, v in row.items() if k != column}) for row in rows]


def located(parts: dict[str, Any], found: Mapping[str, Table], folder: Path, base: Path | None = None) -> Case:
    """The case; an error in it is reported with file and line (line 0 of a table: a row of the folder `base`)."""
    try:
        return Case(**parts)
    except RowError as error:
        lines = found[error.table].lines if error.table in found else []
        own = error.row < len(lines) and lines[error.row] > 0
        path = (folder if own or base is None else base) / f"{error.table}.csv"
        sentence = error.located(path, lambda row: (lines[row] if row < len(lines) else 0) or row + 2)
        raise CaseError(sentence) from None
    except CaseError as error:
        raise CaseError(f"{folder}/{error}") from None


def load_overlay(folder: Path, about: Row, found: dict[str, Table]) -> Case:
    """The other case with the changes of this folder. Raises `CaseError` with the location of the error."""
    base = _base(folder, about["extends"])
    case = load(base)
    parts: dict[str, Any] = {key: getattr(case, key) for key in ABOUT if key != "name"}
    parts |= {name: getattr(case, name) for name in TABLES}
    devices = {model: dict(rows) for model, rows in case.devices.items()}
    lines: dict[str, Table] = {}
    for name, table in found.items():
        if name in TABLES and name not in OVERLAID:
            parts[name], lines[name] = tuple(TABLES[name](**row) for row in table.rows), table
        elif name in TABLES:
            known = {getattr(row, OVERLAID[name]): row for row in parts[name]}
            lines[name] = _changed(folder, name, OVERLAID[name], table, known, _keys(folder, name, table), case)
            parts[name] = tuple(known.values())
        else:
            known = devices.setdefault(name, {})
            keys = device_keys(folder, name, table)
            lines[name] = _changed(folder, name, tables.key_field(name).name, table, known, keys, case)
    given = {key: value for key, value in about.items() if key != "extends"}
    return located(parts | {"devices": devices, "name": folder.name} | given, lines, folder, base)


def _base(folder: Path, name: str) -> Path:
    """The folder of the case that is extended: a folder next to this one, or a packaged case."""
    place = f"{folder / 'case.toml'}, extends: "
    beside = folder.parent / name
    base = PACKAGED / name if name in packaged() else None
    if name.isprintable() and name and (beside / "case.toml").is_file():
        base = beside
    if base is None:
        raise CaseError(
            f"{place}there is no case {name!r}; give a folder next to it, or one of {', '.join(packaged())}."
        )
    if base.resolve() == folder.resolve() or "extends" in read_about(base):
        raise CaseError(f"{place}{name!r} is itself an overlay; give a full case.")
    return base


def _keys(folder: Path, name: str, table: Table) -> list[int]:
    """Bus or machine numbers of the rows, which must be unique."""
    column = OVERLAID[name]
    found: dict[int, int] = {}
    for row, line in zip(table.rows, table.lines, strict=True):
        number = row[column]
        if number in found:
            text = f"{column} {number} appears twice (rows {found[number]} and {line}); give each its own."
            raise CaseError(f"{folder / name}.csv row {line}, column {column}: {text}")
        found[number] = line
    return list(found)


def _changed(
    folder: Path, name: str, column: str, table: Table, known: dict[Any, Any], keys: list[Any], case: Case
) -> Table:
    """Change rows in `known`; returns for each row the line that changed it, 0 if none did."""
    line_of = dict.fromkeys(known, 0)
    for key, row, line in zip(keys, table.rows, table.lines, strict=True):
        if key not in known:
            text = f"{case.name} has no {column} {key} in {name}.csv; an overlay can only change existing rows."
            raise CaseError(f"{folder / name}.csv row {line}, column {column}: {text}")
        known[key] = known[key]._replace(**{k: v for k, v in row.items() if k != column})
        line_of[key] = line
    return Table(table.rows, list(line_of.values()))


def write(case: Case, folder: str | Path) -> Path:
    """Write a case to a folder that `load` can read.

    Parameters
    ----------
    case : Case
        The system.
    folder : str or Path
        The folder, created if it does not exist.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    CaseError
        If the folder contains tables that the case does not have, which `load` would read as well.
    StudyError
        If a file cannot be written; files written before are complete.

    Examples
    --------
    >>> st.write(st.load("two_area").set("name", "mine"), "mine")
    PosixPath('mine')
    """
    case, folder = as_case(case), files.path_of(folder)
    texts = {}
    equal = Counter(case.loads).items()  # equal loads at a bus become one row, as a copy of a row is refused
    rows = {name: getattr(case, name) for name in TABLES}
    rows["loads"] = tuple(load._replace(p=count * load.p, q=count * load.q) for load, count in equal)
    for name, record in TABLES.items():
        if rows[name] or name in NEEDED:
            texts[f"{name}.csv"] = text_from(fields(record), rows[name])
    for name, devices in case.devices.items():
        columns = tables.device_columns(name)
        names = list(columns)[1:]
        texts[f"{name}.csv"] = text_from(
            columns, [[key, *(getattr(par, c) for c in names)] for key, par in devices.items()]
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"The folder {folder} cannot be created: {error.strerror or error}.") from None
    other = sorted(path.name for path in folder.glob("*.csv") if path.name not in texts)
    if other:
        raise CaseError(
            f"{folder} contains {', '.join(other)}, which {case.name} does not have; choose an empty folder."
        )
    for name, text in texts.items():
        files.replace(folder / name, text)
    about = {key: getattr(case, key) for key in ABOUT}
    files.replace(folder / "case.toml", "".join(f"{key} = {as_text(value)}\n" for key, value in about.items()))
    return folder
