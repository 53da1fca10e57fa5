"""Fleets of storage devices: one at every machine's storage bus, or at the machines chosen."""

import re
from collections.abc import Mapping
from typing import Any

from stabctl.errors import StudyError
from stabctl.units import size

from . import powerflow
from .case import Case, Machine, Storage
from .powerflow import PowerFlow

_AT = re.compile(r"^\s*(\d+)(?:@(\d+))?\s*=\s*(.+)$")


def everywhere(case: Case, rating: str, flow: PowerFlow | None = None, **options: Any) -> tuple[Storage, ...]:
    """A device of `rating` (50MW, 5%mva, 5%dispatch) at every machine's storage bus; options as fields of `Storage`."""
    return tuple(_device(case, m, rating, flow, m.storage_bus, options) for m in case.machines)


def chosen(
    case: Case, ratings: str | Mapping[int, str], flow: PowerFlow | None = None, **options: Any
) -> tuple[Storage, ...]:
    """Devices at the machines named, `14=50MW,13@33=20MW`: machine, its bus where it is not the storage bus, rating."""
    if not isinstance(ratings, str):
        ratings = ",".join(f"{machine}={rating}" for machine, rating in ratings.items())
    devices: list[Storage] = []
    for part in ratings.split(","):
        match = _AT.match(part)
        if not match:
            raise StudyError(f"{part!r} does not place a storage device; write it as 14=50MW or 14@33=50MW.")
        machine = case.machine(int(match[1]))
        bus = int(match[2]) if match[2] else machine.storage_bus
        if bus not in {b.bus for b in case.buses}:
            raise StudyError(f"There is no bus {bus} in {case.name} for the storage of machine {machine.machine}.")
        if any((d.machine, d.bus) == (machine.machine, bus) for d in devices):
            raise StudyError(f"Machine {machine.machine} has two storage devices at bus {bus}; give it one.")
        devices.append(_device(case, machine, match[3], flow, bus, options))
    return tuple(devices)


def megawatts(case: Case, machine: Machine, rating: str, flow: PowerFlow | None = None) -> float:
    """A rating (50MW, 5%mva, 5%dispatch) at a machine of the case, MW; `StudyError` where it is none."""
    value, unit = size(rating)
    if unit == "%mva":
        value *= machine.base / 100
    elif unit == "%dispatch":
        flow = flow or powerflow.solve(case)
        value *= max(flow.S[case.machines.index(machine)].real, 0.0) * case.base_mva / 100
    return value


def _device(case: Case, m: Machine, rating: str, flow: PowerFlow | None, bus: int, options: dict[str, Any]) -> Storage:
    return Storage(m.machine, bus, megawatts(case, m, rating, flow), **options)
