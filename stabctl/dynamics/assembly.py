"""Case and load flow -> the plant the kernels take, on the system base.

One constructor: every table is a contiguous, writeable copy, since anything else would silently be compiled again.
"""

from types import ModuleType

import numpy as np

from stabctl.controllers.signals import Par as LawPar
from stabctl.devices import ALL
from stabctl.devices.loads import zip_load
from stabctl.devices.storage import esd
from stabctl.errors import EquilibriumError
from stabctl.model.case import Case
from stabctl.model.network import Network
from stabctl.model.powerflow import PowerFlow

from . import system
from .system import Plant, records

MACHINES = ("gencls", "genrou")
LIMITS = ("held", "held_low", "held_high", "moving", "moving_low", "moving_high", "moving_machine")


def plant(case: Case, flow: PowerFlow, net: Network) -> tuple[Plant, np.ndarray]:
    """Every device of the case, and the admittance (buses, pu) of the part of the loads that is constant impedance."""
    rows = {m.machine: i for i, m in enumerate(case.machines)}
    tables: dict[str, np.ndarray] = {}
    for name, device in ALL.items():
        tables[name], tables[f"{name}_machine"] = _devices(case, name, device, rows)
    tables["storage"] = devices(case)
    tables["storage_machine"] = np.array([rows[s.machine] for s in case.storage], np.int64)
    tables["storage_bus"] = np.array([net.place[s.bus] for s in case.storage], np.int64)
    tables["law"] = records(LawPar, len(case.storage))
    tables["load"], tables["load_bus"], fixed = _loads(case, flow, net)
    tables["machine_bus"] = net.machine_bus.astype(np.int64)
    inertia = np.zeros(len(case.machines))
    for name in MACHINES:
        inertia[tables[f"{name}_machine"]] = tables[name].H * tables[name].mva
    tables["inertia"], tables["rotor"] = inertia, np.zeros(len(case.machines), np.int64)
    buses = np.concatenate([tables["load_bus"], tables["storage_bus"]])
    tables["draw_bus"], slot = np.unique(buses, return_inverse=True)
    n = len(tables["load"])
    tables["load_slot"], tables["storage_slot"] = slot[:n].astype(np.int64), slot[n:].astype(np.int64)
    widths = [len(k.State._fields) for k in system.FAMILIES]
    owners = [np.repeat(tables[f"{f}_machine"], w) for f, w in zip(system.NAMES, widths, strict=True) if f in ALL]
    tables["owner"] = np.concatenate(owners).astype(np.int64)
    tables |= dict.fromkeys(LIMITS, np.zeros(0))
    made = Plant(**tables)
    for name in MACHINES:
        width = len(ALL[name].State._fields)
        where = tables[f"{name}_machine"]
        made.rotor[where] = system.first_state(made, name) + width * np.arange(len(where))
    return made._replace(**held(made)), fixed


def _devices(case: Case, name: str, device: ModuleType, rows: dict[int, int]) -> tuple[np.ndarray, np.ndarray]:
    table = case.devices.get(name, {})
    if any(key not in rows for key in table):
        raise EquilibriumError(f"{case.name} has two devices of one model at a machine ({name}.csv); give it one.")
    out = records(device.Par, len(table))
    where = np.array([rows[number] for number in table], np.int64)
    for field in device.Par._fields:
        out[field] = [getattr(par, field) for par in table.values()]
    if device.ROLE == "machine":
        out["mva"] = np.array([case.machines[i].base for i in where]) / case.base_mva
        out["wb"] = 2 * np.pi * case.frequency_hz
    return out, where


def held(plant: Plant) -> dict[str, np.ndarray]:
    """Places in z, and limits, of the states that a model lists in HELD, and of the energies in store."""
    place, low, high, scale = [], [], [], []
    for name, device in ALL.items():
        first, width, table = system.first_state(plant, name), len(device.State._fields), getattr(plant, name)
        for state, (least, most, *of) in device.HELD.items():
            place.append(first + device.State._fields.index(state) + width * np.arange(len(table)))
            low.append(table[least])
            high.append(table[most])
            scale.append(getattr(plant, f"{name}_machine") if of else np.full(len(table), -1))
    capacity = plant.storage["capacity"]
    place.append(system.first_state(plant, "storage") + 1 + 2 * np.arange(len(capacity)))
    low.append(np.where(capacity > 0, 0.0, -np.inf))
    high.append(np.where(capacity > 0, capacity, np.inf))
    scale.append(np.full(len(capacity), -1))
    all_of = [np.concatenate(part) for part in (place, low, high, scale)]
    fixed, moves = ([part[all_of[3] < 0] for part in all_of], [part[all_of[3] >= 0] for part in all_of])
    return {
        **dict(zip(("held", "held_low", "held_high"), _typed(fixed), strict=False)),
        **dict(zip(("moving", "moving_low", "moving_high", "moving_machine"), _typed(moves), strict=True)),
    }


def _typed(parts: list[np.ndarray]) -> list[np.ndarray]:
    return [part.astype(kind) for part, kind in zip(parts, (np.int64, float, float, np.int64), strict=True)]


def devices(case: Case) -> np.ndarray:
    """The storage devices in pu on the system base; energy in pu seconds."""
    out = records(esd.Par, len(case.storage))
    part = {"power": "Pp", "current": "Pc", "conductance": "Pg"}
    for row, s in zip(out, case.storage, strict=True):
        row[part[s.characteristic]] = s.rating / case.base_mva
        row["vlow"], row["Tlag"], row["efficiency"] = 0.5, s.lag, np.sqrt(s.efficiency)
        row["ramp"] = s.ramp / s.rating if s.rating else 0.0
        row["capacity"] = s.energy * 3600 / case.base_mva
    return out


def stored(case: Case) -> np.ndarray:
    """Energy (pu s) in every storage device at the start."""
    return np.array([s.energy * s.charge for s in case.storage]) * 3600 / case.base_mva


def _loads(case: Case, flow: PowerFlow, net: Network) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Voltage-dependent parts of loads and HVDC terminals, their buses, and the admittance of the rest."""
    rows = [(b.bus, b.p, b.q, b.p_power, b.q_power, b.p_current, b.q_current, b.v_low) for b in case.loads]
    for k in case.links:
        rows += [(k.from_bus, k.p, 0, 0, 0, 1, 1, 0.5), (k.to_bus, -(k.p - k.loss), 0, 0, 0, 1, 1, 0.5)]
    fixed = np.zeros(len(case.buses), complex)
    out = []
    for bus, p, q, pp, qp, pc, qc, vlow in rows:
        b, V = net.place[bus], abs(flow.V[net.place[bus]])
        P, Q = p / case.base_mva, q / case.base_mva
        if vlow > V:
            raise EquilibriumError(
                f"The load at bus {bus} of {case.name} cannot start: its v_low = {vlow:g} pu, below which it is an "
                f"admittance, is above its load-flow voltage of {V:.3f} pu; lower v_low_pu in loads.csv."
            )
        fixed[b] += ((1 - pp - pc) * P - 1j * (1 - qp - qc) * Q) / V**2
        if pp * P or qp * Q or pc * P or qc * Q:
            out.append((b, pp * P, qp * Q, pc * P / V, qc * Q / V, vlow))
    table = records(zip_load.Par, len(out))
    for j, values in enumerate(out):
        table[j] = values[1:]
    return table, np.array([o[0] for o in out], np.int64), fixed
