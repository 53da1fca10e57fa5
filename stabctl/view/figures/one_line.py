"""Figure of a one-line diagram: voltages, loading, results drawn on it, and labels where there is space.

The labels are placed in the same way every time; one that would lie over something else is left out.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl.clearing import Screen
from stabctl.placement.siting import Siting
from stabctl.smallsignal import Areas, Mode

from ..diagram import OneLine, one_line
from . import style
from .clearing import LABEL
from .palette import AREAS, COLORS, GRAY, INK, VOLTAGES, clearing_colors, voltage_colors
from .style import single

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stabctl.dynamics.operating_point import OperatingPoint
    from stabctl.model.case import Case


INCHES = 0.62  # of a median branch
SMALLEST, LARGEST = 4.5, 15.0  # inches, of the longer side
THINNEST, THICKEST = 0.014, 0.09  # of a median branch
POINTS, PER_INCH = 72, 11  # points, letters of a title
ARROW = 0.9  # length of the largest arrow of a mode shape
SMALLEST_ARROW = 0.03  # relative size of an arrow that is drawn
STORAGE = 0.2, 0.55  # sides of the smallest and the largest storage symbol
NAMED = 6  # most critical lines, which get a label
LETTERS, SMALLEST_LABEL = 7.0, 5.0  # points; smaller where there is less room, and only notes below the smallest
WIDE, HIGH = 0.62, 1.15  # of a letter, of its size
CAPTION = (
    "Each half of a line has the color of a fault at its end, cleared by opening the line; a bus, that of a fault "
    "cleared without opening a line. Bold gray: stable up to the longest time tried. Thin gray: not in the table."
)  # of a screen
BUS, MACHINE = 0.075, 0.14  # radius of a symbol
GRAIN, CELL = 0.04, 1.0  # of the map of lines, of the map of boxes
DIRECTIONS = tuple((float(np.cos(t)), float(np.sin(t))) for t in np.deg2rad([45, 135, -45, -135, 0, 180, 90, -90]))
Box = tuple[float, float, float, float]  # left, bottom, right, top


def plot(base: "Case | OperatingPoint", *results: Any, ax: "Axes | None" = None) -> "Axes":
    """Plot the one-line diagram of a system, and results on it.

    Parameters
    ----------
    base
        The system.
    *results
        What is drawn on it: a `Mode` (arrows at the machines), `Areas` (machines colored by group), a `Screen` (lines
        colored by the critical clearing time of a fault at either end), a `Siting` (storage devices, by rating).
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        Bus numbers and machine names that would lie over something else are left out.

    Raises
    ------
    StudyError
        If a result is of another kind or names machines or lines that the system does not have.

    Examples
    --------
    >>> case = st.load("two_area")
    >>> case.plot(case.modes().mode(0)).figure.savefig("diagram.png")
    """
    return draw(one_line(base), *results, ax=ax)


def draw(line: OneLine, *results: Any, ax: "Axes | None" = None) -> "Axes":
    """Plot a one-line diagram; arguments as for `plot`."""
    for result in results:
        if type(result) not in KINDS:
            kinds = ", ".join(kind.__name__ for kind in KINDS)
            raise StudyError(f"{shown(result)} cannot be drawn on a one-line diagram; give one of {kinds}.")
    modes = [r for r in results if isinstance(r, Mode)]
    arrows = [np.stack((at, ends), axis=1) for m in modes for at, _, ends in [_arrows(line, m)]]
    low, high = _extent(line, arrows)
    size = np.maximum(high - low, 1.0)
    ax = single(ax, *_inches(size))
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    ax.axis("off")
    point = _points(ax, size)
    if not any(isinstance(r, Screen) for r in results):  # it gives the lines their colors
        _branches(ax, line, point)
    _transformers(ax, line, point)
    notes = [note for r in results for note in KINDS[type(r)](ax, line, r, point)]
    _symbols(ax, line, point, bare=bool(results))
    draw_labels(ax, line, notes, point, arrows)
    captions = [f"{m.frequency_hz:.2f} Hz, damping {100 * m.damping_ratio:z.1f} %" for m in modes]
    title = fill(line.case.name, int(PER_INCH * style.whole(ax).get_figwidth()))
    ax.set_title("\n".join([title, *captions]), fontsize="medium", loc="left")
    return ax


def _extent(line: OneLine, arrows: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the diagram and of the arrows that reach beyond it, with room for labels."""
    every = np.vstack([line.buses, line.machines, line.storage, *(ends[:, 1] for ends in arrows)])
    return every.min(axis=0) - 0.7, every.max(axis=0) + 0.7


