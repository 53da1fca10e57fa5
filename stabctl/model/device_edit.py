"""Cases with a device added, replaced or removed."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from stabctl.errors import CaseError, StudyError, shown
from stabctl.schema import fields

from . import catalog, keys, paths
from .case import Case


def with_device(case: Case, model: str, at: int | str | Iterable[int | str], **values: Any) -> Case:
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
    >>> case.with_device("pss", 2, K=20, Tw="10s", T1=0.05, T2=0.02, T3=3.0, T4=5.4)
    """
    _known(model)
    known, places = fields(catalog.models()[model].Par), _places(case, model, at)
    for name in values:
        if name not in known:
            raise StudyError(f"{model} has no parameter {name!r}; {keys.near(name, known)}")
    missing = [name for name, f in known.items() if f.required and name not in values]
    if missing:
        raise StudyError(f"{model} needs {', '.join(missing)}; see stabctl models {model}.")
    read = {name: paths.value(case, f"{model}.{name}", known[name], given) for name, given in values.items()}
    role = catalog.role(model)
    others: tuple[str, ...] = (model,)
    if role in catalog.UNIT_ROLES:
        others = tuple(catalog.of_role(*catalog.UNIT_ROLES, *catalog.LEFT_BY[role]))
    elif role in (*catalog.SINGLE_ROLES, "load"):
        others = tuple(catalog.of_role(role))
    devices = _left(case, others, places)
    rows = {**case.devices.get(model, {}), **dict.fromkeys(places, catalog.parameters(model, **read))}
    devices[model] = {key: par for key, par in rows.items() if key in places or key in devices.get(model, {})}
    return _changed(case, devices, f"{model} at {', '.join(map(str, places))}")


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
    """
    _known(model)
    keys.known_table(case, model)
    places = [_place(model, key) for key in case.devices[model]] if at is None else _places(case, model, at)
    for place in places:
        keys.row(case, model, place)
    return _changed(case, _left(case, (model,), places), f"no {model} at {', '.join(map(str, places))}")


def _known(model: object) -> None:
    if not isinstance(model, str) or model not in catalog.models():
        raise StudyError(f"There is no model {shown(model)}; choose one of {', '.join(catalog.models())}.")


def _places(case: Case, model: str, at: Any) -> list[keys.Key]:
    """Keys of loads, or numbers of machines or buses, all of which the case has."""
    places = list(at) if isinstance(at, Iterable) and not isinstance(at, str) else [at]
    if catalog.role(model) == "load":
        known = keys.keys(case, "loads")
        return [known[keys.row(case, "loads", place)] for place in places]
    table = "buses" if catalog.at_bus(model) else "machines"
    return [getattr(case, table)[keys.row(case, table, place)][0] for place in places]


def _place(model: str, key: keys.Key) -> keys.Key:
    """What a device stands at: a load by its key, a machine or bus by its number."""
    return key if catalog.role(model) == "load" else keys.number(key)


def _left(case: Case, models: Iterable[str], places: list[keys.Key]) -> dict[str, dict[keys.Key, Any]]:
    """The devices without those of some models at some loads, machines or buses."""
    left = {
        model: {k: par for k, par in rows.items() if model not in models or _place(model, k) not in places}
        for model, rows in case.devices.items()
    }
    return {model: rows for model, rows in left.items() if rows}


def _changed(case: Case, devices: dict[str, dict[keys.Key, Any]], what: str) -> Case:
    try:
        return replace(case, devices=devices)
    except CaseError as error:
        raise CaseError(f"{case.name} cannot have {what}: {error}") from None
