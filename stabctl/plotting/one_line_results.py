"""Results drawn on a one-line diagram: mode shapes, coherent areas, screens, placements."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl.clearing import Screen
from stabctl.diagram import OneLine
from stabctl.errors import StudyError
from stabctl.placement.siting import Siting
from stabctl.smallsignal import Areas, Mode

from . import tooltips
from .clearing_time import LABEL
from .one_line_labels import Label
from .style import AREAS, COLORS, GRAY, INK, clearing_colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ARROW = 0.9  # length of the largest arrow of a mode shape
SMALLEST = 0.03  # relative size of an arrow that is drawn
STORAGE = 0.2, 0.55  # sides of the smallest and the largest storage symbol
NAMED = 6  # storage ratings with a label, and critical lines


def mode(ax: "Axes", line: OneLine, found: Mode, point: float) -> list[Label]:
    """Arrows at the machines, relative to the largest, colored by the side of the swing."""
    row = _machines(line, [p.machine for p in found.shape])
    shape = np.array([p.magnitude * np.exp(1j * np.deg2rad(p.angle_deg)) for p in found.shape])
    lead = shape[np.abs(shape).argmax()] if len(shape) else 1.0
    drawn = np.flatnonzero(np.abs(shape) >= SMALLEST)
    turned = shape[drawn] / lead * ARROW
    color = [COLORS[0] if s.real >= 0 else COLORS[1] for s in turned]
    at = line.machines[row[drawn]]
    look: Any = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 1.6 / point, "units": "xy", "zorder": 5}
    ax.quiver(*at.T, turned.real, turned.imag, color=color, **look)
    hz, ratio = found.frequency_hz, 100 * found.damping_ratio
    ax.text(1, 1.01, f"{hz:.2f} Hz, damping {ratio:.1f} %", transform=ax.transAxes, ha="right", fontsize="small")
    return []


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
    """Each half of a line in the color of the critical clearing time of a fault at its end, cleared by opening it."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    row = {name: k for k, name in enumerate(line.circuits)}
    half, cycles, names = [], [], []
    for p in found.pairs:
        if p.trip[0] not in row:
            raise StudyError(
                f"{line.case.name} has no line {p.trip[0]}; draw the screen on the diagram of its own case."
            )
        k = row[p.trip[0]]
        near = line.ends[k] if line.case.branches[k].from_bus == int(p.fault) else line.ends[k][::-1]
        half.append((near[0], near.mean(axis=0)))
        limit = found.search.limit_cycles
        cycles.append(0.0 if p.status == "unstable_at_zero" else limit if p.cycles is None else p.cycles)
        names.append((k, p.fault))
    ax.add_collection(LineCollection(list(line.ends), colors=GRAY, alpha=0.5, linewidths=1, zorder=1))
    scale = Normalize(min(cycles, default=0.0), max(cycles, default=1.0))
    order = np.argsort(cycles)[::-1]
    late = clearing_colors()
    colors = late(scale(np.array(cycles)[order])) if half else []
    halves = ax.add_collection(LineCollection([half[i] for i in order], colors=colors, linewidths=3, zorder=1.2))
    tooltips.name(halves, [found.pairs[i].brief() for i in order])
    ax.figure.colorbar(ScalarMappable(scale, late), ax=ax, label=LABEL, shrink=0.6, pad=0.01, aspect=25)
    first = sorted(range(len(cycles)), key=cycles.__getitem__)[:NAMED]
    middle = [0.75 * np.array(half[i][0]) + 0.25 * np.array(half[i][1]) for i in first]
    return [Label(f"{cycles[i]:g}", at, 0.05, INK, bold=True) for i, at in zip(first, middle, strict=True)]


def siting(ax: "Axes", line: OneLine, found: Siting, point: float) -> list[Label]:
    """A square at every machine with storage, its area in proportion to the rating."""
    row = _machines(line, [line.case.machine(s.machine).called for s in found.sites])
    mw = np.array([s.mw for s in found.sites])
    side = STORAGE[0] + (STORAGE[1] - STORAGE[0]) * np.sqrt(mw / mw.max(initial=1e-9))
    at = line.machines[row]
    squares = ax.scatter(
        at[:, 0],
        at[:, 1],
        s=(side * point) ** 2,
        marker="s",
        facecolors=COLORS[2],
        edgecolors=INK,
        linewidths=0.8,
        zorder=4,
    )
    tooltips.name(squares, [f"storage of machine {s.machine} at bus {s.bus}: {s.size} MW" for s in found.sites])
    pairs = zip(found.sites, at, side, strict=True)
    return [Label(f"{s.size}", x, 0.5 * r, COLORS[2], bold=True) for s, x, r in pairs]


def colors_lines(result: object) -> bool:
    """Whether a result gives the lines their colors."""
    return isinstance(result, Screen)


def _machines(line: OneLine, names: "Any") -> np.ndarray:
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