def _inches(size: np.ndarray) -> tuple[float, float]:
    scale = np.clip(INCHES, SMALLEST / size.max(), max(LARGEST / size.max(), 1e-3))
    width, height = scale * size
    return float(max(width, 3.5)) + 1.2, float(max(height, 2.0)) + 0.4


def _points(ax: "Axes", size: np.ndarray) -> float:
    """Points per unit of the diagram."""
    box = ax.get_position()
    figure: Any = ax.figure
    width, height = figure.get_size_inches() * (box.width, box.height)
    return float(min(width / size[0], height / size[1])) * POINTS


def _branches(ax: "Axes", line: OneLine, point: float) -> None:
    """Branches, as wide as the power they carry."""
    from matplotlib.collections import LineCollection

    most = line.loading.max(initial=0.0)
    width = point * (THINNEST + (THICKEST - THINNEST) * np.sqrt(line.loading / (most or 1.0)))
    drawn = ax.add_collection(
        LineCollection(list(line.ends), colors=GRAY, linewidths=width, zorder=1, capstyle="round")
    )
    kinds = ["transformer" if t else "line" for t in line.transformer]
    loads = zip(kinds, line.circuits, line.loading, strict=True)
    style.name(drawn, [f"{kind} {name}: {mva:.0f} MVA" for kind, name, mva in loads])
    text = f"line width: loading up to {most:.0f} MVA"
    ax.text(0.0, 0.0, text, transform=ax.transAxes, fontsize=7, color=GRAY, ha="left", va="top")


def _transformers(ax: "Axes", line: OneLine, point: float) -> None:
    """Two circles in the middle of every transformer."""
    ends = line.ends[line.transformer]
    along = ends[:, 1] - ends[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    look: Any = {"s": (0.13 * point) ** 2, "facecolors": "white", "edgecolors": GRAY, "linewidths": 0.8, "zorder": 1.5}
    for side in (-0.045, 0.045):
        middle = ends.mean(axis=1) + side * along
        ax.scatter(middle[:, 0], middle[:, 1], **look)


def _symbols(ax: "Axes", line: OneLine, point: float, *, bare: bool) -> None:
    """Buses, machines and storage devices."""
    from matplotlib.collections import LineCollection

    ax.add_collection(LineCollection(_stubs(line), colors=INK, linewidths=0.7, zorder=0.9))
    x, y = line.buses.T
    dots = ax.scatter(x, y, s=(0.15 * point) ** 2, c=line.voltage, zorder=3, linewidths=0.4, edgecolors=INK)
    buses = zip(line.case.buses, line.voltage, strict=True)
    style.name(dots, [f"{f'bus {b.bus} {b.name}'.rstrip()}: {v:.3f} pu" for b, v in buses])
    dots.set_cmap(voltage_colors())
    dots.set_clim(VOLTAGES[0][0], VOLTAGES[-1][0])
    look: Any = {"edgecolors": INK, "linewidths": 0.8, "zorder": 2}
    disks = ax.scatter(line.machines[:, 0], line.machines[:, 1], s=(0.28 * point) ** 2, facecolors="white", **look)
    style.name(disks, [f"machine {m.called} at bus {m.bus}: {m.base:g} MVA" for m in line.case.machines])
    size = 0.15 * point
    ax.plot(*line.machines.T, ls="none", marker=r"$\sim$", color=INK, markersize=size, mew=0.3, zorder=2.2)
    ax.scatter(line.storage[:, 0], line.storage[:, 1], s=(0.17 * point) ** 2, marker="s", facecolors=COLORS[2], **look)
    if not bare:
        ax.figure.colorbar(dots, ax=ax, label="voltage (pu)", shrink=0.6, pad=0.01, aspect=25)


def _stubs(line: OneLine) -> list[tuple[np.ndarray, np.ndarray]]:
    """Both ends of the line from every machine to its bus."""
    place = line.case.row_of_bus
    return [(line.buses[place[m.bus]], at) for m, at in zip(line.case.machines, line.machines, strict=True)]


class Label(NamedTuple):
    """A text beside a symbol."""

    text: str
    at: np.ndarray  # (2)
    radius: float  # of the symbol
    color: str = INK
    bold: bool = False


def mode(ax: "Axes", line: OneLine, found: Mode, point: float) -> list[Label]:
    """Arrows at the machines, relative to the largest, colored by the side of the swing."""
    at, turned, _ = _arrows(line, found)
    color = [COLORS[0] if s.real >= 0 else COLORS[1] for s in turned]
    look: Any = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 1.6 / point, "units": "xy", "zorder": 5}
    ax.quiver(*at.T, turned.real, turned.imag, color=color, **look)
    return []


