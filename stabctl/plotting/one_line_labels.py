"""Labels of a one-line diagram: placed where there is space, or left out; deterministic."""

from collections import defaultdict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stabctl.diagram import OneLine

from .style import GRAY, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LETTERS, SMALLEST = 7.0, 5.0  # points; smaller where there is less room, and only notes below the smallest
WIDE, HIGH = 0.62, 1.15  # of a letter, of its size
BUS, MACHINE = 0.075, 0.14  # radius of a symbol
GRAIN, CELL = 0.04, 1.0  # of the map of lines, of the map of boxes
DIRECTIONS = tuple((float(np.cos(t)), float(np.sin(t))) for t in np.deg2rad([45, 135, -45, -135, 0, 180, 90, -90]))

Box = tuple[float, float, float, float]  # left, bottom, right, top


class Label(NamedTuple):
    """A text beside a symbol."""

    text: str
    at: np.ndarray  # (2)
    radius: float  # of the symbol
    color: str = INK
    bold: bool = False


class Room:
    """What is taken: boxes of symbols and labels, and how many points of lines lie in a box."""

    def __init__(self, line: OneLine) -> None:
        self.cells: defaultdict[tuple[int, int], list[Box]] = defaultdict(list)
        for at, radius in ((line.buses, BUS), (line.machines, MACHINE), (line.storage, MACHINE)):
            for x, y in at.tolist():
                self.take((x - radius, y - radius, x + radius, y + radius))
        place = {b.bus: i for i, b in enumerate(line.case.buses)}
        stubs = [(line.buses[place[m.bus]], at) for m, at in zip(line.case.machines, line.machines, strict=True)]
        lines = np.concatenate([line.ends, np.array(stubs).reshape(-1, 2, 2)])
        points = np.vstack([lines[:, 0] * (1 - f) + lines[:, 1] * f for f in np.linspace(0.02, 0.98, 25)])
        self.corner = points.min(axis=0) - 3.0
        shape = np.ceil((points.max(axis=0) + 3.0 - self.corner) / GRAIN).astype(int)
        there = np.zeros(shape + 1)
        np.add.at(there, tuple(((points - self.corner) / GRAIN).astype(int).T + 1), 1)
        self.sums = there.cumsum(axis=0).cumsum(axis=1)

    def take(self, box: Box) -> None:
        """Mark a box as taken."""
        for cell in _cells(box):
            self.cells[cell].append(box)

    def free(self, box: Box) -> bool:
        """Whether nothing taken is under a box."""
        a, b, c, d = box
        return not any(
            p < c and a < r and q < d and b < s for cell in _cells(box) for p, q, r, s in self.cells.get(cell, ())
        )

    def crossed(self, box: Box) -> float:
        """How much of lines is under a box."""
        low, high = ((np.reshape(box, (2, 2)) - self.corner) / GRAIN).astype(int)
        (a, b), (c, d) = np.clip([low, high + 1], 0, np.array(self.sums.shape) - 1).tolist()
        return float(self.sums[c, d] - self.sums[a, d] - self.sums[c, b] + self.sums[a, b])


def draw(ax: "Axes", line: OneLine, notes: list[Label], point: float) -> None:
    """Draw notes, machine names and bus numbers, in this order of importance; `point` is points per unit."""
    size = min(0.2 * point, LETTERS)
    noted = {tuple(n.at): n.radius for n in notes}
    names = [n._replace(radius=max(n.radius, noted.get(tuple(n.at), 0.0))) for n in _names(line)]
    wanted = notes if size < SMALLEST else [*notes, *names]
    size, room = max(size, SMALLEST), Room(line)
    for x, y in noted:
        room.take((x - noted[x, y], y - noted[x, y], x + noted[x, y], y + noted[x, y]))
    for label in wanted:
        letter = (1.1 if label.bold else 1.0) * size / point
        places = [box for box in _places(label, letter) if room.free(box)]
        if places:
            box = min(places, key=room.crossed)
            room.take(box)
            weight = "bold" if label.bold else "normal"
            middle = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
            ax.text(*middle, label.text, fontsize=size, color=label.color, ha="center", va="center", weight=weight)


def _names(line: OneLine) -> list[Label]:
    """Names of the machines, and numbers of the buses."""
    machines = zip(line.case.machines, line.machines, strict=True)
    buses = zip(line.case.buses, line.buses, strict=True)
    return [
        *(Label(f"G{m.called}", at, MACHINE) for m, at in machines),
        *(Label(str(b.bus), at, BUS, GRAY) for b, at in buses),
    ]


def _places(label: Label, letter: float) -> list[Box]:
    """The boxes around a symbol in which its label may be, for letters of a size."""
    width, height = WIDE * letter * len(label.text), HIGH * letter
    found = []
    for x, y in DIRECTIONS:
        left = label.at[0] + x * (label.radius + 0.02) + (round(x) - 1) * width / 2
        bottom = label.at[1] + y * (label.radius + 0.02) + (round(y) - 1) * height / 2
        found.append((float(left), float(bottom), float(left + width), float(bottom + height)))
    return found


def _cells(box: Box) -> list[tuple[int, int]]:
    a, b, c, d = (int(v // CELL) for v in box)
    return [(i, j) for i in range(a, c + 1) for j in range(b, d + 1)]
