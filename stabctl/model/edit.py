"""Edited cases: one value changed, a machine out of service, a load added, classical machines."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from stabctl.errors import CaseError, StudyError, shown
from stabctl.schema import fields
from stabctl.units import megavars, megawatts

from . import catalog, keys, paths
from .case import Case
from .tables import TABLES, Load


def set_value(case: Case, path: str | Mapping[str, Any], value: Any = None) -> Case:
    """The case with one value changed, as if its file had been edited.

    Parameters
    ----------
    case : Case
        The system.
    path : str or mapping
        `table.key.column`: "pss.1.K", "machines.2.p", "loads.7.p", "branches.7-8#2.x", "storage.14@33.rating"; or
        "frequency_hz", "base_mva", "name", "title", "source". A mapping of paths to values changes all at once.
    value : float, int or str
        In the unit of the column, or text with a unit: "50MW", "100ms".

    Raises
    ------
    StudyError
        If the case has no such table, row or column; it names similar ones.
    CaseError
        If the case would not be valid.

    Examples
    --------
    >>> case.set("pss.1.K", 10).set("machines.2.p", "0.65GW")
    """
    if not isinstance(path, str | Mapping):
        raise paths.not_a_path(path)
    values = path if isinstance(path, Mapping) else {path: value}
    parts: dict[str, Any] = {}
    devices = {model: dict(rows) for model, rows in case.devices.items()}
    for where, new in values.items():
        if where in paths.ABOUT:
            parts[where] = paths.about(where, new)
            continue
        table, key, f = paths.resolve(case, where)
        i = keys.row(case, table, key)
        if table in TABLES:
            rows = list(parts.get(table, getattr(case, table)))
            rows[i] = rows[i]._replace(**{f.name: paths.value(case, where, f, new, rows[i])})
            parts[table] = tuple(rows)
        else:
            own = list(devices[table])[i]
            devices[table][own] = devices[table][own]._replace(**{f.name: paths.value(case, where, f, new)})
    try:
        return replace(case, devices=devices, **parts)
    except CaseError as error:
        given = [f"{where} = {new if isinstance(new, str) else shown(new)}" for where, new in values.items()]
        raise CaseError(f"{case.name} cannot have {', '.join(given)}: {error}") from None


def with_load(
    case: Case,
    bus: int,
    p: str | float | None = None,
    q: str | float | None = None,
    *,
    id: str | None = None,
    **shares: float,
) -> Case:
    """The case with the load at a bus changed, or with a new load if the bus has none.

    Parameters
    ----------
    case : Case
        The system.
    bus : int
        Bus number.
    p, q : float or str
        Active (MW) and reactive (Mvar) power consumed, or text with a unit. A value that is omitted is unchanged, or 0
        for a new load.
    id : str, optional
        Identifier of the load, at a bus with several: the load with this identifier is changed, or a new one added.
    **shares : float
        Other columns of the loads table: `p_power`, `q_power`, `p_current`, `q_current`, `v_low`, `model_share`.

    Raises
    ------
    StudyError
        If the bus does not exist, or has several loads of which `id` does not choose one.
    """
    keys.row(case, "buses", bus)
    others = [name for name in fields(Load) if name not in ("bus", "p", "q", "id")]
    for name in shares:
        if name not in others:
            raise StudyError(f"Loads have no column {name!r}; {keys.near(name, others)}")
    given: dict[str, Any] = dict(shares)
    given |= {} if p is None else {"p": megawatts(p)}
    given |= {} if q is None else {"q": megavars(q)}
    here = [i for i, load in enumerate(case.loads) if load.bus == bus and id in (None, load.id)]
    if len(here) > 1:
        named = ", ".join(repr(case.loads[i].id) for i in here)
        raise StudyError(
            f"Bus {bus} of {case.name} has {len(here)} loads; give the id of one ({named}), or change one with "
            f"set('loads.{bus}#2.p', ...)."
        )
    loads = list(case.loads)
    if here:
        loads[here[0]] = loads[here[0]]._replace(**given)
    else:
        loads.append(Load(bus, 0.0, 0.0, id=id or "")._replace(**given))
    return replace(case, loads=tuple(loads))


def trip_machine(case: Case, number: int) -> Case:
    """The case with a machine out of service, together with its controls and storage devices.

    Its bus becomes a pq bus if no other machine is connected to it.

    Parameters
    ----------
    case : Case
        The system.
    number : int
        Machine number.

    Raises
    ------
    StudyError
        If there is no such machine, or it is the only one at the swing bus.
    """
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
    """The case with every machine a constant voltage behind x'd, without controls (GENCLS).

    Converters, loads and shunts keep their models. Raises `StudyError` for a machine whose model has no x'd.
    """
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
    ordered: dict[keys.Key, Any] = {m.machine: machines[m.machine] for m in case.machines if m.machine in machines}
    return replace(case, devices=others | {"gencls": ordered}, title=f"{case.title}, classical machines")