def _arrows(line: OneLine, found: Mode) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The arrows of a mode: where they begin (arrows, 2), their directions as complex numbers, where they end."""
    row = _machines(line, [p.machine for p in found.shape])
    shape = np.array([p.magnitude * np.exp(1j * np.deg2rad(p.angle_deg)) for p in found.shape])
    lead = shape[np.abs(shape).argmax()] if len(shape) else 1.0
    drawn = np.flatnonzero(np.abs(shape) >= SMALLEST_ARROW)
    at, turned = line.machines[row[drawn]], shape[drawn] / lead * ARROW
    return at, turned, at + np.stack([turned.real, turned.imag], axis=1)


def areas(ax: "Axes", line: OneLine, found: Areas, point: float) -> list[Label]:
    """A disk behind every machine, in the color of its group."""
    for k, group in enumerate(found.groups):
        at = line.machines[_machines(line, group)]
        color = AREAS[k % len(AREAS)]
        ax.scatter(at[:, 0], at[:, 1], s=(0.62 * point) ** 2, color=color, alpha=0.3, linewidths=0, zorder=0.5)
        ax.scatter([], [], s=60, color=color, alpha=0.3, label=f"area {k + 1}")
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize="small")
    return []


def screen(ax: "Axes", line: OneLine, found: Screen, point: float) -> list[Label]:
    """Each half of a line in the color of the critical clearing time of a fault at its end, cleared by opening it.

    A fault at a bus that opens nothing gives the bus this color; gray: stable up to the limit. Others are not drawn.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    row = {name: k for k, name in enumerate(line.circuits)}
    bus = {str(b.bus): k for k, b in enumerate(line.case.buses)}
    half, cycles, told, at_bus = [], [], [], []
    for p in found.pairs:
        time = np.nan if p.status == "stable_at_limit" else p.reach_cycles
        if p.fault in bus and not p.trip:
            at_bus.append((bus[p.fault], time, p.brief()))
        if p.fault not in bus or len(p.trip) != 1 or p.contingency.after:
            continue
        if p.trip[0] not in row:
            raise StudyError(
                f"{line.case.name} has no line {p.trip[0]}; draw the screen on the diagram of its own case."
            )
        k = row[p.trip[0]]
        near = line.ends[k] if line.case.branches[k].from_bus == int(p.fault) else line.ends[k][::-1]
        half.append((near[0], near.mean(axis=0)))
        cycles.append(time)
        told.append(p.brief())
    ax.add_collection(LineCollection(list(line.ends), colors=GRAY, alpha=0.5, linewidths=1, zorder=1))
    every = [*cycles, *(time for _, time, _ in at_bus)]
    known = [time for time in every if np.isfinite(time)]
    low = min(known, default=0.0)
    scale = Normalize(low, max([low + 1, *known]))
    order = np.argsort(cycles)[::-1]  # without a time first
    late = clearing_colors().with_extremes(bad=GRAY)
    colors = late(scale(np.array(cycles)[order])) if half else []
    halves = ax.add_collection(LineCollection([half[i] for i in order], colors=colors, linewidths=3, zorder=1.2))
    style.name(halves, [told[i] for i in order])
    if at_bus:
        places, times, texts = zip(*at_bus, strict=True)
        x, y = line.buses[[*places]].T
        disks = ax.scatter(x, y, s=(0.34 * point) ** 2, c=late(scale(times)), zorder=2.5)
        style.name(disks, texts)
    if known:
        ax.figure.colorbar(ScalarMappable(scale, late), ax=ax, label=LABEL, shrink=0.6, pad=0.01, aspect=25)
    first = [i for i in np.argsort(cycles, kind="stable")[:NAMED] if np.isfinite(cycles[i])]
    middle = [0.75 * np.array(half[i][0]) + 0.25 * np.array(half[i][1]) for i in first]
    return [Label(f"{cycles[i]:g}", at, 0.05, INK, bold=True) for i, at in zip(first, middle, strict=True)]


