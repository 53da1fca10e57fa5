"""The start: states and set-points at which every machine stands still and gives its load-flow power.

One Newton iteration on the very equations that are simulated, every machine at once: machines only meet through the
network, whose voltages are known here, so that the Jacobian falls into one small block per machine and a perturbation
of all machines together gives all blocks.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from stabctl._util import jit
from stabctl._util.verbs import verb
from stabctl.devices import ALL
from stabctl.devices.blocks import SHORT
from stabctl.errors import EquilibriumError
from stabctl.model import network, powerflow
from stabctl.model.case import Case
from stabctl.model.network import Network
from stabctl.model.powerflow import PowerFlow

from . import assembly, layout, system
from .jacobian import jacobian
from .system import Plant, buffers, sizes

TOLERANCE = 1e-11  # largest residual, 1/s and pu
ROUNDOFF = 1e-15  # the same over the largest slope of its equation: a fast block cannot come closer
ROTOR_CIRCUITS = ("T1d", "T2d", "T1q", "T2q")


@dataclass(frozen=True, repr=False, eq=False)
class Point:
    """An operating point: the plant, its network, and z at which nothing moves."""

    case: Case
    flow: PowerFlow
    net: Network
    plant: Plant
    z: np.ndarray
    fixed: np.ndarray  # (buses) admittance of the constant-impedance part of the loads, pu
    iterations: int
    fastest: float  # 1/s   largest eigenvalue of a machine with its controls at given voltage, or of a device
    stages: dict[network.Switching, Any] = field(default_factory=dict, compare=False)  # networks met so far

    def admittance(self, switching: network.Switching = network.UNSWITCHED) -> sp.csc_matrix:
        """Network admittance (pu) of branches, the loads' impedance parts and the machines that are on."""
        own = norton_admittances(self.plant)
        own[list(switching.tripped)] = 0
        n, d, m = len(self.fixed), np.arange(len(self.fixed)), self.net.machine_bus
        added = sp.csc_matrix((np.r_[self.fixed, own], (np.r_[d, m], np.r_[d, m])), shape=(n, n))
        return network.admittance(self.net, switching) + added

    def resized(self, ratings: Iterable[float]) -> "Point":
        """The same point, its storage devices of other ratings (devices, MW): at rest they change nothing else."""
        pairs = zip(self.case.storage, ratings, strict=True)
        case = self.case.with_storage(s._replace(rating=float(rating)) for s, rating in pairs)
        return replace(self, case=case, plant=self.plant._replace(storage=assembly.devices(case)))

    simulate = verb("stabctl.simulation.simulate:simulate")
    clearing_time = verb("stabctl.clearing:clearing_time")
    screen = verb("stabctl.clearing:screen")
    modes = verb("stabctl.smallsignal.modes:modes")
    linearize = verb("stabctl.smallsignal:linearize")
    estimate = verb("stabctl.estimation.estimate:estimate")

    @property
    def inertia(self) -> np.ndarray:
        """Inertia constants (machines), s on the system base."""
        return self.plant.inertia

    @property
    def V(self) -> np.ndarray:
        """Bus voltages (buses), complex, pu."""
        return self.flow.V

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"stages": {}}

    def __str__(self) -> str:
        n = sizes(self.plant, len(self.V))
        return f"operating point of {self.case.name}: {n.states} states, found in {self.iterations} Newton steps"

    __repr__ = __str__


def norton_admittances(plant: Plant) -> np.ndarray:
    """Admittance (machines, complex, pu system) of every machine's source."""
    out = np.zeros(len(plant.machine_bus), complex)
    for family in assembly.MACHINES:
        model = ALL[family]
        g, b = model.admittance(getattr(plant, family))
        out[getattr(plant, f"{family}_machine")] = g + 1j * b
    return out


