"""A switching of the network -> what the compiled loop needs of it: factors, islands, loads."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from stabctl.dynamics.operating_point import Point
from stabctl.errors import StudyError
from stabctl.model import network
from stabctl.model.network import Switching

from .stepper import Net
from .substitution import factor

MOST = 200  # networks kept for each operating point


@dataclass(frozen=True)
class Stage:
    """The system between two events."""

    net: Net
    load: np.ndarray  # the plant's loads, with their steps
    island_of_bus: np.ndarray  # (buses)


def stage(point: Point, switching: Switching) -> Stage:
    """The system of an operating point under a switching. Islands without a machine are dead: no voltage, load lost."""
    found = point.stages.get(switching)  # held, because another thread may clear the store
    if found is None:
        found = _stage(point, switching)
        if len(point.stages) >= MOST:
            point.stages.clear()
        point.stages[switching] = found
    return found


def _stage(point: Point, switching: Switching) -> Stage:
    where = network.islands(point.net, switching)
    on = np.array([i not in switching.tripped for i in range(len(point.net.machine_bus))])
    alive = np.isin(where, where[point.net.machine_bus[on]])
    island = np.where(on, where[point.net.machine_bus], -1).astype(np.int64)
    load, added = _stepped(point, switching)
    Y = point.admittance(switching) + sp.diags(added, format="csc")
    if not alive.all():
        keep, gone = sp.diags(alive.astype(float)), sp.diags((~alive).astype(float))
        Y = (keep @ Y @ keep + gone).tocsc()
    numbers = np.unique(island[island >= 0])
    compact = np.where(island >= 0, np.searchsorted(numbers, island), -1).astype(np.int64)
    try:
        factors = factor(Y)
    except RuntimeError:
        raise StudyError(
            f"The network of {point.case.name} has no solution after its switchings: an admittance cancels another; "
            "check shunts and series capacitors."
        ) from None
    return Stage(Net(factors, compact, alive, switching.faulted), load, where)


def _stepped(point: Point, switching: Switching) -> tuple[np.ndarray, np.ndarray]:
    """The plant's loads with their steps, and the admittance (buses, pu) that is added."""
    added = np.zeros(len(point.fixed), complex)
    if not switching.loads:
        return point.plant.load, added
    table = point.plant.load.copy()
    shares = {point.net.place[load.bus]: load for load in reversed(point.case.loads)}
    for bus, power in switching.loads:
        V, of = abs(point.flow.V[bus]), shares.get(bus)
        row = np.flatnonzero(point.plant.load_bus == bus)
        if of is None or not len(row):
            added[bus] += power.conjugate() / V**2
            continue
        j = row[0]
        table["Pp"][j] += of.p_power * power.real
        table["Qp"][j] += of.q_power * power.imag
        table["Pc"][j] += of.p_current * power.real / V
        table["Qc"][j] += of.q_current * power.imag / V
        rest = (1 - of.p_power - of.p_current) * power.real - 1j * (1 - of.q_power - of.q_current) * power.imag
        added[bus] += rest / V**2
    return table, added