def siting(ax: "Axes", line: OneLine, found: Siting, point: float) -> list[Label]:
    """A square at every machine with storage, its area in proportion to the rating."""
    row = _machines(line, [s.machine for s in found.sites])
    mw = np.array([s.mw for s in found.sites])
    side = STORAGE[0] + (STORAGE[1] - STORAGE[0]) * np.sqrt(mw / mw.max(initial=1e-9))
    at = line.machines[row]
    look: Any = {"marker": "s", "facecolors": COLORS[2], "edgecolors": INK, "linewidths": 0.8, "zorder": 4}
    squares = ax.scatter(at[:, 0], at[:, 1], s=(side * point) ** 2, **look)
    style.name(squares, [f"storage of machine {s.machine} at bus {s.bus}: {s.size} MW" for s in found.sites])
    pairs = zip(found.sites, at, side, strict=True)
    return [Label(f"{s.size}", x, 0.5 * r, COLORS[2], bold=True) for s, x, r in pairs]


def _machines(line: OneLine, names: Any) -> np.ndarray:
    """Rows of machines by their names or numbers."""
    row = {m.called: i for i, m in enumerate(line.case.machines)}
    for name in names:
        if name not in row:
            raise StudyError(f"There is no machine {name} in {line.case.name}; draw a result on its own case.")
    return np.array([row[name] for name in names], int)


KINDS: Mapping[type, Callable[["Axes", OneLine, Any, float], list[Label]]] = {
    Mode: mode,
    Areas: areas,
    Screen: screen,
    Siting: siting,
}


def draw_labels(ax: "Axes", line: OneLine, notes: list[Label], point: float, arrows: Sequence[np.ndarray] = ()) -> None:
    """Draw notes, machine names and bus numbers, in this order of importance; `point` is points per unit.

    The first note is always drawn, if need be farther from its symbol. Names keep off arrows (arrows, ends, 2).
    """
    size = min(0.2 * point, LETTERS)
    noted = {tuple(n.at): n.radius for n in notes}
    names = [n._replace(radius=max(n.radius, noted.get(tuple(n.at), 0.0))) for n in _names(line)]
    wanted = notes if size < SMALLEST_LABEL else [*notes, *names]
    size, room = max(size, SMALLEST_LABEL), Room(line, arrows)
    for x, y in noted:
        room.take((x - noted[x, y], y - noted[x, y], x + noted[x, y], y + noted[x, y]))
    for label in wanted:
        letter = (1.1 if label.bold else 1.0) * size / point
        farther = np.linspace(0.0, 2.0, 9 if label is notes[0] else 1) if notes else [0.0]
        around = (_places(label._replace(radius=label.radius + d), letter) for d in farther)
        places = next(filter(None, ([box for box in boxes if room.free(box)] for boxes in around)), [])
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


class Room:
    """What is taken: boxes of symbols and labels, and how many points of lines lie in a box."""

    def __init__(self, line: OneLine, arrows: Sequence[np.ndarray] = ()) -> None:
        self.cells: defaultdict[tuple[int, int], list[Box]] = defaultdict(list)
        for at, radius in ((line.buses, BUS), (line.machines, MACHINE), (line.storage, MACHINE)):
            for x, y in at.tolist():
                self.take((x - radius, y - radius, x + radius, y + radius))
        lines = np.concatenate([line.ends, np.array(_stubs(line)).reshape(-1, 2, 2), *arrows])
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


def _cells(box: Box) -> list[tuple[int, int]]:
    a, b, c, d = (int(v // CELL) for v in box)
    return [(i, j) for i in range(a, c + 1) for j in range(b, d + 1)]
