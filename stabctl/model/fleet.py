"""Fleets of storage devices: one at every machine's storage bus, or at the machines chosen."""

import re
from collections.abc import Iterable, Mapping
from numbers import Real
from typing import Any, NamedTuple

from stabctl._util.errors import StudyError, shown
from stabctl._util.schema import fields
from stabctl._util.units import quantity, rating
from stabctl._util.wording import near
from stabctl.devices import every
from stabctl.devices.storage import MODELS, joined

from . import checks, naming, powerflow
from .case import Case
from .powerflow import PowerFlow
from .tables import Machine, Storage

_PLACE = re.compile(r"\s*([0-9]{1,18}(?:/.+?)?)\s*(?:@([0-9]{1,18}))?\s*")

LARGEST = 1e6  # MW   of one device
Fleet = str | float | Mapping[int | str, str | float] | Iterable[Storage] | Storage


def with_storage(case: Case, sizes: Fleet, flow: PowerFlow | None = None, **options: Any) -> Case:
    """The case with these storage devices in place of its own.

    Parameters
    ----------
    case : Case
        The system.
    sizes : str, float, mapping or iterable of Storage
        "50MW", "5%mva" or "5%dispatch" (or a number of MW) at every machine's storage bus; at chosen machines
        "14=50MW,13@33=20MW" or {14: "50MW", "13@33": "20MW"} (13@33: of machine 13, at bus 33); rows; or "none".
    flow : PowerFlow, optional
        The power flow that "%dispatch" refers to; solved when it is needed and not given.
    **options : float or str
        Other columns of every device: `characteristic`, `energy`, `charge`, `ramp`, `lag`, `efficiency`, `mva` ("120%"
        of the rating, "0.8pu": the rating at this voltage within the current limit, or MVA), `storage_model` ("ideal",
        "regc", "regc_b", "regc_c", the same with "_repc", "regfm", "regfm_b1") and `converter` ("Imax=1.3 Lvplsw=0").

    Raises
    ------
    StudyError, CaseError
        If a machine, bus, size or option is not allowed.

    Examples
    --------
    >>> [device.rating for device in st.load("two_area").with_storage("1=50MW,4=5%mva", energy=0.1).storage]
    [50.0, 45.0]
    """
    new = extended(case, devices(case, sizes, flow, options))
    checks.storage(new)  # nothing else has changed
    return new


def extended(case: Case, rows: Iterable[Storage]) -> Case:
    """The case with exactly these storage devices, of which two may be alike, as when one is as large as another."""
    new = object.__new__(Case)
    vars(new).update(vars(case), storage=checks.values("storage", Storage, tuple(rows)))
    return new


def resized(device: Storage, rating: float) -> Storage:
    """The device with another power rating (MW), and MVA in the same proportion."""
    if rating == device.rating:
        return device
    mva = device.mva * rating / device.rating if device.rating else device.mva
    return device._replace(rating=rating, mva=mva)


def devices(
    case: Case, sizes: Fleet, flow: PowerFlow | None = None, options: Mapping[str, Any] | None = None
) -> tuple[Storage, ...]:
    """The storage devices given by a user, as in `with_storage`."""
    given = _options(options or {})
    if isinstance(sizes, str) and sizes.strip() == "none":
        return ()
    if isinstance(sizes, Mapping) or (isinstance(sizes, str) and "=" in sizes):
        return chosen(case, sizes, flow, **given)
    if isinstance(sizes, str | Real):
        return everywhere(case, sizes, flow, **given)
    rows = (sizes,) if isinstance(sizes, Storage) else tuple(sizes) if isinstance(sizes, Iterable) else (None,)
    found = [s for s in rows if isinstance(s, Storage)]
    if len(found) < len(rows):
        raise StudyError(
            f"{shown(sizes, 100)} is not a fleet of storage devices; give '50MW' at every machine, "
            "'14=50MW,13@33=20MW', {14: '50MW'}, or rows of Storage."
        )
    return tuple(_equipped(s, given) for s in found)


def everywhere(case: Case, size: str | float, flow: PowerFlow | None = None, **options: Any) -> tuple[Storage, ...]:
    """A device of one size (50MW, 5%mva, 5%dispatch) at every machine's storage bus."""
    given = _options(options)
    return tuple(
        _equipped(Storage(m.machine, m.storage_bus, megawatts(case, m, size, flow)), given) for m in case.machines
    )


