"""An operating point with more devices, which do not move it: sensors, summing inputs, drawn powers, controllers.

New states, set-points, outputs and memory get their places behind the existing ones of the same kind, so all places
change. While an extension is being built, new places are counted from virtual origins.
"""

from collections.abc import Sequence
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np

from stabctl.devices.device import of

from . import family
from .assembly import System
from .family import CURRENT, Family, limits
from .layout import Layout, SetPoint, StatePlace
from .operating_point import OperatingPoint

BITS = 40  # of a place behind its virtual origin
STATES, SETPOINTS, OUTPUTS, MEMORY = (k << BITS for k in range(1, 5))  # virtual origins


class Extension:
    """An operating point with more devices. `add` them with places of `point.s`, or those given here; then `build`.

    Parameters
    ----------
    point : OperatingPoint
        The operating point; it is not changed.
    """

    def __init__(self, point: OperatingPoint) -> None:
        self.point = point
        self._families = [f._replace(w=f.w.copy()) for f in point.system.families]
        self._states: list[StatePlace] = []
        self._setpoints: list[SetPoint] = []
        self._values: dict[int, list[float]] = {STATES: [], SETPOINTS: [], OUTPUTS: []}
        self._owners: list[int] = []
        self._given: dict[int, int] = {}
        self._memory = 0

    def states(self, places: Sequence[StatePlace], values: Sequence[float]) -> int:
        """Place of the first of new states, with their values at the operating point."""
        self._states += places
        self._values[STATES] += values
        return STATES + len(self._states) - len(places)

    def setpoint(self, one: SetPoint, value: float) -> int:
        """Place of a new set-point."""
        self._setpoints.append(one)
        self._values[SETPOINTS].append(value)
        return SETPOINTS + len(self._setpoints) - 1

    def outputs(self, values: Sequence[float], unit: int = -1) -> int:
        """Place of the first of new outputs, with their values; they are 0 while their unit (if any) is off."""
        self._values[OUTPUTS] += values
        self._owners += [unit] * len(values)
        return OUTPUTS + len(self._owners) - len(values)

    def memory(self, count: int) -> int:
        """Place of the first of `count` new values that are kept from frame to frame, 0 at the start."""
        self._memory += count
        return MEMORY + self._memory - count

    def add(self, name: str, module: ModuleType, w: Sequence[int], k: Sequence[float], key: Any) -> None:
        """Add one device with its places and constants, to its family if there is one of the same size."""
        device = of(module)
        row = np.array([w], np.int64), np.array([k], float).reshape(1, -1)
        for i, f in enumerate(self._families):
            if f.name == name and (f.w.shape[1], f.k.shape[1]) == (len(w), len(k)) and not device.single:
                both = np.vstack([f.w, row[0]]), np.vstack([f.k, row[1]])
                self._families[i] = Family(name, device, *both, (*f.keys, key))
                return
        self._families.append(Family(name, device, *row, (key,)))

    def readers(self, place: int) -> list[tuple[int, int, int]]:
        """Inputs (family, row, column) of the present devices that read a place."""
        return [
            (i, int(row), int(column))
            for i, f in enumerate(self._families)
            for row, column in np.argwhere(f.w[:, family.INPUTS : -1] == place) + [0, family.INPUTS]
        ]

    def ports(self, unit: int, name: str) -> list[tuple[int, int, int]]:
        """Inputs (family, row, column) with this name of the controls of a unit."""
        return [
            (i, int(row), family.INPUTS + f.device.Input._fields.index(name))
            for i, f in enumerate(self._families)
            if name in f.device.Input._fields
            for row in np.flatnonzero(f.w[:, family.UNIT] == unit)
        ]

    def connected(self, ports: Sequence[tuple[int, int, int]], place: int) -> int:
        """Let these inputs read another place; returns the place that they read before."""
        before = {int(self._families[i].w[row, column]) for i, row, column in ports}
        for i, row, column in ports:
            self._families[i].w[row, column] = place
        (one,) = before
        return one

    def supersede(self, place: int, by: int) -> None:
        """Let the signal of a unit at a place be another one, which its device reads instead."""
        self._given[place] = by

    def given(self, place: int) -> int:
        """Place of the signal that stands for the one at a place."""
        return self._given.get(place, place)

    def value(self, place: int) -> float:
        """Value of a signal at the operating point."""
        kind, index = place >> BITS, place & ((1 << BITS) - 1)
        return float(self._values[kind << BITS][index] if kind else self.point.s[place])

    def build(self) -> OperatingPoint:
        """The operating point with the new devices."""
        point, old = self.point, self.point.layout
        places = self._places()
        families = tuple(f._replace(w=_moved(f.w, places)) for f in self._families)
        owner = np.full(places(np.array([MEMORY]))[0] + self._memory, -1, np.int64)
        owner[places(np.arange(old.first_memory))] = old.owner[: old.first_memory]
        first = places(np.array([OUTPUTS]))[0]
        owner[first : first + len(self._owners)] = self._owners
        owner[old.nx : old.nx + len(self._states)] = [p.unit for p in self._states]
        layout = replace(
            old, states=(*old.states, *self._states), setpoints=(*old.setpoints, *self._setpoints),
            outputs=old.outputs + len(self._owners), memory=self._memory, owner=owner,
            signals={key: int(places(np.array([self.given(at)]))[0]) for key, at in old.signals.items()},
        )  # fmt: skip
        s = np.zeros(layout.size)
        s[places(np.arange(old.first_memory))] = point.s[: old.first_memory]
        for origin, values in self._values.items():
            s[places(origin + np.arange(len(values)))] = values
        system = self._system(families, layout.one)
        system = replace(system, rotors=system.rotors._replace(speed=places(system.rotors.speed)))
        return replace(point, system=replace(system, layout=layout), s=s, stages={})

    def _system(self, families: tuple[Family, ...], one: int) -> System:
        """The system with these families; its buses with voltage-dependent currents may be more."""
        old, added = self.point.system, families[len(self.point.system.families) :]
        new = [f.w[:, family.BUS] for f in added if CURRENT in family.operations(f)]
        first = self.point.layout.nx + len(self._states)
        buses = np.union1d(old.draw_bus, (np.concatenate(new) - first) // 2) if new else old.draw_bus
        return replace(old, families=families, limits=limits(families, one), draw_bus=buses, kept={})

    def place(self, given: int) -> int:
        """Place after `build` of a place of `point.s` or of one given here."""
        return int(self._places()(np.array([given]))[0])

    def _places(self) -> "_Places":
        return _Places(self.point.layout, len(self._states), len(self._setpoints), len(self._owners))


class _Places:
    """New places from old and virtual ones."""

    def __init__(self, old: Layout, states: int, setpoints: int, outputs: int) -> None:
        self._nx, self._step, self._states, self._setpoints = old.nx, old.step, states, setpoints
        last = old.first_memory + states + setpoints
        self._origin = np.array([0, old.nx, old.step + states, last, last + outputs])

    def __call__(self, at: np.ndarray) -> np.ndarray:
        kind, index = at >> BITS, at & ((1 << BITS) - 1)
        shifted = at + self._states * (at >= self._nx) + self._setpoints * (at >= self._step)
        return np.where(kind > 0, self._origin[np.clip(kind, 0, 4)] + index, shifted)


def _moved(w: np.ndarray, places: _Places) -> np.ndarray:
    """A table of places with the new ones; units keep their rows."""
    out = places(w)
    out[:, family.UNIT] = w[:, family.UNIT]
    return out
