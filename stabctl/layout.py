"""Who owns which place of z: machine and name of every state and set-point."""

from typing import NamedTuple

import numpy as np

from stabctl.case import Case
from stabctl.models import ALL
from stabctl.system import FAMILIES, NAMES, Plant, sizes


class Place(NamedTuple):
    """One state: its device model, the row of its machine (of its device for storage) and its name."""

    family: str
    device: int
    machine: int
    name: str


def states(plant: Plant) -> tuple[Place, ...]:
    """Every state of z, in order."""
    found = []
    for family, kind in zip(NAMES, FAMILIES, strict=True):
        for j, machine in enumerate(getattr(plant, f"{family}_machine")):
            found += [Place(family, j, int(machine), name) for name in kind.State._fields]
    return tuple(found)


def label(case: Case, place: Place) -> str:
    """A state in words, e.g. "omega GENROU 14"."""
    if place.family == "storage":
        return f"{place.name} ESD {case.storage[place.device].machine}@{case.storage[place.device].bus}"
    return f"{place.name} {ALL[place.family].NAME} {case.machines[place.machine].machine}"


def colours(plant: Plant, buses: int) -> np.ndarray:
    """Places of the states and set-points of every machine, one column a machine, -1 where it has fewer.

    Shape (most unknowns of a machine, machines). Storage is left out: it idles at an equilibrium.
    """
    n = sizes(plant, buses)
    own: list[list[int]] = [[] for _ in range(n.machines)]
    for k, place in enumerate(states(plant)):
        if place.family != "storage":
            own[place.machine].append(k)
    for i in range(n.machines):
        own[i] += [n.states + n.voltages + i, n.states + n.voltages + n.machines + i]
    table = np.full((max(map(len, own)), n.machines), -1, np.int64)
    for i, places in enumerate(own):
        table[: len(places), i] = places
    return table
