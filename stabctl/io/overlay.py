"""Overlays: a folder whose case.toml says `extends = "other"` changes rows and columns of another case.

A row of buses, machines or a device table replaces the columns given in the row of the other case with the same key;
any other table replaces the whole table.
"""

from pathlib import Path
from typing import Any

from stabctl.errors import CaseError
from stabctl.model import catalog
from stabctl.model.case import Case
from stabctl.model.tables import TABLES

from .folder import ABOUT, OVERLAID, PACKAGED, device_keys, located, packaged, read_about
from .folder import load as load_full
from .table import Row, Table


def load(folder: Path, about: Row, tables: dict[str, Table]) -> Case:
    """The other case with the changes of this folder. Raises `CaseError` with the location of the error."""
    base = _base(folder, about["extends"])
    case = load_full(base)
    parts: dict[str, Any] = {key: getattr(case, key) for key in ABOUT if key not in ("name", "extends")}
    parts |= {name: getattr(case, name) for name in TABLES}
    devices = {model: dict(rows) for model, rows in case.devices.items()}
    lines: dict[str, Table] = {}
    for name, table in tables.items():
        if name in TABLES and name not in OVERLAID:
            parts[name], lines[name] = tuple(TABLES[name](**row) for row in table.rows), table
        elif name in TABLES:
            known = {getattr(row, OVERLAID[name]): row for row in parts[name]}
            lines[name] = _changed(folder, name, OVERLAID[name], table, known, _keys(folder, name, table), case)
            parts[name] = tuple(known.values())
        else:
            known = devices.setdefault(name, {})
            keys = device_keys(folder, name, table)
            lines[name] = _changed(folder, name, catalog.key_field(name).name, table, known, keys, case)
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
            text = (
                f"{column} {number} appears twice (rows {found[number]} and {line}); {column} numbers must be unique."
            )
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
