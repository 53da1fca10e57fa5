"""The two-machine equivalent of one machine of a case against the center of inertia of the others.

Classical machines, loads as admittances. With the others moving together, every power is a constant plus a sinusoid of
delta = delta1 - deltaCOI, and the relative motion (21) becomes that of two machines:

    M delta'' = Pm - Pmax sin delta',  M = M1 MCOI/(M1 + MCOI),  delta' = delta - gamma

where the constant part of the power is taken into Pm and the phase gamma into the angle.
"""

import numpy as np

from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import Point
from stabctl.errors import StudyError
from stabctl.model.case import Case

from .two_machine import Equivalent


def internal_admittance(point: Point) -> np.ndarray:
    """Admittance (machines, machines, pu) between the sources of classical machines, everything else eliminated."""
    loads = np.zeros(len(point.V), complex)
    plant = point.plant
    size = np.abs(point.V[plant.load_bus])
    drawn = plant.load["Pp"] + plant.load["Pc"] * size - 1j * (plant.load["Qp"] + plant.load["Qc"] * size)
    np.add.at(loads, plant.load_bus, drawn / size**2)
    own, where = operating_point.norton_admittances(plant), point.net.machine_bus
    sources = np.zeros((len(point.V), len(own)), complex)
    sources[where, np.arange(len(own))] = own
    Y = point.admittance().toarray() + np.diag(loads)
    return np.diag(own) - sources.T @ np.linalg.solve(Y, sources)


def equivalent(case: Case, machine: int) -> Equivalent:
    """The machine of that number against the COI of the rest, in pu on the system base, at the case's load flow.

    Raises `StudyError` where there is no such machine, no other, or no power that holds the two together.
    """
    first = case.machines.index(case.machine(machine))
    if len(case.machines) < 2:
        raise StudyError(f"{case.name} has one machine; an equivalent needs others to stand against it.")
    point = operating_point.solve(case.classical())
    Y, H = internal_admittance(point), point.plant.inertia
    delta, n = point.z[point.plant.rotor], len(H)
    E = point.z[-2 * n - len(case.storage) :][:n]
    rest = np.arange(n) != first
    share = H[rest].sum() / H.sum()
    weights = np.where(rest, share - 1, share)  # power that drives the relative angle: share Pa1 - (1 - share) Pa_rest
    center = H[rest] @ delta[rest] / H[rest].sum()

    def power(angle: float) -> float:
        """Electrical power of the relative motion with machine 1 ahead of the COI of the rest by `angle`."""
        turned = np.where(rest, delta, center + angle)
        source = E * np.exp(1j * turned)
        return float(weights @ (source * (Y @ source).conj()).real)

    start = delta[first] - center
    constant = (power(0.0) + power(np.pi)) / 2
    across, along = power(0.0) - constant, power(np.pi / 2) - constant
    Pmax, gamma = float(np.hypot(along, across)), float(np.arctan2(-across, along))
    driving = power(start) - constant
    if not driving < Pmax * (1 - 1e-12):
        raise StudyError(f"Machine {machine} of {case.name} is not held by the rest; it has no equivalent.")
    made = Equivalent(
        float(H[first]), float(H[rest].sum()), 1.0, 1.0, 1 / Pmax, driving, case.base_mva, fb=case.frequency_hz
    )
    if np.cos(start - gamma) <= 0:
        raise StudyError(
            f"Machine {machine} of {case.name} stands beyond the crest of its power; it has no equivalent."
        )
    return made
