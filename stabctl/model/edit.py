"""Edited cases: one value changed, a machine out of service, a load added, classical machines."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from stabctl.errors import CaseError, StudyError, shown
from stabctl.schema import Field, fields
from stabctl.units import megavars, megawatts, quantity

from . import catalog, fleet, keys
from .case import Case
from .tables import TABLES, Load

ABOUT = {"name": "-", "title": "-", "source": "-", "base_mva": "MVA", "frequency_hz": "Hz"}  # entry -> unit


def changed(case: Case, values: Mapping[str, Any]) -> Case:
    """The case with the values at some paths changed, all at once (see `Case.set`)."""
    parts: dict[str, Any] = {}
    devices = {model: dict(rows) for model, rows in case.devices.items()}
    for path, value in values.items():
        if path in ABOUT:
            number = isinstance(value, str) and ABOUT[path] != "-"
            parts[path] = _read(path, value, ABOUT[path]) if number else value
            continue
        table, key, column = _split(path)
        i = keys.row(case, table, key)
        f = _field(case, table, column)
        if table in TABLES:
            rows = list(parts.get(table, getattr(case, table)))
            rows[i] = rows[i]._replace(**{f.name: _value(case, path, f, value, rows[i])})
            parts[table] = tuple(rows)
        else:
            own = list(devices[table])[i]
            devices[table][own] = devices[table][own]._replace(**{f.name: _value(case, path, f, value)})
    try:
        return replace(case, devices=devices, **parts)
    except CaseError as error:
        given = [f"{path} = {value if isinstance(value, str) else shown(value)}" for path, value in values.items()]
        raise CaseError(f"{case.name} cannot have {', '.join(given)}: {error}") from None


def with_load(case: Case, bus: int, p: str | float | None, q: str | float | None, **shares: float) -> Case:
    """The case with the load at a bus changed or added (see `Case.with_load`)."""
    keys.row(case, "buses", bus)
    for name in shares:
        if name not in list(fields(Load))[3:]:
            raise StudyError(f"A load has no {name!r}; {keys.near(name, list(fields(Load))[3:])}")
    given: dict[str, Any] = dict(shares)
    given |= {} if p is None else {"p": megawatts(p)}
    given |= {} if q is None else {"q": megavars(q)}
    here = [i for i, load in enumerate(case.loads) if load.bus == bus]
    if len(here) > 1:
        raise StudyError(
            f"Bus {bus} of {case.name} has {len(here)} loads; change one with set('loads.{bus}#2.p', ...)."
        )
    loads = list(case.loads)
    if here:
        loads[here[0]] = loads[here[0]]._replace(**given)
    else:
        loads.append(Load(**{"bus": bus, "p": 0.0, "q": 0.0} | given))
    return replace(case, loads=tuple(loads))


def trip_machine(case: Case, number: int) -> Case:
    """The case without a machine, its controls and its storage devices (see `Case.trip_machine`)."""
    machine = case.machine(number)
    machines = tuple(m for m in case.machines if m is not machine)
    buses = case.buses
    if machine.bus not in {m.bus for m in machines}:
        i = keys.row(case, "buses", machine.bus)
        if buses[i].kind == "swing":
            raise StudyError(
                f"Machine {number} of {case.name} is the only one at the swing bus {machine.bus}; make another bus the "
                "swing bus first."
            )
        buses = (*buses[:i], buses[i]._replace(kind="pq"), *buses[i + 1 :])
    devices = {
        model: {key: par for key, par in rows.items() if catalog.at_bus(model) or keys.number(key) != number}
        for model, rows in case.devices.items()
    }
    storage = tuple(s for s in case.storage if s.machine != number)
    return replace(case, buses=buses, machines=machines, devices=devices, storage=storage)


def classical(case: Case) -> Case:
    """The case with every machine a constant voltage behind x'd, without controls; converters keep theirs."""
    machines: dict[keys.Key, Any] = {}
    for model in catalog.of_role("machine"):
        for key, par in case.devices.get(model, {}).items():
            if model == "gencls":
                machines[key] = par
            elif {"H", "D", "ra", "x1d"} <= set(par._fields):
                machines[key] = catalog.parameters("gencls", H=par.H, D=par.D, ra=par.ra, x1d=par.x1d)
            else:
                raise StudyError(f"Machine {key} of {case.name} is a {model}, which has no classical equivalent.")
    others = {
        model: {key: par for key, par in rows.items() if catalog.at_bus(model) or keys.number(key) not in machines}
        for model, rows in case.devices.items()
    }
    ordered = {m.machine: machines[m.machine] for m in case.machines if m.machine in machines}
    return replace(case, devices=others | {"gencls": ordered}, title=f"{case.title}, classical machines")


def _split(path: str) -> tuple[str, str, str]:
    """Table, key and column of a path; a key (the name of a link) may hold dots."""
    table, _, rest = path.partition(".") if isinstance(path, str) else ("", "", "")
    key, _, column = rest.rpartition(".")
    if not (table and key and column):
        raise StudyError(
            f"{shown(path)} is not a value of a case; write table.key.column, as pss.1.K, or one of {', '.join(ABOUT)}."
        )
    return table.strip(), key.strip(), column.strip()


def _field(case: Case, table: str, column: str) -> Field:
    """The column, by its name (K) or its header (K_pu)."""
    known = fields(TABLES[table] if table in TABLES else catalog.models()[table].Par)
    for f in known.values():
        if column in (f.name, f.column):
            return f
    raise StudyError(f"{table} has no column {column!r}; {keys.near(column, known)}")


def _value(case: Case, path: str, f: Field, value: Any, row: Any = None) -> Any:
    """The value in the unit of its column; what is no number stays, to be refused with its place."""
    if not isinstance(value, str) or f.kind is str:
        return value
    if f.kind is int:
        return int(value) if value.strip().isascii() and value.strip().isdigit() and len(value) < 19 else value
    if f.unit == "MW" and "%" in value and hasattr(row, "machine"):
        return fleet.megawatts(case, case.machine(row.machine), value)
    return _read(path, value, f.unit)


def _read(path: str, text: str, unit: str) -> float:
    try:
        return quantity(text, unit)
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None