def solve(case: Case, flow: PowerFlow | None = None, limit: int = 30) -> Point:
    """The operating point of a case at its load flow. `EquilibriumError` names device, machine and limit."""
    jit.announce()
    flow = flow or powerflow.solve(case)
    net = network.build(case)
    plant, fixed = assembly.plant(case, flow, net)
    alone = _each_on_its_own_bus(plant)
    m, n = len(case.machines), sizes(alone, len(case.machines))
    b = buffers(alone, m, complex)
    _guess(b, case, flow, net, alone)
    current = (flow.S / flow.V[net.machine_bus]).conj() + norton_admittances(plant) * flow.V[net.machine_bus]
    iterations, opened = 0, _opened(alone)
    for share in (0.0, 0.25, 0.5, 0.75, 1.0) if plant.genrou["S12"].any() else (1.0,):
        made, fastest = _newton(b, case, _saturated(opened, share), current, limit)
        iterations += made
    _check_limits(b, case, alone)
    lags = plant.storage["Tlag"][plant.storage["Tlag"] >= SHORT]
    z = np.zeros(n.states + 2 * len(flow.V) + 2 * m + n.storage)
    z[: n.states] = b.z.real[: n.states]
    z[n.states : n.states + 2 * len(flow.V)] = flow.V.view(float)
    z[n.states + 2 * len(flow.V) :] = b.z.real[n.states + n.voltages :]
    if n.storage:
        first = system.first_state(plant, "storage")
        z[first : first + 2 * n.storage].reshape(-1, 2)[:, 1] = assembly.stored(case)
    return Point(case, flow, net, plant, z, fixed, iterations, max([fastest, *(1 / lags)]))


def _each_on_its_own_bus(plant: Plant) -> Plant:
    """The machines with a private bus each, and nothing else that draws."""
    return plant._replace(
        machine_bus=np.arange(len(plant.machine_bus)),
        load=plant.load[:0].copy(),
        load_bus=plant.load_bus[:0].copy(),
        load_slot=plant.load_slot[:0].copy(),
        storage_bus=np.zeros_like(plant.storage_bus),
    )


def _opened(plant: Plant) -> Plant:
    """The plant with every limit (a field named ...max or ...min) out of reach and every rotor circuit closed."""
    tables = {}
    for name in ALL:
        table = getattr(plant, name).copy()
        for column in table.dtype.names:
            if column.endswith(("max", "min")):
                table[column] = 1e9 if column.endswith("max") else -1e9
            elif column in ROTOR_CIRCUITS:
                table[column] = np.where(table[column] > 0, table[column], 1.0)
        tables[name] = table
    opened = plant._replace(**tables)
    return opened._replace(**assembly.held(opened))


def _saturated(plant: Plant, share: float) -> Plant:
    """The plant with a share of its saturation: each start is the guess of the next."""
    table = plant.genrou.copy()
    table["S10"] *= share
    table["S12"] *= share
    return plant._replace(genrou=table)


def _guess(b: system.Buffers, case: Case, flow: PowerFlow, net: Network, plant: Plant) -> None:
    """Everything 1, rotors on the q axis of V + (ra + j xq) I, storage idle."""
    V = flow.V[net.machine_bus]
    n = sizes(plant, len(case.machines))
    b.z[: system.first_state(plant, "storage")] = 1
    b.z[plant.held] = np.clip(1, plant.held_low, plant.held_high)  # a bypassed state stays where it is
    b.z[plant.moving] = np.clip(1, plant.moving_low, plant.moving_high) * np.abs(V[plant.moving_machine])
    b.z[n.states + n.voltages : n.states + n.voltages + 2 * n.machines] = 1
    b.s.v[:, 0], b.s.v[:, 1] = V.real, V.imag
    for family in assembly.MACHINES:
        model = ALL[family]
        where = getattr(plant, f"{family}_machine")
        for par, i in zip(getattr(plant, family), where, strict=True):
            current = (flow.S[i] / V[i]).conj() / par.mva
            b.z[plant.rotor[i]] = np.angle(V[i] + complex(*model.behind(par)) * current)


