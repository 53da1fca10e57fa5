"""The two-machine equivalent of one machine of a case and the center of inertia of the others.

Classical machines, loads as constant impedances. If the other machines move together, every power is a constant plus a
sinusoid of delta = delta1 - deltaCOI, and the relative motion (21) is that of two machines:

    M delta'' = Pm - Pmax sin delta',  M = M1 MCOI/(M1 + MCOI),  delta' = delta - gamma

The constant part of the power is included in Pm, and the phase gamma in the angle.
"""

from typing import NamedTuple

import numpy as np

from stabctl.errors import StudyError
from stabctl.model import network, powerflow
from stabctl.model.case import Case

from .two_machine import Equivalent


class ReducedNetwork(NamedTuple):
    """The network between the internal voltages of the machines, in table order and pu on the system base."""

    Y: np.ndarray  # (machines, machines) complex admittance; all other buses are eliminated
    E: np.ndarray  # (machines) complex internal voltage
    H: np.ndarray  # (machines) s   inertia constant


def reduced_network(case: Case) -> ReducedNetwork:
    """The network of a case at its power flow, reduced to the internal voltages of its machines (Kron reduction)."""
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
    return ReducedNetwork(np.diag(y) - sources.T @ np.linalg.solve(buses, sources), E, base * [p.H for p in rows])


def equivalent(case: Case, machine: int) -> Equivalent:
    """The equivalent of one machine of a case and the COI of the others.

    Parameters
    ----------
    case : Case
        The system; its machines are replaced by classical ones.
    machine : int
        Number of the machine.

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
    if len(case.machines) < 2:
        raise StudyError(f"{case.name} has only one machine; an equivalent needs at least two.")
    Y, E, H = reduced_network(case)
    delta, rest = np.angle(E / E[first]), np.arange(len(H)) != first
    share = H[rest].sum() / H.sum()
    weights = np.where(rest, share - 1, share)  # the relative angle is driven by share Pa1 - (1 - share) Pa_rest
    coi = H[rest] @ delta[rest] / H[rest].sum()

    def power(angle: float) -> float:
        """Electrical power of the relative motion, machine 1 ahead of the COI of the others by `angle`."""
        source = np.abs(E) * np.exp(1j * np.where(rest, delta, coi + angle))
        return float(weights @ (source * (Y @ source).conj()).real)

    start = delta[first] - coi
    constant = (power(0.0) + power(np.pi)) / 2
    across, along = power(0.0) - constant, power(np.pi / 2) - constant
    Pmax, gamma = float(np.hypot(along, across)), float(np.arctan2(-across, along))
    driving = power(start) - constant
    if not driving < Pmax * (1 - 1e-12):
        raise StudyError(
            f"Machine {machine} of {case.name} has no synchronizing power with the other machines, so it has no "
            "equivalent; choose another machine."
        )
    if driving <= 0:
        raise StudyError(
            f"Machine {machine} of {case.name} slows down against the others when no power flows between them, so it "
            "has no equivalent; choose another machine."
        )
    if np.cos(start - gamma) <= 0:
        raise StudyError(
            f"Machine {machine} of {case.name} operates beyond the peak of its power-angle curve, so it has no "
            "equivalent; choose another machine."
        )
    return Equivalent(
        float(H[first]),
        float(H[rest].sum()),
        X=1 / Pmax,
        Pm1=driving,
        base=case.base_mva,
        fb=case.frequency_hz,
    )
