"""Who owns which place of z: machine and name of every state and set-point."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from stabctl.devices import ALL
from stabctl.model.case import Case

from .system import FAMILIES, NAMES, Plant, sizes

WORDS = {
    "delta": "angle",
    "omega": "speed",
    "eq": "field flux",
    "kd": "damper flux d",
    "ed": "rotor flux q",
    "kq": "damper flux q",
    "vm": "transducer",
    "va": "lead-lag",
    "vr": "regulator",
    "efd": "field voltage",
    "vf": "feedback",
    "lag1": "first lag",
    "lag2": "second lag",
    "share": "power",
}


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


def of_machines(places: Iterable[Place], name: str, machines: int) -> np.ndarray:
    """Rows (machines) of the state of that name among the places."""
    found = {p.machine: k for k, p in enumerate(places) if p.name == name}
    return np.array([found[i] for i in range(machines)])


def label(case: Case, place: Place) -> str:
    """A state in words, e.g. "speed GENROU 14"."""
    name = WORDS.get(place.name, place.name)
    if place.family == "storage":
        return f"{name} ESD {case.storage[place.device].machine}@{case.storage[place.device].bus}"
    return f"{name} {ALL[place.family].NAME} {case.machines[place.machine].machine}"


def unique(labels: Iterable[str]) -> tuple[str, ...]:
    """The labels, a repeated one followed by its number."""
    seen: dict[str, int] = {}
    out = []
    for text in labels:
        seen[text] = seen.get(text, 0) + 1
        out.append(text if seen[text] == 1 else f"{text} ({seen[text]})")
    return tuple(out)


def colors(plant: Plant, buses: int) -> np.ndarray:
    """Places of the states and set-points of every machine, one column a machine, -1 where it has fewer.

    Shape (most unknowns of a machine, machines). Storage is left out: it idles at an equilibrium.
    """
    n, owner = sizes(plant, buses), plant.owner
    count, order = np.bincount(owner, minlength=n.machines), np.argsort(owner, kind="stable")
    table = np.full((count.max(initial=0) + 2, n.machines), -1, np.int64)
    first = np.repeat(np.cumsum(count) - count, count)
    table[np.arange(len(owner)) - first, owner[order]] = order
    every = np.arange(n.machines)
    table[count, every] = n.states + n.voltages + every
    table[count + 1, every] = n.states + n.voltages + n.machines + every
    return table
