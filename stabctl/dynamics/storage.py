"""Where the signals of the storage devices are, whatever connects them, in the order of the case's table."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from stabctl import devices
from stabctl.model.case import Case
from stabctl.model.tables import Storage

from . import family
from .assembly import System
from .family import Family


class Places(NamedTuple):
    """Places of the signals of the storage devices (devices)."""

    bus: np.ndarray  # of the real part of the voltage; the imaginary part follows
    unit: np.ndarray  # rows of the machines that they belong to
    order: np.ndarray
    order_q: np.ndarray  # -1: it has no effect, because the device follows its voltage reference alone
    order_v: np.ndarray  # -1: the device has no voltage reference
    energy: np.ndarray
    P: np.ndarray
    Q: np.ndarray
    charge: np.ndarray
    keys: tuple[str, ...]


def places(system: System, case: Case) -> Places:
    """The places of the signals in a system of a case; controllers may have changed what the orders are read from."""
    found = [_of(f, j) for f, j in members(system, case)]
    keys = tuple(str(row[-1]) for row in found)
    columns = list(zip(*(row[:-1] for row in found), strict=True)) or [()] * 9
    where: list[Any] = [np.array(c, np.int64) for c in columns]
    return Places._make([*where, keys])


def ramps(system: System, case: Case) -> np.ndarray:
    """Largest changes of the orders of the storage devices (devices), 1/s."""
    return np.array([f.k[j, f.device.Par._fields.index("ramp")] for f, j in members(system, case)], float)


def members(system: System, case: Case) -> list[tuple[Family, int]]:
    """Family and row of every storage device."""
    count: dict[str, int] = {}
    found = []
    for s in case.storage:
        name = s.device
        found.append((system.family(name), count.setdefault(name, 0)))
        count[name] += 1
    return found


def by_table(case: Case) -> list[int]:
    """Rows of the storage devices in the order in which the system has them: those of one model together."""
    tables = list(dict.fromkeys(s.storage_model for s in case.storage))
    return sorted(range(len(case.storage)), key=lambda j: tables.index(case.storage[j].storage_model))


def _of(f: Family, j: int) -> tuple[Any, ...]:
    w, inputs, outputs = f.w[j], f.device.Input._fields, f.device.Output._fields
    energy = w[family.STATE] + f.device.State._fields.index("energy")
    order, order_q = (w[family.INPUTS + inputs.index(name)] for name in ("order", "order_q"))
    order_v = w[family.INPUTS + inputs.index("order_v")] if _holds_voltage(f, j) else -1
    order_q = -1 if order_v >= 0 and f.device.source is None else order_q  # grid-forming devices follow both
    shown = (w[-1] + outputs.index(name) for name in ("P", "Q", "charge"))
    return (w[family.BUS], w[family.UNIT], order, order_q, order_v, energy, *shown, f.keys[j])


def _holds_voltage(f: Family, j: int) -> bool:
    """Whether a device has a voltage reference: grid-forming, or with QFlag = 1 and VFlag = 0, or RefFlag = 1."""
    names = f.device.Par._fields
    if "order_v" not in f.device.Input._fields:
        return False
    if "repc_RefFlag" in names:
        return bool(f.k[j, names.index("repc_RefFlag")] > 0)
    return "QFlag" not in names or bool(f.k[j, names.index("QFlag")] > f.k[j, names.index("VFlag")])


def is_energy(table: str, state: str) -> bool:
    """Whether a state of a device table is the energy of a storage device."""
    return state == "energy" and devices.every().roles.get(table) == "storage"


def with_ratings(system: System, case: Case, rows: Sequence[Storage]) -> System:
    """The system with other rows of storage.csv, which have the places, models and machines of those of the case."""
    k = {f.name: f.k.copy() for f in system.families if f.device.role == "storage"}
    of = list(zip(members(system, case), rows, strict=True))
    for (f, j), row in of:
        par, names = f.device.call("from_case", row, case.base_mva), f.device.Par._fields
        known = {name: k[f.name][j, names.index(name)] for name in ("V0", "wb", "running") if name in names}
        par = par._replace(**known)
        k[f.name][j] = f.device.prepared(par)
    for name, constants in k.items():
        system = system.with_constants(name, constants)
    return system


def currents(system: System, case: Case, rows: np.ndarray) -> np.ndarray:
    """Currents of the converters of storage (rows, devices) in rows of signals, pu on their MVA; 0 of ideal devices."""
    found = np.zeros((len(rows), len(case.storage)))
    for j, (f, i) in enumerate(members(system, case)):
        names = f.device.Output._fields
        if "Ip" in names:
            found[:, j] = np.hypot(*(rows[:, f.w[i, -1] + names.index(name)] for name in ("Ip", "Iq")))
    return found


def current_limits(system: System, case: Case) -> np.ndarray:
    """Largest currents of the converters of storage (devices), pu on their MVA; infinite of ideal devices."""
    names = [(f, i, f.device.current_limit) for f, i in members(system, case)]
    return np.array([f.k[i, f.device.Par._fields.index(name)] if name else np.inf for f, i, name in names])


def in_network(case: Case) -> bool:
    """Whether the admittance of a storage device is part of the network."""
    return any(devices.every()[s.device].admittance is not None for s in case.storage)
