"""A case as a folder: one CSV table a kind of row, units in the header, and `case.toml`.

Tables: buses, branches, machines, loads, links, storage, and one per device model, keyed by machine number. A folder
whose case.toml says `extends = "other"` holds only what differs: a table row replaces the given columns of the row
with the same key (bus or machine number) of the other case.
"""

import tomllib
from pathlib import Path
from typing import Any

from stabctl.devices import models
from stabctl.errors import CaseError
from stabctl.model.case import TABLES, Case
from stabctl.schema import fields

from .table import Row, rows_of, save

PACKAGED = Path(__file__).parent.parent / "model" / "cases"
KEYS = {"buses": "bus", "machines": "machine"}
ABOUT = {"name": str, "title": str, "source": str, "base_mva": float, "frequency_hz": float, "extends": str}

Table = dict[str, tuple[list[Row], list[int]]]  # table -> rows, line numbers


def packaged() -> list[str]:
    """Names of the cases that come with the package."""
    return sorted(p.parent.name for p in PACKAGED.glob("*/case.toml"))


def load(name: str | Path) -> Case:
    """A packaged case by its name, or the case in a folder. Raises `CaseError` with the place of the mistake."""
    folder = Path(name)
    if str(name) in packaged():
        folder = PACKAGED / str(name)
    elif not str(name).strip() or "\0" in str(name) or not folder.is_dir():
        raise CaseError(f"There is no case {str(name)!r}: name a folder, or one of {', '.join(packaged())}.")
    about = _about(folder)
    tables = _tables(folder, partial="extends" in about)
    if "extends" in about:
        return _overlay(folder, about, tables)
    return _build(folder, about, tables)


def _about(folder: Path) -> Row:
    path = folder / "case.toml"
    try:
        about = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise CaseError(f"{path}: the file is missing; a case folder needs one.") from None
    except (ValueError, OSError, RecursionError) as error:
        raise CaseError(f"{path}: it cannot be read as TOML ({getattr(error, 'strerror', None) or error}).") from None
    for key, value in about.items():
        if key not in ABOUT:
            raise CaseError(f"{path}: {key!r} is not a known entry; known are {', '.join(ABOUT)}.")
        kind = ABOUT[key]
        if isinstance(value, bool) or not isinstance(value, str if kind is str else int | float):
            raise CaseError(
                f"{path}, {key}: {value!r} is not allowed; it must be a {'text' if kind is str else 'number'}."
            )
    return about


def _tables(folder: Path, partial: bool) -> Table:
    tables: Table = {}
    for path in sorted(folder.glob("*.csv")):
        name = path.stem
        if name in TABLES:
            columns, key = dict(fields(TABLES[name])), KEYS.get(name)
        elif name in models():
            number = fields(TABLES["machines"])["machine"]
            columns, key = {"machine": number, **fields(models()[name].Par)}, "machine"
        else:
            raise CaseError(f"{path}: there is no table {name!r}; known are {', '.join([*TABLES, *models()])}.")
        tables[name] = rows_of(path, columns, key if partial else None)
    return tables


def _build(folder: Path, about: Row, tables: Table) -> Case:
    for name in ("buses", "branches", "machines"):
        if name not in tables:
            raise CaseError(f"{folder / name}.csv: the table is missing; a case folder needs one.")
    rows = {name: tuple(record(**row) for row in tables[name][0]) for name, record in TABLES.items() if name in tables}
    devices: dict[str, dict[int, Any]] = {}
    for name, device in models().items():
        if name in tables:
            devices[name] = _keyed(folder / f"{name}.csv", device.Par, *tables[name])
    given = {key: value for key, value in about.items() if key != "extends"}
    return _located(folder, tables, {"name": folder.name} | given | rows | {"devices": devices})


def _keyed(path: Path, record: type, rows: list[Row], lines: list[int]) -> dict[int, Any]:
    filled = dict.fromkeys(record._fields, 0.0)
    table: dict[int, Any] = {}
    for row, line in zip(rows, lines, strict=True):
        number = row["machine"]
        if number in table:
            raise CaseError(f"{path} row {line}, column machine: machine {number} stands already; each may stand once.")
        table[number] = record(**{k: v for k, v in (filled | row).items() if k != "machine"})
    return table


