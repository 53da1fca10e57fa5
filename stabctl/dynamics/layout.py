"""Places of all signals: states, set-points and outputs, by unit and name.

All signals of a system are in one vector

    s = [states | voltages (re, im per bus) | set-points | step | 0 | 1 | outputs | memory]
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

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


class StatePlace(NamedTuple):
    """One state: the table of its device, the row there, the row of its unit (-1: none), its name and its label."""

    table: str
    row: int
    unit: int
    name: str
    label: str


class SetPoint(NamedTuple):
    """One set-point: the row of its unit (-1: none), its name, its label, and its value if it is fixed."""

    unit: int
    name: str
    label: str
    start: float | None


@dataclass(frozen=True)
class Layout:
    """Places in s, and the names of the signals there."""

    states: tuple[StatePlace, ...]
    setpoints: tuple[SetPoint, ...]
    buses: int
    outputs: int
    memory: int
    signals: Mapping[tuple[int, str], int] = field(repr=False)  # (row of a unit, name) -> place
    owner: np.ndarray = field(repr=False)  # (size) row of the unit that sets it to zero when off, -1: none

    @property
    def nx(self) -> int:
        """Number of states; the voltages follow them."""
        return len(self.states)

    @property
    def voltages(self) -> slice:
        """The voltages, real and imaginary part per bus."""
        return slice(self.nx, self.nx + 2 * self.buses)

    @property
    def first_setpoint(self) -> int:
        """Place of the first set-point."""
        return self.nx + 2 * self.buses

    @property
    def step(self) -> int:
        """Place of the time step (s); the constants 0 and 1 follow."""
        return self.first_setpoint + len(self.setpoints)

    @property
    def zero(self) -> int:
        """Place of the constant 0."""
        return self.step + 1

    @property
    def one(self) -> int:
        """Place of the constant 1."""
        return self.step + 2

    @property
    def first_output(self) -> int:
        """Place of the first output."""
        return self.step + 3

    @property
    def first_memory(self) -> int:
        """Place of the memory of sampled devices."""
        return self.first_output + self.outputs

    @property
    def size(self) -> int:
        """Length of s."""
        return self.first_memory + self.memory

    def setpoint(self, unit: int, name: str) -> int | None:
        """Place of a set-point of a unit; None if it has none of that name (the port is driven by a control)."""
        for k, one in enumerate(self.setpoints):
            if one.unit == unit and one.name == name:
                return self.first_setpoint + k
        return None


def unique(labels: Iterable[str]) -> tuple[str, ...]:
    """The labels, with a number appended to repeated ones."""
    seen: dict[str, int] = {}
    out = []
    for text in labels:
        seen[text] = seen.get(text, 0) + 1
        out.append(text if seen[text] == 1 else f"{text} ({seen[text]})")
    return tuple(out)
