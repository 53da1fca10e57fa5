"""Channels of a run: what is recorded of every machine, bus and storage device, by name: `voltage:16`, `speed`."""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.wording import near
from stabctl.model import naming
from stabctl.model.case import Case

from .arrays import Arrays


class Quantity(NamedTuple):
    """A quantity that is recorded."""

    of: str  # dimension: machine (with a rotor), unit, bus, or device (storage)
    unit: str  # in Python
    meaning: str
    values: Callable[[Arrays], np.ndarray]  # (rows, all of that dimension)
    column: str  # of a table, with the unit there
    factor: float = 1.0  # from the unit in Python to that of tables
    while_on: bool = False  # nothing after a machine is disconnected


DEGREES = 180 / np.pi
QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        "speed": Quantity("machine", "pu", "rotor speed", lambda a: a.speed, "speed_pu", while_on=True),
        "angle": Quantity(
            "machine",
            "rad",
            "rotor angle relative to the synchronous frame",
            lambda a: a.angle,
            "angle_deg",
            DEGREES,
            while_on=True,
        ),
        "field_voltage": Quantity("machine", "pu", "field voltage", lambda a: a.Efd, "efd_pu", while_on=True),
        "mechanical_power": Quantity("machine", "pu", "mechanical power, machine base", lambda a: a.Pm, "pm_pu"),
        "electrical_power": Quantity("unit", "MW", "terminal power", lambda a: a.P, "p_mw"),
        "voltage": Quantity("bus", "pu", "voltage magnitude", lambda a: np.abs(a.V), "v_pu"),
        "voltage_angle": Quantity("bus", "rad", "voltage angle", lambda a: np.angle(a.V), "v_angle_deg", DEGREES),
        "storage": Quantity(
            "device", "MW", "power of the storage device, positive when absorbing", lambda a: a.storage, "storage_mw"
        ),
        "storage_order": Quantity(
            "device", "1", "order of the storage device, in ratings", lambda a: a.order, "storage_order"
        ),
        "storage_energy": Quantity("device", "MWh", "energy in the storage device", lambda a: a.energy, "storage_mwh"),
    }
)
TABLE = ("speed", "angle", "field_voltage", "voltage", "storage")  # what a table holds if nothing is chosen
TABLES = {"machine": "machines", "unit": "machines", "bus": "buses", "device": "storage"}  # dimension -> table


class Channel(NamedTuple):
    """A quantity of one machine, bus or storage device."""

    quantity: str
    row: int  # of the machine, bus or device in its table
    place: int  # among the values of the quantity
    label: str  # of the machine, bus or device


def chosen(case: Case, wanted: str | Iterable[str], rotors: Iterable[int]) -> tuple[Channel, ...]:
    """The channels that a text such as "voltage:16,speed" names; a quantity alone means all of it.

    Parameters
    ----------
    case
        The system.
    wanted
        Names separated by commas, or a list of names.
    rotors
        Rows of the machines that have a rotor.

    Raises
    ------
    StudyError
        If there is no such quantity, machine, bus or device, or nothing is named.
    """
    found: dict[Channel, None] = {}
    names = [part for part in naming.listed(wanted) if part] if isinstance(wanted, str) else wanted
    if not isinstance(names, Iterable):
        raise StudyError(f"{shown(wanted)} names no quantities; write 'voltage:16,speed', for example.")
    for text in names:
        name, _, place = str(text).strip().partition(":")
        if name not in QUANTITIES:
            raise StudyError(f"{shown(name)} is not a quantity of a run; {near(name, QUANTITIES)}")
        of = QUANTITIES[name].of
        labels = _labels(case, of)
        rows = [*rotors] if of == "machine" else [*range(len(labels))]
        one = [naming.row(case, TABLES[of], place)] if place else rows
        if not one:
            instead = "; give storage='50MW', for example" if of == "device" else ""
            raise StudyError(f"{case.name} has no {'storage' if of == 'device' else TABLES[of]} to show{instead}.")
        if one[0] not in rows:
            raise StudyError(f"Machine {place} of {case.name} has no rotor, so it has no {name}; choose another.")
        found |= {Channel(name, row, rows.index(row), str(labels[row])): None for row in one}
    if not found:
        raise StudyError(f"No channel is named; write voltage:16,speed:2, of {', '.join(QUANTITIES)}.")
    return tuple(found)


def _labels(case: Case, of: str) -> list[int | str]:
    """What machines, buses or storage devices are called in tables."""
    if of == "bus":
        return [b.bus for b in case.buses]
    if of == "device":
        return [*naming.keys(case, "storage")]
    return [m.called for m in case.machines]
