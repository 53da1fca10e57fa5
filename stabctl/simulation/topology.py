"""The network after a switching operation, as the compiled loop needs it: factors, islands, loads."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from stabctl._util.errors import StudyError
from stabctl.devices.device import Device
from stabctl.devices.loads import zip_load
from stabctl.dynamics import family, outputs
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.rows import load_rows
from stabctl.model import naming, network
from stabctl.model.location import circuit
from stabctl.model.network import Switching
from stabctl.model.tables import Load

from ._newton_factors import Pattern, pattern
from ._places import Net
from ._substitution import factor

MOST = 200  # networks kept for each operating point


@dataclass(frozen=True)
class Stage:
    """The system between two events."""

    net: Net
    constants: tuple[tuple[str, int, Any], ...]  # table, row and new constants of the devices that have changed
    island_of_bus: np.ndarray  # (buses)
    Y: sp.csc_matrix  # (buses, buses) pu, complex
    draw_bus: np.ndarray  # (drawing buses) rows of the buses with voltage-dependent currents

    @cached_property
    def pattern(self) -> Pattern:
        """What Newton's method eliminates."""
        return pattern(self.net.factors, self.draw_bus)


def stage(point: OperatingPoint, switching: Switching) -> Stage:
    """The system of an operating point under a switching.

    An island without a voltage source (a synchronous machine, or a grid-forming converter of a unit or of storage) is
    blacked out: it has no voltage, its load is lost, its converters are off, and the HVDC
    links that end there are blocked.
    """
    found = point.stages.get(switching)  # held, because another thread may clear the store
    if found is None:
        found = _stage(point, switching)
        if len(point.stages) >= MOST:
            point.stages.clear()
        point.stages[switching] = found
    return found


def _stage(point: OperatingPoint, switching: Switching) -> Stage:
    closed = all(state.from_closed and state.to_closed for _, state in switching.branches)
    where, bus = point.island if closed else network.islands(point.net, switching), point.system.unit_bus
    on = np.array([i not in switching.tripped for i in range(len(bus))])
    held = [row.bus for row in point.system.unweighted.rows if row.virtual]
    alive = np.isin(where, where[[*bus[on & point.system.forming], *held]])
    loads, added = _stepped(point, switching)
    Y = point.admittance(switching)
    if added.any():
        Y = Y + sp.diags(added, format="csc")
    if not alive.all():
        keep, gone = sp.diags(alive.astype(float)), sp.diags((~alive).astype(float))
        Y = (keep @ Y @ keep + gone).tocsc()
    numbers = np.unique(where[alive])
    at = np.where(alive, np.searchsorted(numbers, where), -1).astype(np.int64)
    island = np.where(on, at[bus], -1).astype(np.int64)
    try:
        factors = factor(Y, point.system.near_bus)
    except RuntimeError:
        raise StudyError(
            f"The network of {point.case.name} has no solution after switching, because admittances cancel; check "
            "shunts and series capacitors."
        ) from None
    changed = *loads, *_switched_off(point, alive), *_measured(point, switching)
    net = Net(factors, island, at, len(numbers), alive, switching.faulted, bool((island >= 0).all()))
    return Stage(net, changed, where, Y, point.system.draw_bus)


def _switched_off(point: OperatingPoint, alive: np.ndarray) -> Iterator[tuple[str, int, Any]]:
    """Links with a terminal in a blacked-out island, blocked, and storage behind converters there, with a size of 0."""
    for f in point.system.families:
        link = f.device.role == "link"
        if link or (f.device.role == "storage" and "mva" in f.device.Par._fields):
            bus = (f.w[:, [family.BUS, family.BUS2]] - point.layout.nx) // 2
            for j in np.flatnonzero(~alive[bus].all(axis=1)):
                par = f.device.Par(*f.k[j])
                yield f.name, int(j), f.device.call("blocked", par) if link else par._replace(mva=0.0)


def _measured(point: OperatingPoint, switching: Switching) -> Iterator[tuple[str, int, Any]]:
    """The sensors of circuits that are open or faulted, with the admittances that these have now."""
    states = dict(switching.branches)
    for table in ("line_power", "line_current"):
        for j, name in enumerate(point.system.family(table).keys if states and point.system.has(table) else ()):
            row, _ = circuit(point.case, name)
            if row in states:
                yield table, j, outputs.line(point, name, states[row])[1]


def _stepped(point: OperatingPoint, switching: Switching) -> tuple[tuple[tuple[str, int, Any], ...], np.ndarray]:
    """The loads that change, with their new parameters, and the admittance (buses, pu) that is added."""
    added, changed = np.zeros(len(point.V), complex), []
    if not switching.loads:
        return (), added
    case, keys, V = point.case, naming.keys(point.case, "loads"), np.abs(point.V).tolist()
    steps: dict[int, complex] = defaultdict(complex)  # row of the load -> power added at its voltage, pu
    for (bus, id), power in switching.loads:
        rows = [row for row, _ in naming.loads_at(case, case.buses[bus].bus, id)]
        if not rows:
            added[bus] += power.conjugate() / V[bus] ** 2
        drawn = np.array([zip_load.drawn(case.loads[row], V[bus]) for row in rows])
        for row, p, q in zip(rows, _shares(drawn.real), _shares(drawn.imag), strict=True):
            steps[row] += complex(power.real * p, power.imag * q)
    touched, count = {case.loads[row].bus for row in steps}, defaultdict[tuple[str, int], int](int)
    for row, load in enumerate(case.loads):
        if load.bus not in touched:
            continue
        bus, step, modeled = case.row_of_bus[load.bus], steps.get(row, 0j), 0.0
        for table, of in load_rows(case, load, V[bus], key=keys[row], bus=bus):
            if table == "zip_load":
                par = _zip(load, (1 - modeled) / case.base_mva, step * case.base_mva, V[bus])
                added[bus] += complex(par.Pz - of.par.Pz, of.par.Qz - par.Qz)
                if not zip_load.draws(load):
                    continue
                par = par._replace(Pz=0.0, Qz=0.0)
            else:
                modeled = load.model_share
                par = _modeled(point.system.family(table).device, of.par, modeled * step)
            at = np.flatnonzero(point.system.family(table).w[:, family.BUS] == point.layout.nx + 2 * bus)
            if row in steps:
                changed.append((table, int(at[count[table, bus]]), par))
            count[table, bus] += 1
    return tuple(changed), added


def _shares(drawn: np.ndarray) -> np.ndarray:
    """How loads that draw so much share a change; the first one takes it if they draw nothing."""
    if total := drawn.sum():
        return drawn / total
    return np.eye(len(drawn))[0] if len(drawn) else drawn


def _zip(load: Load, share: float, power: complex, V: float) -> Any:
    """The parameters of a share of a load that draws more power (MVA) at the voltage of the power flow (pu)."""
    unit = zip_load.drawn(load._replace(p=1.0, q=1.0), V)
    p, q = load.p + power.real / unit.real, load.q + power.imag / unit.imag
    return zip_load.from_case(load, share * p, share * q, load.v or V)


def _modeled(device: Device, par: Any, power: complex) -> Any:
    """The parameters of a load model that draws more power (pu) at the voltage of the power flow."""
    if device.has("stepped"):
        return device.call("stepped", par, power)
    return par._replace(P0=par.P0 + power.real, Q0=par.Q0 + power.imag)
