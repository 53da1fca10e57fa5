"""The two-machine equivalent (15)-(28): one machine and the center of inertia of the others (Table 2).

Its relative angle delta = delta1 - deltaCOI moves like one machine on an infinite bus with H = H1 HCOI/(H1 + HCOI).
A device at machine 1 acts on that machine alone: of its P_C the share M/M1 = HCOI/(H1 + HCOI) acts on delta.

`equivalent` finds it for a machine of a case with classical machines, and loads as constant impedances. If the other
machines move together, every power is a constant plus a sinusoid of delta, and the relative motion (21) is

    M delta'' = Pm - Pmax sin delta',  M = M1 MCOI/(M1 + MCOI),  delta' = delta - gamma

The constant part of the power is included in Pm, and the phase gamma in the angle. A bolted fault at the machine's bus
takes the sinusoid away and changes the constant, because the loads have other voltages: Pfault is this change.
"""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl._util.schema import POSITIVE
from stabctl._util.validation import guard
from stabctl.model import network, powerflow
from stabctl.model.case import Case

from .equal_area import CriticalClearing, EqualArea, critical_clearing, equal_area
from .minimum_time import MinimumTimeProblem
from .omib import FREQUENCY, INERTIA, OMIB, POWER, REACTANCE, VOLTAGE, during_fault


@dataclass(frozen=True)
class Equivalent:
    """Two machines that exchange Pm1; all per-unit values are on `base`.

    Raises StudyError if a value is out of range or Pm1 has no equilibrium.
    """

    H1: Annotated[float, "s", "inertia constant of machine 1", INERTIA] = 1.0
    HCOI: Annotated[float, "s", "inertia constant of all others", INERTIA] = 6.0
    V1: Annotated[float, "pu", "voltage of machine 1", VOLTAGE] = 1.0
    VCOI: Annotated[float, "pu", "voltage of the others", VOLTAGE] = 1.0
    X: Annotated[float, "pu", "reactance between the two voltages", REACTANCE] = 1.0
    Pm1: Annotated[float, "pu", "mechanical power of machine 1, PmCOI = -Pm1", POWER] = 0.5
    base: Annotated[float, "MVA", "base of the per-unit values", POSITIVE] = 100.0
    Xpost: Annotated[float | None, "pu", "reactance after clearing, X if omitted", REACTANCE] = None
    fb: Annotated[float, "Hz", "base frequency", FREQUENCY] = 60.0
    Pfault: Annotated[float, "pu", "constant part of Pe in the fault, beside Pm1"] = 0.0

    def __post_init__(self) -> None:
        guard(self)
        _ = self.omib

    @property
    def share(self) -> float:
        """Share of P_C that acts on the relative angle, M/M1."""
        return self.HCOI / (self.H1 + self.HCOI)

    @property
    def M1(self) -> float:
        """Inertia coefficient of machine 1 (28), s^2/rad."""
        return 2 * self.H1 / (2 * math.pi * self.fb)

    @property
    def omib(self) -> OMIB:
        """The relative motion (21)-(23) as one machine on an infinite bus."""
        H, more = self.H1 * self.share, {"fb": self.fb, "Pfault": self.Pfault}
        return OMIB(H, self.Pm1, self.X, self.VCOI, self.V1, self.Xpost, **more)

    def minimum_time_problem(self, cycles: float, Pc_min: float = -0.5, Pc_max: float = 0.5) -> MinimumTimeProblem:
        """The control problem (29)-(31) after a bolted fault at machine 1.

        Parameters
        ----------
        cycles : float
            Duration of the fault.
        Pc_min, Pc_max : float, pu
            Limits of the absorbed power.

        Raises
        ------
        StudyError
            If the duration or the limits are not possible.
        """
        m = self.omib
        x1, x2 = during_fault(m, m.seconds(cycles))
        return MinimumTimeProblem(x1, x2, m.M, self.M1, self.Pm1, m.Pmax_post, Pc_min, Pc_max)

    def critical(self, Pc: float = 0.0) -> CriticalClearing:
        """Critical clearing with P_C = `Pc` (pu) absorbed at machine 1 after clearing (Figure 9b)."""
        return critical_clearing(self.omib, self.share * Pc)

    def equal_area(self, cycles: float, Pc: float = 0.0) -> EqualArea:
        """The areas (25), (26) of a bolted fault of so many cycles (Figure 9). Raises StudyError as `equal_area`."""
        m = self.omib
        return equal_area(m, during_fault(m, m.seconds(cycles))[0], self.share * Pc)