def _located(folder: Path, tables: Table, arguments: dict[str, Any], base: Path | None = None) -> Case:
    """The case; a mistake in it is told with folder and line of the file (line 0: a row of the folder `base`)."""
    try:
        return Case(**arguments)
    except CaseError as error:
        if not hasattr(error, "table"):
            raise CaseError(f"{folder}/{error}") from None
        lines = tables[error.table][1] if error.table in tables else []
        line = lines[error.row] if error.row < len(lines) else 0
        path = (folder if line else base or folder) / f"{error.table}.csv"
        raise CaseError(f"{path} row {line or error.row + 2}, column {error.column}: {error.text}") from None


def _extended(folder: Path, name: str) -> Path | None:
    """The folder of the case an overlay names: one beside it, or a packaged one."""
    beside = folder.parent / name
    if name.isprintable() and name and (beside / "case.toml").is_file():
        return beside
    return PACKAGED / name if name in packaged() else None


def _overlay(folder: Path, about: Row, tables: Table) -> Case:
    base, place = _extended(folder, about["extends"]), f"{folder / 'case.toml'}, extends: "
    if base is None:
        known = ", ".join(packaged())
        raise CaseError(f"{place}there is no case {about['extends']!r}; name a folder beside, or one of {known}.")
    if base.resolve() == folder.resolve() or "extends" in _about(base):
        raise CaseError(f"{place}{about['extends']!r} is itself an overlay; name a full case.")
    case = load(base)
    changed: dict[str, Any] = {k: getattr(case, k) for k in (*TABLES, "title", "source", "base_mva", "frequency_hz")}
    devices = {model: dict(rows) for model, rows in case.devices.items()}
    located: Table = {}
    for name, (rows, lines) in tables.items():
        path = folder / f"{name}.csv"
        if name in TABLES and name not in KEYS:
            changed[name], located[name] = tuple(TABLES[name](**row) for row in rows), (rows, lines)
            continue
        key = KEYS.get(name, "machine")
        known = {getattr(r, key): r for r in changed[name]} if name in TABLES else devices.get(name, {})
        line_of = dict.fromkeys(known, 0)
        for row, line in zip(rows, lines, strict=True):
            number = row.pop(key)
            if number not in known:
                raise CaseError(f"{path} row {line}, column {key}: {case.name} has no {key} {number} to change.")
            known[number] = known[number]._replace(**row)
            line_of[number] = line
        located[name] = rows, [line_of[number] for number in known]
        if name in TABLES:
            changed[name] = tuple(known.values())
    given = {key: value for key, value in about.items() if key != "extends"}
    return _located(folder, located, changed | {"devices": devices, "name": folder.name} | given, base)


def write(case: Case, folder: str | Path) -> Path:
    """Write the case into a folder (made if need be), so that `load` gives it back; the folder."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    about = {k: getattr(case, k) for k in ABOUT if k != "extends"}
    lines = [f"{k} = {_toml(v)}" for k, v in about.items()]
    (folder / "case.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    for name, record in TABLES.items():
        if getattr(case, name):
            columns = fields(record)
            save(folder / f"{name}.csv", columns, [[getattr(r, c) for c in columns] for r in getattr(case, name)])
    machine = fields(TABLES["machines"])["machine"]
    for name, rows in case.devices.items():
        columns = fields(models()[name].Par)
        cells = [[number, *(getattr(par, c) for c in columns)] for number, par in rows.items()]
        save(folder / f"{name}.csv", {"machine": machine, **columns}, cells)
    return folder


def _toml(value: str | float) -> str:
    if not isinstance(value, str):
        return repr(float(value))
    for plain, escaped in (("\\", "\\\\"), ('"', '\\"'), ("\n", "\\n")):
        value = value.replace(plain, escaped)
    return f'"{value}"'
