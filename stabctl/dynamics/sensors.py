"""The sensors of a system: one at every bus that a remote input reads."""

from collections.abc import Mapping
from functools import cache
from typing import Any, get_args, get_type_hints

import numpy as np

from stabctl import devices
from stabctl.devices.device import Device
from stabctl.devices.ports import At, Port
from stabctl.errors import EquilibriumError
from stabctl.model.case import Case
from stabctl.model.network import Network

from .rows import NO_UNIT, Row


@cache
def inputs(device: Device) -> dict[str, Any]:
    """Inputs of a device, each with its marker (Port, At) or None."""
    hints = get_type_hints(device.Input, include_extras=True)
    return {
        name: next((m for m in get_args(hints[name]) if isinstance(m, Port | At)), None)
        for name in device.Input._fields
    }


def bus_of(case: Case, net: Network, at: At, row: Row) -> int:
    """Row of the bus whose number is a device's parameter; its own bus if that is 0."""
    number = int(getattr(row.par, at.place))
    if number and number not in net.place:
        raise EquilibriumError(
            f"There is no bus {number} in {case.name}, the {at.place} of {row.label}; choose another."
        )
    return net.place[number] if number else row.bus


def with_sensors(case: Case, tables: Mapping[str, list[Row]], net: Network) -> dict[str, list[Row]]:
    """The devices of every table, and the sensors that they read."""
    found = {name: list(rows) for name, rows in tables.items()}
    for name, rows in tables.items():
        for hint in inputs(devices.every()[name]).values():
            if not (isinstance(hint, At) and _is_sensor(hint.signal)):
                continue
            sensors = found.setdefault(hint.signal, [])
            for row in rows:
                bus = bus_of(case, net, hint, row)
                if bus not in [sensor.bus for sensor in sensors]:
                    sensors.append(_sensor(case, hint.signal, bus))
    return found


def _is_sensor(name: str) -> bool:
    return name in devices.every() and devices.every()[name].role == "sensor"


def _sensor(case: Case, name: str, bus: int) -> Row:
    device, number = devices.every()[name], case.buses[bus].bus
    par = device.Par(2 * np.pi * case.frequency_hz) if device.Par._fields else ()
    return Row(NO_UNIT, bus, bus, par, f"{device.name} {number}", f"bus {number}")