def equivalent(case: Case, machine: int | str) -> Equivalent:
    """The equivalent of one machine of a case and the COI of the others; its fault is bolted, at the machine's bus.

    Parameters
    ----------
    case : Case
        The system; its machines are replaced by classical ones.
    machine : int or str
        Number or name of the machine.

    Returns
    -------
    Equivalent
        In pu on the system base, at the power flow of the case.

    Raises
    ------
    StudyError
        If there is no such machine or no other, if no synchronizing power holds the two together, or if the machine
        does not accelerate against the others.
    """
    first = case.machines.index(case.machine(machine))
    called = case.machines[first].called
    net = network.build(case)
    island = network.islands(net)[net.machine_bus]
    own = np.arange(len(island)) == first
    rest = (island == island[first]) & ~own
    if not rest.any():
        raise StudyError(f"{case.name} has no other machine connected with it; an equivalent needs at least two.")
    Y, E, H = reduced_network(case)
    faulted = reduced_network(case, int(net.machine_bus[first])).Y
    delta = np.angle(E / E[first])
    share = H[rest].sum() / H[rest | own].sum()
    weights = share * own - (1 - share) * rest  # the relative angle is driven by share Pa1 - (1 - share) Pa_rest
    coi = H[rest] @ delta[rest] / H[rest].sum()

    def power(angle: float, Y: np.ndarray = Y) -> float:
        """Electrical power of the relative motion, machine 1 ahead of the COI of the others by `angle`."""
        source = np.abs(E) * np.exp(1j * np.where(own, coi + angle, delta))
        return float(weights @ (source * (Y @ source).conj()).real)

    start = delta[first] - coi
    constant = (power(0.0) + power(np.pi)) / 2
    across, along = power(0.0) - constant, power(np.pi / 2) - constant
    Pmax, gamma = float(np.hypot(along, across)), float(np.arctan2(-across, along))
    driving = power(start) - constant
    if not driving < Pmax * (1 - 1e-12):
        raise StudyError(
            f"Machine {called} of {case.name} has no synchronizing power with the other machines, so it has no "
            "equivalent; choose another machine."
        )
    Pfault = power(start, faulted) - constant
    for Pa, when in ((driving, "when no power flows between them"), (driving - Pfault, "in a fault at its bus")):
        if Pa <= 0:
            raise StudyError(
                f"Machine {called} of {case.name} slows down against the others {when}, so it has no equivalent; "
                "choose another machine."
            )
    if np.cos(start - gamma) <= 0:
        raise StudyError(
            f"Machine {called} of {case.name} operates beyond the peak of its power-angle curve, so it has no "
            "equivalent; choose another machine."
        )
    of_case = {"base": case.base_mva, "fb": case.frequency_hz}
    return Equivalent(float(H[first]), float(H[rest].sum()), X=1 / Pmax, Pm1=driving, Pfault=Pfault, **of_case)


class ReducedNetwork(NamedTuple):
    """The network between the internal voltages of the machines, in table order and pu on the system base."""

    Y: np.ndarray  # (machines, machines) complex admittance; all other buses are eliminated
    E: np.ndarray  # (machines) complex internal voltage
    H: np.ndarray  # (machines) s   inertia constant


def reduced_network(case: Case, fault: int | None = None) -> ReducedNetwork:
    """The network of a case at its power flow, reduced to the internal voltages of its machines (Kron reduction).

    With a bolted fault at the bus in row `fault`, if given.
    """
    case = case.classical()
    flow, net = powerflow.solve(case), network.build(case)
    rows = [case.devices["gencls"][m.machine] for m in case.machines]
    base = np.array([m.base for m in case.machines]) / case.base_mva
    y = base / np.array([p.ra + 1j * p.x1d for p in rows])
    V = flow.V[net.machine_bus]
    E = V + (flow.S / V).conj() / y
    at, n = net.machine_bus, len(flow.V)
    shunt = powerflow.demand(case, np.abs(flow.V)).conj() / np.abs(flow.V) ** 2
    np.add.at(shunt, at, y)
    sources = np.zeros((n, len(y)), complex)
    sources[at, np.arange(len(y))] = y
    buses = network.admittance(net).toarray() + np.diag(shunt)
    live = np.arange(n) != fault
    sources = sources[live]
    Y = np.diag(y) - sources.T @ np.linalg.solve(buses[np.ix_(live, live)], sources)
    return ReducedNetwork(Y, E, base * [p.H for p in rows])
