"""The devices of every table of a case at its power flow, with their parameters on the system base."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from stabctl import devices
from stabctl._util.errors import EquilibriumError
from stabctl.devices.device import Device
from stabctl.devices.loads import zip_load
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.network import Network
from stabctl.model.powerflow import PowerFlow
from stabctl.model.tables import Load, Storage

NO_UNIT = -1


class Row(NamedTuple):
    """One device: its unit and buses (rows), its parameters, and its names in labels and in messages."""

    unit: int
    bus: int
    bus2: int
    par: Any
    label: str
    key: str


def tables(case: Case, flow: PowerFlow, net: Network) -> tuple[dict[str, list[Row]], np.ndarray]:
    """Table -> devices, and the admittance (buses, pu) of loads that is part of the network matrix."""
    numbers = {m.machine: i for i, m in enumerate(case.machines)}
    found: dict[str, list[Row]] = {}
    for name, device in devices.models().among(case.devices):
        rows = case.devices[name]
        if device.role == "shunt":
            found[name] = [_bus_row(case, device, key, par, net) for key, par in rows.items()]
        elif device.role != "load":
            found[name] = [
                _unit_row(case, device, numbers[naming.number(key)], key, par, net, flow) for key, par in rows.items()
            ]
    found["zip_load"], fixed = [], np.zeros(len(case.buses), complex)
    for load, key in zip(case.loads, naming.keys(case, "loads"), strict=True):
        bus = net.place[load.bus]
        V = _voltage(case, load, float(abs(flow.V[bus])))
        for name, row in load_rows(case, load, V, key=key, bus=bus):
            if name != "zip_load":
                found.setdefault(name, []).append(row)
                continue
            fixed[bus] += zip_load.admittance(row.par)
            if zip_load.draws(load):
                found[name].append(row._replace(par=row.par._replace(Pz=0.0, Qz=0.0)))
    for s in case.storage:
        name = s.device
        found.setdefault(name, []).append(_storage_row(case, s, numbers[s.machine], net.place[s.bus], flow))
    hvdc = devices.every()["hvdc"]
    found["hvdc"] = []
    for k in case.links:
        a, b = net.place[k.from_bus], net.place[k.to_bus]
        powers = k.p / abs(flow.V[a]), (k.p - k.loss) / abs(flow.V[b])
        found["hvdc"].append(
            Row(NO_UNIT, a, b, hvdc.Par(*(p / case.base_mva for p in powers), 0.5), f"HVDC {k.link}", f"link {k.link}")
        )
    return {name: rows for name, rows in found.items() if rows}, fixed


def _filled(device: Device, par: Any, known: Mapping[str, float]) -> Any:
    """Parameters, with those filled from the case and those computed from others."""
    par = par._replace(**{name: value for name, value in known.items() if name in par._fields})
    return device.prepared(par)


def _unit_row(case: Case, device: Device, unit: int, key: naming.Key, par: Any, net: Network, flow: PowerFlow) -> Row:
    m, bus = case.machines[unit], int(net.machine_bus[unit])
    known = {
        "mva": m.base / case.base_mva,
        "wb": 2 * np.pi * case.frequency_hz,
        "V0": float(abs(flow.V[bus])),
        "P0": float(flow.S[unit].real * case.base_mva / m.base),
        "base": m.base,
    }
    par = _filled(device, par, known)
    name = str(key).replace(str(m.machine), str(m.called), 1)
    return Row(unit, bus, bus, par, f"{device.name} {name}", f"machine {m.called} at bus {m.bus}")


def _storage_row(case: Case, s: Storage, unit: int, bus: int, flow: PowerFlow) -> Row:
    device = devices.every()[s.device]
    known = {"V0": float(abs(flow.V[bus])), "wb": 2 * np.pi * case.frequency_hz}
    par = _filled(device, device.call("from_case", s, case.base_mva), known)
    name = f"{naming.STORAGE}{naming.device(case, s.machine, s.bus)}"
    return Row(unit, bus, bus, par, name, name)


def _bus_row(case: Case, device: Device, key: naming.Key, par: Any, net: Network) -> Row:
    number = naming.number(key)
    bus = net.place[number]
    par = _filled(device, par, {"wb": 2 * np.pi * case.frequency_hz})
    return Row(NO_UNIT, bus, bus, par, f"{device.name} {key}", f"bus {number}")


def load_rows(case: Case, load: Load, V: float, *, key: naming.Key, bus: int) -> Iterator[tuple[str, Row]]:
    """Table and device of each part of a load: the share of its load model, if it has one, then the rest.

    Parameters
    ----------
    case
        The case, for the load models of its device tables.
    load
        A row of loads.csv.
    V
        Voltage magnitude at the power flow, pu.
    key
        Key of the row, such as 7 or "7#2".
    bus
        Row of its bus.
    """
    known_models = devices.models()
    found = (name for name, of in case.devices.items() if key in of and known_models[name].role == "load")
    name = next(found, None)
    share = 0.0 if name is None else load.model_share
    if name is not None and share:
        device, drawn = known_models[name], share * zip_load.drawn(load, V) / case.base_mva
        known = {
            "P0": drawn.real,
            "Q0": drawn.imag,
            "V0": V,
            "vlow": load.v_low,
            "system": case.base_mva,
            "wb": 2 * np.pi * case.frequency_hz,
        }
        par = _filled(device, case.devices[name][key], known)
        yield name, Row(NO_UNIT, bus, bus, par, f"{device.name} {key}", f"the load at bus {load.bus}")
    if share < 1:
        P, Q = (1 - share) * load.p / case.base_mva, (1 - share) * load.q / case.base_mva
        par = zip_load.from_case(load, P, Q, load.v or V)
        yield "zip_load", Row(NO_UNIT, bus, bus, par, f"load {key}", f"the load at bus {load.bus}")


def _voltage(case: Case, load: Load, V: float) -> float:
    """The voltage, unless the load is below its threshold there."""
    if load.v_low > V:
        raise EquilibriumError(
            f"The load at bus {load.bus} of {case.name} cannot be initialized: its v_low = {load.v_low:g} pu, below "
            f"which it is an admittance, is above its power-flow voltage of {V:.3f} pu; lower v_low_pu in loads.csv."
        )
    return V
