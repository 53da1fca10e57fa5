"""Operating points: a case, its power flow, and the signals in equilibrium; what a study starts from."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from stabctl import devices
from stabctl._util.errors import EquilibriumError, StudyError, shown
from stabctl._util.process import paused
from stabctl._util.verbs import verb
from stabctl._util.wording import enumerated, listed, near
from stabctl.model import fleet, network, powerflow
from stabctl.model.case import Case, not_a_system
from stabctl.model.fleet import Fleet
from stabctl.model.network import Network
from stabctl.model.powerflow import PowerFlow

from . import family, violations
from .assembly import Rotors, System, system
from .jacobian import Equations, Matrix, matrix
from .layout import Layout
from .start import start
from .storage import in_network, with_ratings

MOST = 10.0  # times its rating, that a unit supplies
DROP = 1.0  # pu   voltage drop across its source impedance


@dataclass(frozen=True, repr=False, eq=False)
class OperatingPoint:
    """An equilibrium of a case.

    Attributes
    ----------
    case, flow, net
        The case, its power flow, and its network in pu.
    system
        Its devices and their wiring.
    s
        Every signal in equilibrium; see `dynamics.layout` for the places.
    iterations
        Newton steps of the initialization.
    fastest
        Largest eigenvalue (1/s) of a unit with its controls at given voltage, or of a device.
    stiffest
        The state that takes part most in this eigenvalue; -1: none.
    stages
        Factorized networks of the simulations so far, by what is switched.

    Examples
    --------
    >>> base = st.load("two_area").initialize()
    >>> base.inertia.round(1), abs(base.V[:4]).round(3)
    (array([58.5, 58.5, 55.6, 55.6]), array([1.03, 1.01, 1.03, 1.01]))
    """

    case: Case
    flow: PowerFlow
    net: Network
    system: System
    s: np.ndarray
    iterations: int
    fastest: float
    stiffest: int = -1
    stages: dict[network.Switching, Any] = field(default_factory=dict, compare=False)

    simulate = verb("stabctl.simulation.simulate:simulate")
    clearing_time = verb("stabctl.clearing:clearing_time")
    screen = verb("stabctl.clearing:screen")
    study = verb("stabctl.assessment:study")
    modes = verb("stabctl.smallsignal.analysis:modes")
    linearize = verb("stabctl.smallsignal:linearize")
    closed_loop = verb("stabctl.smallsignal.closed_loop:closed_loop")
    margins = verb("stabctl.smallsignal.margins:margins")
    weak_grid = verb("stabctl.smallsignal.weak_grid:weak_grid")
    limit_cycles = verb("stabctl.smallsignal.limit_cycles:limit_cycles")
    estimate = verb("stabctl.estimation.estimate:estimate")
    place = verb("stabctl.placement.place:place")
    power_flow = verb("stabctl.model.powerflow:solve")
    short_circuit = verb("stabctl.model.short_circuit:short_circuit")
    short_circuit_ratio = verb("stabctl.model.short_circuit:short_circuit_ratio")
    one_line = verb("stabctl.view.diagram:one_line")
    plot = verb("stabctl.view.figures.one_line:plot")

    @property
    def layout(self) -> Layout:
        """Places of the signals in s."""
        return self.system.layout

    @property
    def rotors(self) -> Rotors:
        """The units with a rotor: rows of the units, places of their angles, inertias."""
        return self.system.rotors

    @property
    def island(self) -> np.ndarray:
        """Island of every bus (buses), before any switching."""
        return self.system.island

    @property
    def rotor_island(self) -> np.ndarray:
        """Island of every rotor (rotor units), before any switching."""
        return self.island[self.system.unit_bus[self.rotors.unit]]

    @property
    def members(self) -> np.ndarray:
        """Which rotors are in each island that has any (rotor units, islands), before any switching."""
        return self.rotor_island[:, None] == np.unique(self.rotor_island)

    def from_center(self, of_rotors: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Values less their weighted mean over the island of each rotor, both (..., rotor units).

        Parameters
        ----------
        of_rotors : ndarray (..., rotor units)
            The values.
        weight : ndarray (..., rotor units)
            Their weights, such as `inertia`.

        Examples
        --------
        >>> base = st.load("two_area").initialize()
        >>> base.from_center(base.rotor_angle, base.inertia).round(3)
        array([ 0.316,  0.128, -0.137, -0.331])
        """
        mean = (weight * of_rotors) @ self.members / np.maximum(weight @ self.members, 1e-9)
        return of_rotors - mean @ self.members.T

    @property
    def V(self) -> np.ndarray:
        """Bus voltages (buses), complex, pu."""
        return self.flow.V

    @property
    def inertia(self) -> np.ndarray:
        """Inertias of the rotors (rotor units), H on the system base, s."""
        return self.rotors.inertia

    @property
    def rotor_angle(self) -> np.ndarray:
        """Angles of the rotors (rotor units), rad."""
        return self.s[self.rotors.angle]

    @property
    def rotor_numbers(self) -> tuple[int, ...]:
        """Numbers of the machines with a rotor, in the order of `rotors`."""
        return tuple(self.case.machines[i].machine for i in self.rotors.unit)

    @property
    def rotor_names(self) -> tuple[int | str, ...]:
        """What the machines with a rotor are called, in the order of `rotors`: their names, or else their numbers."""
        return tuple(self.case.machines[i].called for i in self.rotors.unit)

    @cached_property
    def equations(self) -> Equations:
        """The equations of the system, to be evaluated and differentiated."""
        return Equations(self.system)

    def constants(self, table: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Parameters of the devices of one table.

        Parameters
        ----------
        table : str
            Name of the model, such as "genrou".

        Returns
        -------
        rows : ndarray (devices)
            Rows of the units in the tables of the case.
        parameters : dict of str to ndarray (devices)
            The parameters by name, in the units of the model.

        Examples
        --------
        >>> rows, parameters = st.load("two_area").initialize().constants("genrou")
        >>> parameters["H"]
        array([6.5  , 6.5  , 6.175, 6.175])
        """
        if table not in devices.every():
            raise StudyError(f"There is no model {shown(table)}; {near(str(table), devices.every(), 'there are')}")
        names = devices.every()[table].Par._fields
        if not self.system.has(table):
            return np.zeros(0, np.int64), {name: np.zeros(0) for name in names}
        f = self.system.family(table)
        return f.w[:, family.UNIT].copy(), dict(zip(names, f.k.T.copy(), strict=True))

    def admittance(self, switching: network.Switching = network.UNSWITCHED) -> sp.csc_matrix:
        """Admittance matrix of branches, constant parts of loads, and sources of the connected units.

        Parameters
        ----------
        switching : Switching
            What is out of service; nothing by default.

        Returns
        -------
        sparse matrix (buses, buses), complex, pu on the system base

        Examples
        --------
        >>> st.load("two_area").initialize().admittance().shape
        (11, 11)
        """
        return self.admittances(switching).matrix(len(self.V))

    def admittances(self, switching: network.Switching = network.UNSWITCHED) -> network.Entries:
        """The entries of `admittance`.

        Parameters
        ----------
        switching : Switching
            What is out of service; nothing by default.

        Examples
        --------
        >>> st.load("two_area").initialize().admittances().rows.shape
        (74,)
        """
        own = source_admittances(self.system)
        own[list(switching.tripped)] = 0
        bus, more = storage_admittances(self.system)
        at = np.concatenate([np.arange(len(self.V)), self.system.unit_bus, bus])
        return network.entries(self.net, switching).joined(np.concatenate([self.system.fixed, own, more]), at)

    def real_admittance(self, switching: network.Switching = network.UNSWITCHED) -> Matrix:
        """The same in real form (2n, 2n), real and imaginary parts interleaved; dense if the system is small.

        Parameters
        ----------
        switching : Switching
            What is out of service; nothing by default.

        Examples
        --------
        >>> st.load("two_area").initialize().real_admittance().shape
        (22, 22)
        """
        values, *at = self.admittances(switching).real()
        return matrix(values, (at[0], at[1]), (2 * len(self.V),) * 2, self.equations.small)

    def resized(self, ratings: Iterable[float]) -> "OperatingPoint":
        """The same operating point with other storage ratings, which change nothing else in equilibrium.

        Parameters
        ----------
        ratings : iterable of float, MW
            A rating for each storage device of the case.

        Returns
        -------
        OperatingPoint

        Examples
        --------
        >>> base = st.load("two_area").initialize(storage="1=50MW")
        >>> base.resized([20]).case.storage[0].rating
        20.0
        """
        if len(ratings := list(ratings)) != len(self.case.storage):
            raise StudyError(f"{self.case.name} has {len(self.case.storage)} storage devices; give a rating for each.")
        pairs = zip(self.case.storage, ratings, strict=True)
        case = fleet.extended(self.case, (fleet.resized(s, float(rating)) for s, rating in pairs))
        stages = {} if in_network(case) else self.stages
        return replace(self, case=case, system=with_ratings(self.system, self.case, case.storage), stages=stages)

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k != "equations"} | {"stages": {}}

    def __str__(self) -> str:
        states = f"{self.layout.nx} states, found in {self.iterations} Newton steps"
        return f"operating point of {self.case.name}: {states}"

    __repr__ = __str__


def operating_point(base: Case | OperatingPoint, storage: Fleet | None = None) -> OperatingPoint:
    """The operating point of a case, or the point itself, with other storage devices if given.

    Parameters
    ----------
    base : Case or OperatingPoint
    storage : str, float, mapping, or iterable of Storage, optional
        Devices in place of the case's own: a rating at every machine ("50MW", "5%mva", "5%dispatch"), ratings at
        some ("14=50MW,13@33=20MW" or {14: "50MW"}; numbers are MW), rows, or "none".

    Raises
    ------
    StudyError
        If `base` or `storage` is anything else.
    """
    if isinstance(base, Case):
        flow = powerflow.solve(base)
        return solve(base if storage is None else base.with_storage(storage, flow), flow)
    if not isinstance(base, OperatingPoint):
        raise not_a_system(base)
    return base if storage is None else solve(base.case.with_storage(storage, base.flow), base.flow)


def initialize(case: Case, storage: Fleet | None = None) -> OperatingPoint:
    """The operating point of a case: its power flow, and the states at which all devices are in equilibrium.

    Parameters
    ----------
    case : Case
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own; see `operating_point`.

    Returns
    -------
    OperatingPoint

    Raises
    ------
    PowerFlowError, EquilibriumError
        If the power flow has no solution, or a device has no equilibrium there.

    Examples
    --------
    >>> base = st.load("two_area").initialize(storage="50MW")
    >>> [device.bus for device in base.case.storage]
    [5, 6, 11, 10]
    """
    if not isinstance(case, Case):
        raise StudyError(f"{shown(case)} is not a case; give one, such as st.load('two_area').")
    return operating_point(case, storage)


def solve(case: Case, flow: PowerFlow | None = None) -> OperatingPoint:
    """The operating point of a case at its power flow.

    Parameters
    ----------
    case
        The case.
    flow
        Its power flow, solved here unless given.

    Raises
    ------
    PowerFlowError, EquilibriumError
        If there is no operating point; names the bus with the largest mismatch, or the device, machine and limit.
    """
    point = unlimited(case, flow)
    if exceeded := next(violations.find(case, point.system, point.equations, point.s), None):
        raise EquilibriumError(exceeded.sentence(case))
    point.s[:] = violations.within(point.system, point.s)
    return point


@paused()
def unlimited(case: Case, flow: PowerFlow | None = None) -> OperatingPoint:
    """The operating point without limits, which is an equilibrium unless it exceeds some: see `violations.find`.

    Parameters and errors are those of `solve`, but for limits.
    """
    if not any(devices.every()[model].role in devices.UNIT_ROLES for model in case.devices):
        names = enumerated("machine", (m.called for m in case.machines))
        raise StudyError(
            f"{case.name} has no dynamic models, only a power flow: no model for {names}; give their dynamic data, "
            "--dyr of a RAW file, or --machines typical."
        )
    flow = flow or powerflow.solve(case)
    net = network.build(case)
    made = system(case, flow, net)
    _check_islands(case, made)
    V = flow.V[net.machine_bus]
    current = (flow.S / V).conj()
    _check_ratings(case, V, current, source_admittances(made))
    found = start(case, made, Equations(made), flow.V, current)
    point = OperatingPoint(case, flow, net, found.system, found.s, found.iterations, found.fastest, found.stiffest)
    vars(point)["equations"] = found.equations
    return point


def _check_islands(case: Case, made: System) -> None:
    """Check that every island has a voltage source: current sources alone have no common frequency."""
    where, of_unit = made.island, made.island[made.unit_bus]
    for k in np.setdiff1d(of_unit, of_unit[made.forming]):
        names = [str(m.called) for m, island in zip(case.machines, of_unit, strict=True) if island == k]
        buses = [str(b.bus) for b, island in zip(case.buses, where, strict=True) if island == k]
        island = f"The island of {enumerated('bus', buses)} in {case.name}"
        units = f"its units {listed(names)} are" if len(names) > 1 else f"its only unit, {names[0]}, is"
        raise EquilibriumError(
            f"{island if where.any() else case.name} cannot be initialized: nothing sets its voltage and frequency, "
            f"because {units} grid-following; add a machine or a grid-forming converter, such as regfm_a1."
        )


def _check_ratings(case: Case, V: np.ndarray, current: np.ndarray, admittance: np.ndarray) -> None:
    """Check that no machine supplies more than `MOST` times its rating with a drop of more than `DROP`.

    Equivalents of other systems often have a nominal rating of 100 MVA, with a large inertia and a small reactance on
    it. What shows a wrong rating or power is the voltage drop across the source impedance: it depends on no base.
    Voltages, currents and source admittances (0: no voltage source) of the units are complex, in pu on the system base.
    """
    S = V * current.conj() * case.base_mva
    times = np.abs(S) / np.array([m.base for m in case.machines])
    wrong = (times > MOST) & (np.abs(current) > DROP * np.abs(admittance))
    if wrong.any():
        k = int(np.where(wrong, times, 0).argmax())
        m = case.machines[k]
        raise EquilibriumError(
            f"Machine {m.called} of {case.name} supplies {S[k].real:.4g} MW and {S[k].imag:.4g} Mvar, {times[k]:.0f} "
            f"times its rating of {m.base:g} MVA; correct its power or its rating (base_mva)."
        )


def source_admittances(of: System) -> np.ndarray:
    """Norton admittance (units, complex, pu system) of every unit; 0 if it has none."""
    out = np.zeros(len(of.unit_bus), complex)
    for f in of.families:
        if f.device.role in devices.UNIT_ROLES and f.device.admittance is not None:
            out[f.w[:, family.UNIT]] = f.device.admittances(f.k)
    return out


def storage_admittances(of: System) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the buses of storage devices behind an impedance, and their Norton admittances (complex, pu system)."""
    bus, found = [np.zeros(0, np.int64)], [np.zeros(0, complex)]
    for f in of.families:
        if f.device.role == "storage" and f.device.admittance is not None:
            bus.append((f.w[:, family.BUS] - of.layout.nx) // 2)
            found.append(f.device.admittances(f.k))
    return np.concatenate(bus), np.concatenate(found)


def loops(point: OperatingPoint, table: str, unit: int) -> dict[str, str]:
    """State -> name of its control loop, of a converter or a control of one; empty if its device names none.

    Parameters
    ----------
    point
        The operating point.
    table
        Device table.
    unit
        Row of the unit.
    """
    device = devices.every()[table]
    if device.loops is None:
        return {state: name for name, states in device.named_loops.items() for state in states}
    units, constants = point.constants(table)
    row = units.tolist().index(unit)
    par = device.Par(*(constants[name][row] for name in device.Par._fields))
    return {state: name for name, states in device.loops(par).items() for state in states}
