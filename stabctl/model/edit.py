"""Edited cases: values by their path, devices added or removed, loads added, machines out of service.

Paths to values are `pss.1.K`, `machines.2.p`, `branches.7-8#2.x`, `frequency_hz`.
"""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from stabctl._util.errors import CaseError, StudyError, shown
from stabctl._util.schema import Field, fields
from stabctl._util.units import megavars, megawatts, quantity
from stabctl._util.wording import near

from . import fleet, naming, tables
from .case import Case
from .tables import TABLES, Load, OutOfService

ABOUT = {"name": "-", "title": "-", "source": "-", "base_mva": "MVA", "frequency_hz": "Hz"}  # of case.toml -> unit


def set_value(case: Case, path: str | Mapping[str, Any], value: Any = None) -> Case:
    """The case with one value changed, as if its file had been edited.

    Parameters
    ----------
    case : Case
        The system.
    path : str or mapping
        `table.key.column`: "pss.1.K", "machines.2.p", "loads.7.p", "branches.7-8#2.x", "storage.14@33.rating"; or
        "frequency_hz", "base_mva", "name", "title", "source". A mapping of paths to values changes all at once.
    value : float, int or str, optional
        In the unit of the column, or text with a unit: "50MW", "100ms".

    Raises
    ------
    StudyError
        If the case has no such table, row or column; it names similar ones.
    CaseError
        If the case would not be valid.

    Examples
    --------
    >>> st.load("two_area").set("pss.1.K", 10).set("machines.2.p", "0.65GW").machine(2).p
    650.0
    """
    if not isinstance(path, str | Mapping):
        raise not_a_path(path)
    values = path if isinstance(path, Mapping) else {path: value}
    parts: dict[str, Any] = {}
    devices = {model: dict(rows) for model, rows in case.devices.items()}
    names: dict[tuple[str, int, str], str] = {}
    for where, new in values.items():
        if where in ABOUT:
            parts[where] = about(where, new)
            continue
        table, key, f = resolve(case, where)
        i = naming.row(case, table, key)
        if (other := names.setdefault((table, i, f.name), where)) != where:
            raise StudyError(f"{other} and {where} are the same value; give one of them.")
        if table in TABLES:
            rows = list(parts.get(table, getattr(case, table)))
            rows[i] = rows[i]._replace(**{f.name: value_at(case, where, f, new, rows[i])})
            parts[table] = tuple(rows)
        else:
            own = list(devices[table])[i]
            devices[table][own] = devices[table][own]._replace(**{f.name: value_at(case, where, f, new)})
    try:
        return replace(case, devices=devices, **parts)
    except CaseError as error:
        given = [f"{where} = {new if isinstance(new, str) else shown(new)}" for where, new in values.items()]
        raise CaseError(f"{case.name} cannot have {', '.join(given)}: {error}") from None


def not_a_path(path: object) -> StudyError:
    """The error for text that is not a path."""
    known = ", ".join(ABOUT)
    return StudyError(
        f"{shown(path)} is not a value of a case; write table.key.column, such as pss.1.K, or one of {known}."
    )


def about(name: str, given: Any) -> Any:
    """A value of an entry of case.toml, text with a unit as a number."""
    return _read(name, given, ABOUT[name]) if isinstance(given, str) and ABOUT[name] != "-" else given


def resolve(case: Case, path: object) -> tuple[str, str, Field]:
    """Table, key and column of a path; a key (the name of a link) may hold dots, a column be a name or a header.

    Raises `StudyError` for a table or column that the case does not have, or if it is not a path.
    """
    table, _, rest = path.partition(".") if isinstance(path, str) else ("", "", "")
    key, _, column = (part.strip() for part in rest.rpartition("."))
    if not (table and key and column):
        raise not_a_path(path)
    table = naming.known_table(case, table.strip())
    known = fields(TABLES[table] if table in TABLES else tables.models()[table].Par)
    for f in known.values():
        if column in (f.name, f.column):
            return table, key, f
    raise StudyError(f"{table} has no column {column!r}; {_near(column, known)}")


def _near(column: str, known: Mapping[str, Field]) -> str:
    """End of a sentence: the columns written like this or with it in their meaning, else all."""
    like = difflib.get_close_matches(column, list(known), 3, 0.6)
    like += [name for name, f in known.items() if column.lower() in f.meaning.lower() and name not in like]
    return f"did you mean {' or '.join(like)}?" if like else f"it has {', '.join(known)}."