def chosen(
    case: Case, sizes: str | Mapping[int | str, str | float], flow: PowerFlow | None = None, **options: Any
) -> tuple[Storage, ...]:
    """Devices at the machines named, `14=50MW,13@33=20MW`: machine, bus where it is not the storage bus, size."""
    given = _options(options)
    found: list[Storage] = []
    for place, size in sizes.items() if isinstance(sizes, Mapping) else map(_split, naming.listed(sizes)):
        match = _PLACE.fullmatch(str(place))
        if not match:
            raise StudyError(
                f"{shown(place)} does not describe a storage device; write 14=50MW, or 14@33=50MW for bus 33."
            )
        machine = case.machine(match[1].strip())
        bus = int(match[2]) if match[2] else machine.storage_bus
        naming.row(case, "buses", bus)
        if any((s.machine, s.bus) == (machine.machine, bus) for s in found):
            raise StudyError(f"Machine {machine.called} has two storage devices at bus {bus}; give it one.")
        found.append(_equipped(Storage(machine.machine, bus, megawatts(case, machine, size, flow)), given))
    return tuple(found)


def megawatts(case: Case, machine: Machine, size: str | float, flow: PowerFlow | None = None) -> float:
    """A size (50MW, 5%mva, 5%dispatch, a number of MW) at a machine of the case, MW.

    Percentages of dispatch refer to the power in the power flow `flow`, which is solved if it is not given; they give 0
    for a machine that consumes power. Raises `StudyError` if it is not a size.
    """
    value, unit = rating(size)
    if unit == "MW" and value > LARGEST:
        raise StudyError(f"A storage device of {value:g} MW is not realistic; give at most {LARGEST:g} MW.")
    if unit == "%mva":
        return value * machine.base / 100
    if unit == "%dispatch":
        flow = flow or powerflow.solve(case)
        return value * max(float(flow.S[case.machines.index(machine)].real), 0.0) * case.base_mva / 100
    return value


def _split(part: str) -> tuple[str, str]:
    place, equals, size = part.rpartition("=")
    if not equals:
        raise StudyError(f"{shown(part)} does not describe a storage device; write it as 14=50MW or 14@33=50MW.")
    return place, size


def _equipped(device: Storage, options: Mapping[str, Any]) -> Storage:
    """The device with other columns; MVA may be in percent of its rating, or for a voltage."""
    mva = options.get("mva")
    if isinstance(mva, Percent):
        options = {**options, "mva": mva.share * device.rating}
    elif isinstance(mva, Voltage):
        options = {**options, "mva": device.rating * max(1.0, 1 / (_current_limit(options) * mva.pu))}
    made = device._replace(**options)
    if not made.energy and made.storage_model in MODELS and every()[made.device].kit.finite:
        raise StudyError(
            f"The power of a {made.storage_model} depends on its stored energy, which must be limited; give its "
            "capacity: energy='5kWh', --storage-energy 5kWh, or storage_energy_mwh = '5kWh' of a sweep."
        )
    return made


class Percent(NamedTuple):
    """MVA in relation to the power rating of a device."""

    share: float


class Voltage(NamedTuple):
    """As many MVA as let the current limit give the rated power at this voltage."""

    pu: float


def _current_limit(options: Mapping[str, Any]) -> float:
    """The current limit of a converter, pu."""
    model = options.get("storage_model", "ideal")
    device = every()[MODELS[model if model in MODELS else "ideal"].device]
    if not device.current_limit:
        raise StudyError("MVA for a voltage need a converter, which has a current limit; give a storage_model.")
    return float(joined.parameters(device.kit, options.get("converter", ""))[device.current_limit])


def _read(name: str, value: Any, unit: str) -> Any:
    """A column of a device from text."""
    text = value.strip()
    relative = next((suffix for suffix in ("%", "pu") if text.endswith(suffix)), "")
    if name != "mva" or not relative:
        return quantity(value, unit)
    try:
        size = float(text.removesuffix(relative))
    except ValueError:
        size = 0.0
    if relative == "%" and 100 <= size <= 10000:
        return Percent(size / 100)
    if relative == "pu" and 0.1 <= size <= 1:
        return Voltage(size)
    raise StudyError(
        f"mva = {shown(value)} is not allowed; give at least 100%, such as 120%, a voltage from 0.1pu to 1pu, or 60MVA."
    )


def _options(options: Mapping[str, Any]) -> dict[str, Any]:
    """Columns of a device, text with a unit as the number it means."""
    known = {name: f for name, f in fields(Storage).items() if name not in ("machine", "bus", "rating")}
    for name in options:
        if name not in known:
            raise StudyError(f"A storage device has no option {name!r}; {near(name, known)}")
    return {
        name: _read(name, value, known[name].unit) if isinstance(value, str) and known[name].kind is float else value
        for name, value in options.items()
    }
