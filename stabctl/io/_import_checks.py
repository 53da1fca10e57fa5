"""What an import report checks: kinds of DYR records, stored power flow, steady state."""

from collections import Counter, defaultdict
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from stabctl import devices
from stabctl.dynamics import operating_point, violations
from stabctl.dynamics.violations import Violation
from stabctl.model import powerflow, tables
from stabctl.model.case import Case
from stabctl.simulation import simulation
from stabctl.simulation.criterion import Criterion

from .psse import Import
from .psse.dyr import OF_LOADS, LoadScopes, Record, kinds

DRIFT_S = 2.0  # s   simulated without a fault
KEEP_ON = Criterion(max_angle=np.inf, low_voltage_s=0.0, frequency_delay_s=0.0)
NO_ROLE = "not modeled"  # of a kind of records


class Kind(NamedTuple):
    """The records of one kind.

    Attributes
    ----------
    kind : str
        PSS/E's name of the model.
    role : str
        What its model is here: machine, exciter, governor ...
    records, supported : int
        Records in the files, and those of them that the case holds.
    mva : float, MVA
        Sum of the ratings of the machines, and of the powers of the loads, that the records belong to.
    """

    kind: str
    role: str
    records: int
    supported: int
    mva: float


def by_kind(read: Import) -> tuple[Kind, ...]:
    """The records by kind, those of machines first."""
    count, mva = Counter[str](), defaultdict[str, float](float)
    ratings = _Ratings(read)
    for record in read.records:
        count[record.kind] += 1
        mva[record.kind] += ratings.of(record)
    lost = Counter(u.kind for u in read.unsupported if u.place.path != read.raw.path)
    order = {role: k for k, role in enumerate((*devices.ROLES, NO_ROLE))}
    found = [
        Kind(kind, tables.role(kinds()[kind][0]) if kind in kinds() else NO_ROLE, n, n - lost[kind], mva[kind])
        for kind, n in count.items()
    ]
    found.sort(key=lambda one: (order[one.role], one.kind))
    return tuple(found)


class _Ratings:
    """MVA of machines and loads."""

    def __init__(self, read: Import) -> None:
        self._machines = {(g.I, g.ID): g.MBASE or read.raw.base_mva for g, _ in read.raw.of("generator")}
        self._loads = {(load.I, load.ID): abs(complex(load.PL, load.QL)) for load, _ in read.raw.of("load")}
        self._scopes = LoadScopes(read.case.loads, read.raw)

    def of(self, record: Record) -> float:
        """MVA of the machine that a record belongs to, or of the loads in its scope."""
        role = tables.role(kinds()[record.kind][0]) if record.kind in kinds() else NO_ROLE
        where = record.bus or 0, record.id
        if where in self._machines and role != "load" and not (role == NO_ROLE and record.kind.endswith(OF_LOADS)):
            return self._machines[where]
        return sum(self._loads.get(one, 0.0) for one in self._scopes.named(record))


class Stored(NamedTuple):
    """The network at the voltages stored in its file, and its power flow compared with them.

    Attributes
    ----------
    mw, mvar : float
        Largest mismatch of active and of reactive power of a bus at the stored voltages.
    bus : int
        Bus with the largest mismatch of active power.
    """

    mw: float
    mvar: float
    bus: int


def mismatch(case: Case) -> Stored:
    """The power mismatch of every bus at the voltages in the bus table; returns the largest."""
    S = powerflow.at_stored_voltages(case)[1]
    worst = int(np.abs(S.real).argmax())
    mw, mvar = np.abs(S.real).max() * case.base_mva, np.abs(S.imag).max() * case.base_mva
    return Stored(float(mw), float(mvar), case.buses[worst].bus)


class FlowDifference(NamedTuple):
    """Largest difference of the power flow from the stored voltages: magnitude (pu), and angle (degrees)."""

    dv: float
    dangle: float


def flow_difference(case: Case) -> FlowDifference:
    """The power flow compared with the voltages in the bus table. Raises `PowerFlowError`."""
    V = powerflow.solve(case).V
    stored = np.exp(1j * np.deg2rad([b.angle for b in case.buses]))
    dv = np.abs(np.abs(V) - [b.v for b in case.buses]).max()
    return FlowDifference(float(dv), float(np.rad2deg(np.abs(np.angle(V / stored)).max())))


class InitialState(NamedTuple):
    """The initial state of the dynamic models at the power flow.

    Attributes
    ----------
    rate : float, 1/s
        Largest derivative of a state, limits enforced.
    state : str
        That state.
    violations : tuple of Violation
        The limits that the start exceeds.
    drift : float, pu
        Largest change of a voltage or a speed in 2 s without a fault.
    """

    rate: float
    state: str
    violations: tuple[Violation, ...]
    drift: float


def initial_state(case: Case) -> InitialState:
    """The start of a case and what it does without a fault. Raises `PowerFlowError`, `EquilibriumError`."""
    point = operating_point.unlimited(case)
    found = tuple(violations.find(case, point.system, point.equations, point.s))
    s = violations.within(point.system, point.s)
    rates = np.abs(point.equations.entries(s.copy())[1][: point.layout.nx])
    worst = int(rates.argmax()) if len(rates) else -1
    state = point.layout.states[worst].label if len(rates) else ""
    return InitialState(float(rates.max(initial=0.0)), state, found, _drift(replace(point, s=s)))


def _drift(point: operating_point.OperatingPoint) -> float:
    """Largest change of a voltage or a speed (pu) without a fault; infinite if the run ends before."""
    run = simulation.run(point, None, DRIFT_S, criterion=KEEP_ON)
    if run.time[-1] < DRIFT_S - 1e-6:
        return np.inf
    changes = (np.abs(x - x[0]).max(initial=0.0) for x in (np.abs(run.arrays.V), run.arrays.speed))
    return float(max(changes))