def value_at(case: Case, path: str, f: Field, given: Any, row: Any = None) -> Any:
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


def with_device(case: Case, model: str, at: int | str | Iterable[int | str], /, **values: Any) -> Case:
    """The case with a device added at a machine, or replaced.

    A machine, converter, exciter or governor replaces the device with the same role; a stabilizer replaces only one of
    the same model. A converter takes the place of a machine, and its exciter, governor and stabilizers go with it; a
    machine takes the place of a converter with its controls.

    Parameters
    ----------
    case : Case
        The system.
    model : str
        Name of the model, as `stabctl models` lists them, or of a registered device: "pss", "exst3".
    at : int, str or iterable
        Machine number or, for load and shunt models, bus number, or "7#2" for the second load at bus 7; or several.
    **values : float, int or str
        Its parameters, in their units, or text with a unit: `K=20, Tw="10s"`. Those with a default may be left out.

    Raises
    ------
    StudyError
        If there is no such model or machine, or a parameter is missing or not known.
    CaseError
        If the case would not be valid with this device.

    Examples
    --------
    >>> case = st.load("two_area_thyristor").with_device("pss", 2, K=20, Tw="10s", T1=0.05, T2=0.02, T3=3.0, T4=5.4)
    >>> case.devices["pss"][2].K
    20.0
    """
    _known(model)
    known, places = fields(tables.models()[model].Par), _places(case, model, at)
    for name in values:
        if name not in known:
            raise StudyError(f"{model} has no parameter {name!r}; {near(name, known)}")
    missing = [name for name, f in known.items() if f.required and name not in values]
    if missing:
        raise StudyError(f"{model} needs {', '.join(missing)}; see stabctl models {model}.")
    read = {name: value_at(case, f"{model}.{name}", known[name], given) for name, given in values.items()}
    role = tables.role(model)
    others: tuple[str, ...] = (model,)
    if role in tables.UNIT_ROLES:
        others = tuple(tables.of_role(*tables.UNIT_ROLES, *tables.LEFT_BY[role]))
    elif role in (*tables.SINGLE_ROLES, "load"):
        others = tuple(tables.of_role(role))
    devices = _left(case, others, places)
    rows = {**case.devices.get(model, {}), **dict.fromkeys(places, tables.parameters(model, **read))}
    devices[model] = {key: par for key, par in rows.items() if key in places or key in devices.get(model, {})}
    return _changed(case, devices, model, places)


def without_device(case: Case, model: str, at: int | str | Iterable[int | str] | None = None) -> Case:
    """The case without a device, or without all devices of a model.

    Parameters
    ----------
    case : Case
        The system.
    model : str
        Name of the model: "pss".
    at : int, str or iterable, optional
        Machine or bus number, or "7#2" for the second load at bus 7, or several; by default every one of the model.

    Raises
    ------
    StudyError
        If the case has no such device.
    CaseError
        If the case would not be valid without it.

    Examples
    --------
    >>> list(st.load("two_area").without_device("pss").devices)
    ['genrou', 'sexs', 'tgov']
    """
    _known(model)
    naming.known_table(case, model)
    places = [_place(model, key) for key in case.devices[model]] if at is None else _places(case, model, at)
    for place in places:
        naming.row(case, model, place)
    return _changed(case, _left(case, (model,), places), f"no {model}", places)


def _known(model: object) -> None:
    if not isinstance(model, str) or model not in tables.models():
        raise StudyError(f"There is no model {shown(model)}; choose one of {', '.join(tables.models())}.")


def _places(case: Case, model: str, at: Any) -> list[naming.Key]:
    """Keys of loads, or numbers of machines or buses, all of which the case has."""
    places = list(at) if isinstance(at, Iterable) and not isinstance(at, str) else [at]
    if tables.role(model) == "load":
        known = naming.keys(case, "loads")
        return [known[naming.row(case, "loads", place)] for place in places]
    table = "buses" if tables.at_bus(model) else "machines"
    return [getattr(case, table)[naming.row(case, table, place)][0] for place in places]


def _left(case: Case, models: Iterable[str], places: list[naming.Key]) -> dict[str, dict[naming.Key, Any]]:
    """The devices without those of some models at some loads, machines or buses."""
    left = {
        model: {k: par for k, par in rows.items() if model not in models or _place(model, k) not in places}
        for model, rows in case.devices.items()
    }
    return {model: rows for model, rows in left.items() if rows}


