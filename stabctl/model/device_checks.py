"""Checks of the device tables: each row belongs to a machine or bus, and is compatible with the other devices there."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from stabctl import devices
from stabctl.schema import fields

from . import catalog, keys
from .row_error import RowError

if TYPE_CHECKING:
    from .case import Case


def check(case: "Case") -> Iterator[str]:
    """Raise the first error in the device tables; yield a warning for every unusual parameter."""
    _owners(case)
    _one_of_a_kind(case)
    _every_unit_has_a_model(case)
    _controls(case)
    for model, rows in case.devices.items():
        for i, (key, par) in enumerate(rows.items()):
            yield from _parameters(model, i, key, par)


def _owners(case: "Case") -> None:
    """Check that every device belongs to a machine, to a bus, or (load models) to a row of loads.csv."""
    machines, buses = {m.machine for m in case.machines}, {b.bus for b in case.buses}
    loads = set(keys.keys(case, "loads"))
    for model, rows in case.devices.items():
        column = catalog.key_field(model).name
        for i, key in enumerate(rows):
            if not (isinstance(key, int) and not isinstance(key, bool)) and not keys.REPEATED.fullmatch(str(key)):
                text = f"{key!r} is not allowed; it must be a {column} number, or 2#2 for the second device at 2."
                raise RowError(model, i, column, text)
            if catalog.role(model) == "load" and key not in loads:
                text = f"there is no load at bus {key} in loads.csv; add it there, with its p and q."
                raise RowError(model, i, column, text)
            if keys.number(key) not in (buses if column == "bus" else machines):
                table = "buses.csv" if column == "bus" else "machines.csv"
                raise RowError(model, i, column, f"there is no {column} {keys.number(key)} in {table}.")


def _one_of_a_kind(case: "Case") -> None:
    """Check that a machine has at most one model, one exciter and one governor, and a load one model."""
    first: dict[tuple[keys.Key, str], tuple[str, int]] = {}
    for model, rows in case.devices.items():
        role = catalog.role(model)
        if role not in (*catalog.SINGLE_ROLES, "load"):
            continue
        place, kind = key_column(model), "unit" if role in catalog.UNIT_ROLES else role
        for i, key in enumerate(rows):
            owner = key if role == "load" else keys.number(key)
            if (owner, kind) not in first:
                first[owner, kind] = model, i
                continue
            other, row = first[owner, kind]
            noun = {"unit": "models", "load": "models"}.get(kind, kind + "s")
            if other == model:
                text = f"{place} {owner} appears twice ({{rows}}); it can have only one row in this table."
                raise RowError(model, i, place, text, row)
            text = f"{place} {owner} has two {noun}, in {other}.csv and {model}.csv; keep one."
            raise RowError(model, i, place, text)


def key_column(model: str) -> str:
    """Name of the column that keys a model's table."""
    return catalog.key_field(model).name


def _every_unit_has_a_model(case: "Case") -> None:
    """Check that every machine has a model, unless none has: such a case has a power flow only."""
    known = catalog.of_role(*catalog.UNIT_ROLES)
    if not any(catalog.role(model) in devices.UNIT_ROLES for model in case.devices):
        return
    modeled = {keys.number(key) for model in known for key in case.devices.get(model, ())}
    for i, m in enumerate(case.machines):
        if m.machine not in modeled:
            text = (
                f"machine {m.machine} has no model; add a row for it to one of {', '.join(f'{k}.csv' for k in known)}."
            )
            raise RowError("machines", i, "machine", text)


def _controls(case: "Case") -> None:
    """Check that every control has something to act on."""
    for model, rows in case.devices.items():
        role = catalog.role(model)
        for i, key in enumerate(rows):
            number = keys.number(key)
            machine = case.model(number, "machine")
            if role == "exciter" and machine and not catalog.takes(machine, role):
                text = f"machine {number} is modeled by {machine}, which has no exciter; remove this row."
                raise RowError(model, i, "machine", text)
            if role in devices.OF_CONVERTER and machine:
                text = f"machine {number} is modeled by {machine}, which has no {role}; remove this row."
                raise RowError(model, i, "machine", text)
            if role == "plant control" and not case.model(number, "electrical control"):
                text = f"machine {number} has no electrical control for its plant control to act on; add one."
                raise RowError(model, i, "machine", text)
            if role == "stabilizer" and machine and not case.model(number, "exciter"):
                text = f"machine {number} has no exciter for its stabilizer to act on; add one or remove this row."
                raise RowError(model, i, "machine", text)


def _parameters(model: str, i: int, key: keys.Key, par: Any) -> Iterator[str]:
    """Raise the first invalid combination of parameters; yield a warning for every unusual one."""
    kind: type = type(par)
    of = fields(kind)
    owner = f"{key_column(model)} {key}"
    for name, f in of.items():
        top = name.removesuffix("min") + "max"
        if name.endswith("min") and top in of and getattr(par, name) > getattr(par, top):
            text = f"{name} = {getattr(par, name):g} is above {top} = {getattr(par, top):g}."
            raise RowError(model, i, f.column, text)
    for name, text in getattr(par, "errors", tuple)():
        raise RowError(model, i, of[name].column, f"{name} = {getattr(par, name):g} of {owner} {text}.")
    for name, text in getattr(par, "warnings", tuple)():
        yield f"{model}.csv, {owner}: {name} = {getattr(par, name):g} {text}."
