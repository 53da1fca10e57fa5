"""Devices made of published parts: the records of a storage device and of its converter as one."""

import difflib
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from math import sqrt
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.schema import fields
from stabctl._util.validation import Invalid, checked
from stabctl.devices.ports import fixed

from . import order

_SETTING = re.compile(r"([A-Za-z][A-Za-z0-9_]*)\s*=\s*([^\s,;=]+)")


class Kit(NamedTuple):
    """The published models that a converter of storage consists of."""

    name: str  # what they are called in messages
    parts: tuple[Any, ...]  # their parameter records
    defaults: Mapping[str, float] = {}  # where those of the parts are not for storage
    without: Collection[str] = ()  # parameters that cannot be set
    errors: Callable[[Mapping[str, float]], Iterator[tuple[str, str]]] = lambda _values: iter(())  # name and message
    finite: bool = False  # whether the energy of the store must be limited


class Rated(NamedTuple):
    """What a converter of storage has."""

    rated: Annotated[float, "-", "power rating over the MVA of the converter"]


class Input(NamedTuple):
    """Signals at a device behind a converter."""

    order: Annotated[float, "-", "share of the rating to absorb", fixed(0.0)]
    order_q: Annotated[float, "-", "reactive power to absorb, over the power rating", fixed(0.0)]
    order_v: Annotated[float, "pu", "change of the voltage reference", fixed(0.0)]


class Output(NamedTuple):
    """Power at the terminals, charge, and currents of a device behind a converter."""

    P: Annotated[float, "pu", "power absorbed, system base"]
    Q: Annotated[float, "pu", "reactive power absorbed, system base"]
    charge: Annotated[float, "-", "state of charge; 0 if the capacity is unlimited"]
    Ip: Annotated[float, "pu", "active current delivered, converter base"]
    Iq: Annotated[float, "pu", "reactive current delivered, converter base"]


def joined(*records: type) -> Any:
    """A record with the fields of several, each field once."""
    found = {name: hint for record in records for name, hint in get_type_hints(record, include_extras=True).items()}
    return NamedTuple("Joined", list(found.items()))  # type: ignore[misc]


Common: Any = joined(order.Par, Rated)  # parameters of every device behind a converter


def from_row(kit: Kit, record: Any, device: Any, base_mva: float) -> Any:
    """Parameters of a device from its row of storage.csv; those filled from the case, such as V0, are 0 before."""
    rating, capacity = device.rating, device.energy * 3600 / base_mva
    known = parameters(kit, device.converter) | {
        "mva": (device.mva or rating) / base_mva,
        "rating": rating / base_mva,
        "inverse": base_mva / rating if rating else 0.0,
        "rated": rating / device.mva if device.mva else 1.0,
        "Smax": device.mva / rating if device.mva and rating else 1.0,
        "Tlag": device.lag,
        "ramp": device.ramp / rating if rating else 0.0,
        "floor": 0.0 if capacity else -np.inf,
        "capacity": capacity or np.inf,
        "stored": capacity * device.charge,
        "efficiency": sqrt(device.efficiency),
        "V0": 1.0,
    }
    return record(**{name: known.get(name, 0.0) for name in record._fields})


def settings(text: str) -> Iterator[tuple[str, str]]:
    """Names and values in `Imax=1.3, Lvplsw=0`. Raises `StudyError` for anything else."""
    for part in re.split(r"[\s,;]+", re.sub(r"\s*=\s*", "=", text.strip())):
        match = _SETTING.fullmatch(part)
        if part and not match:
            raise StudyError(f"{shown(part)} does not set a parameter; write Imax=1.3 Lvplsw=0.")
        if match:
            yield match[1], match[2]


def parameters(kit: Kit, text: str) -> dict[str, float]:
    """Parameters of the parts of a device by name: their defaults, those of the device, and the settings of the user.

    Raises
    ------
    StudyError
        For a parameter that no part has, or a value that is not allowed.
    """
    known = {name: f for part in kit.parts for name, f in fields(part).items() if name not in kit.without}
    given: dict[str, float] = {}
    if text and not known:
        raise StudyError(f"{shown(text)} applies only to devices behind a converter; set storage_model to regc.")
    for name, value in settings(text):
        if name not in known:
            near = difflib.get_close_matches(name, known, 3) or list(known)
            raise StudyError(f"There is no parameter {shown(name)} of {kit.name}; choose one of {', '.join(near)}.")
        try:
            given[name] = float(value)
        except ValueError:
            raise StudyError(f"{name} = {shown(value)} must be {known[name].expected()}.") from None
    values: dict[str, float] = {}
    for part in kit.parts:
        own = dict.fromkeys((name for name in part._fields if name not in fields(part)), 0.0)
        par = part(**own, **{n: v for n, v in {**kit.defaults, **given}.items() if n in fields(part)})
        try:
            (par,) = checked(part, (par,))
        except Invalid as fault:
            raise StudyError(f"{fault.field.name} = {shown(fault.value)} must be {fault.expected}.") from None
        for name, wrong in getattr(par, "errors", tuple)():
            raise StudyError(f"{name} = {getattr(par, name):g} {wrong}.")
        for name in fields(part):
            if name.endswith("min") and getattr(par, name) > getattr(
                par, top := name.removesuffix("min") + "max", np.inf
            ):
                raise StudyError(f"{name} = {getattr(par, name):g} is above {top} = {getattr(par, top):g}.")
        values |= {name: value for name, value in par._asdict().items() if name in fields(part)}
    for name, wrong in kit.errors(values):
        raise StudyError(f"{name} = {values[name]:g} {wrong}.")
    return values