def _place(model: str, key: naming.Key) -> naming.Key:
    """What a device stands at: a load by its key, a machine or bus by its number."""
    return key if tables.role(model) == "load" else naming.number(key)


def _changed(case: Case, devices: dict[str, dict[naming.Key, Any]], what: str, places: Iterable[naming.Key]) -> Case:
    try:
        return replace(case, devices=devices)
    except CaseError as error:
        at = ", ".join(str(naming.called(case, what.split()[-1], place)) for place in places)
        raise CaseError(f"{case.name} cannot have {what} at {at}: {error}") from None


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
    p, q : float or str, optional
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

    Examples
    --------
    >>> st.load("two_area").with_load(7, p="1GW").loads[0].p
    1000.0
    """
    naming.row(case, "buses", bus)
    others = [name for name in fields(Load) if name not in ("bus", "p", "q", "id")]
    for name in shares:
        if name not in others:
            raise StudyError(f"Loads have no column {name!r}; {near(name, others)}")
    given: dict[str, Any] = dict(shares)
    given |= {} if p is None else {"p": megawatts(p)}
    given |= {} if q is None else {"q": megavars(q)}
    here = [i for i, load in enumerate(case.loads) if load.bus == bus and id in (None, load.id)]
    ids, loads = [*dict.fromkeys(case.loads[i].id for i in here)], list(case.loads)
    total = {x: sum(getattr(loads[i], x) for i in here) for x in given if x in ("p", "q")}
    parts = len(here) > 1 and len(ids) == 1 and ids[0] and not shares and all(total.values())
    if len(here) > 1 and not parts:
        named = f"give the id of one ({', '.join(map(repr, ids))}), or " if len(ids) > 1 else ""
        raise StudyError(
            f"Bus {bus} of {case.name} has {len(here)} loads; {named}change one with set('loads.{bus}#2.p', ...)."
        )
    if parts:  # of one load: constant power, current and admittance
        for i in here:
            loads[i] = loads[i]._replace(**{x: getattr(loads[i], x) * value / total[x] for x, value in given.items()})
    elif here:
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

    Examples
    --------
    >>> [row.machine for row in st.load("wscc9").trip_machine(3).machines]
    [1, 2]
    """
    machine = case.machine(number)
    number = machine.machine
    machines = tuple(m for m in case.machines if m is not machine)
    buses = case.buses
    if machine.bus not in {m.bus for m in machines}:
        i = naming.row(case, "buses", machine.bus)
        if buses[i].kind == "swing":
            raise StudyError(
                f"Machine {machine.called} of {case.name} is the only one at the swing bus {machine.bus}; make another "
                "bus the swing bus first."
            )
        buses = (*buses[:i], buses[i]._replace(kind="pq"), *buses[i + 1 :])
    devices = {
        model: {key: par for key, par in rows.items() if tables.at_bus(model) or naming.number(key) != number}
        for model, rows in case.devices.items()
    }
    storage = tuple(s for s in case.storage if s.machine != number)
    out = (*case.out_of_service, OutOfService("machine", machine.bus, id=str(machine.called)))
    return replace(case, buses=buses, machines=machines, devices=devices, storage=storage, out_of_service=out)


def classical(case: Case) -> Case:
    """The case with every machine a constant voltage behind x'd, without controls (GENCLS).

    Converters, loads and shunts keep their models. Raises `StudyError` for a machine whose model has no x'd.

    Examples
    --------
    >>> list(st.load("two_area").classical().devices)
    ['gencls']
    """
    machines: dict[naming.Key, Any] = {}
    for model in tables.of_role("machine"):
        for key, par in case.devices.get(model, {}).items():
            if model == "gencls":
                machines[key] = par
            elif {"H", "D", "ra", "x1d"} <= set(par._fields):
                machines[key] = tables.parameters("gencls", H=par.H, D=par.D, ra=par.ra, x1d=par.x1d)
            else:
                called = naming.called(case, model, key)
                raise StudyError(f"Machine {called} of {case.name} is a {model}, which has no classical equivalent.")
    others = {
        model: {key: par for key, par in rows.items() if tables.at_bus(model) or naming.number(key) not in machines}
        for model, rows in case.devices.items()
    }
    ordered: dict[naming.Key, Any] = {m.machine: machines[m.machine] for m in case.machines if m.machine in machines}
    return replace(case, devices=others | {"gencls": ordered}, title=f"{case.title}, classical machines")