def _newton(b: system.Buffers, case: Case, plant: Plant, current: np.ndarray, limit: int) -> tuple[int, float]:
    """Bring rates to zero and the sources' currents (pu, Norton) to `current`; steps, fastest eigenvalue."""
    m = len(case.machines)
    table = layout.colors(plant, m)
    n, on = sizes(plant, m), np.zeros(m, np.int64)
    J = np.empty((len(b.f), len(table)))
    rows = [[k for k in table[:-2, i] if 0 <= k < n.states] for i in range(m)]
    residual = np.zeros(m)
    for iteration in range(limit + 1):
        jacobian(b, plant, on, table, J)
        f = b.f.real.copy()
        f[n.states :] -= current.view(float)
        own = [[*rows[i], n.states + 2 * i, n.states + 2 * i + 1] for i in range(m)]
        residual = np.array([np.abs(f[r]).max() for r in own])
        if not np.isfinite(residual).all():
            break
        slope = np.array([np.abs(J[r]).max(initial=1.0) for r in own])
        if residual.max() < TOLERANCE or (residual / slope).max() < ROUNDOFF:
            blocks = [J[rows[i]][:, : len(rows[i])] for i in range(m)]
            return iteration, max(float(np.abs(np.linalg.eigvals(A)).max()) for A in blocks)
        for i in range(m):
            live = table[:, i] >= 0
            _step(b.z, J[own[i]][:, live], f[own[i]], table[live, i])
    worst = int(np.argmax(np.where(np.isfinite(residual), residual, np.inf)))
    raise EquilibriumError(
        f"Machine {case.machines[worst].machine} of {case.name} has no start at its load-flow power after {limit} "
        f"steps (residual {residual[worst]:.1e}); check its reactances, its saturation and the power it is asked for."
    )


def _step(z: np.ndarray, J: np.ndarray, f: np.ndarray, places: np.ndarray) -> None:
    """One Newton step of one machine; states that stand still and that nobody reads (bypassed blocks) are left out."""
    moving, read = J.any(axis=1), J.any(axis=0)
    change = np.linalg.lstsq(J[np.ix_(moving, read)], f[moving], rcond=None)[0]
    z[places[read]] -= change


def _check_limits(b: system.Buffers, case: Case, plant: Plant) -> None:
    """Every machine upright, every state within its limits, nothing moved by a limit that binds."""
    for i, m in enumerate(case.machines):
        if np.cos(b.z[plant.rotor[i]].real - np.angle(b.s.v[i, 0] + 1j * b.s.v[i, 1]).real) < -0.5:
            raise EquilibriumError(f"Machine {m.machine} of {case.name} starts upside down; check its reactances.")
    places = layout.states(plant)
    size = np.abs(b.s.v[:, 0] + 1j * b.s.v[:, 1])[plant.moving_machine]
    reached = np.r_[b.z.real[plant.held], b.z.real[plant.moving] / size]
    stops = np.r_[plant.held, plant.moving]
    lows, highs = np.r_[plant.held_low, plant.moving_low], np.r_[plant.held_high, plant.moving_high]
    for k, value, low, high in zip(stops, reached, lows, highs, strict=True):
        if not low <= value <= high:
            place = places[k]
            name = ALL[place.family].HELD[place.name][int(value > high)]
            raise EquilibriumError(_beyond(case, place, name, high if value > high else low, f"needs {value:.4g} pu"))
    moved = _rates(b, plant)
    if np.abs(moved).max(initial=0.0) < 1e-8:
        return
    place = places[int(np.abs(moved).argmax())]
    device, name, limit = _binding(b, case, plant, place.machine)
    raise EquilibriumError(_beyond(case, device, name, limit, "is exceeded"))


def _rates(b: system.Buffers, plant: Plant) -> np.ndarray:
    m = len(plant.machine_bus)
    J = np.empty((len(b.f), 1))
    jacobian(b, plant, np.zeros(m, np.int64), np.full((1, 1), -1, np.int64), J)
    return b.f.real[: sizes(plant, m).states]


def _binding(b: system.Buffers, case: Case, plant: Plant, machine: int) -> tuple[layout.Place, str, float]:
    """The limit of a machine's controls that, closed alone, keeps it from standing still."""
    free = _opened(plant)
    for family, device in ALL.items():
        for j in np.flatnonzero(getattr(plant, f"{family}_machine") == machine):
            for name in (n for n in device.Par._fields if n.endswith(("max", "min"))):
                trial = getattr(free, family).copy()
                trial[name][j] = limit = getattr(plant, family)[name][j]
                if np.abs(_rates(b, free._replace(**{family: trial}))).max() >= 1e-8:
                    return layout.Place(family, int(j), machine, ""), name, float(limit)
    number = case.machines[machine].machine
    raise EquilibriumError(f"Machine {number} of {case.name} does not stand still at its load flow; check its data.")


def _beyond(case: Case, place: layout.Place, name: str, limit: float, what: str) -> str:
    m, model = case.machines[place.machine], ALL[place.family].NAME
    return (
        f"{model} of machine {m.machine} at bus {m.bus} cannot start: {name} = {limit:g} pu {what} at the load flow; "
        f"widen {name} in {place.family}.csv or change the machine's power or voltage."
    )
