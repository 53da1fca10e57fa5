"""Figure of a one-line diagram: voltages as colors, loading as line widths, and results drawn on it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl.diagram import OneLine, one_line
from stabctl.errors import StudyError, shown

from . import one_line_labels, one_line_results, tooltips
from .style import COLORS, GRAY, INK, VOLTAGES, single, voltage_colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stabctl.dynamics.operating_point import OperatingPoint
    from stabctl.model.case import Case

INCHES = 0.62  # of a median branch
SMALLEST, LARGEST = 4.5, 15.0  # inches, of the longer side
THINNEST, THICKEST = 0.014, 0.09  # of a median branch
POINTS = 72


def plot(base: "Case | OperatingPoint", *results: Any, ax: "Axes | None" = None) -> "Axes":
    """Plot the one-line diagram of a system, and results on it.

    Parameters
    ----------
    base
        The system.
    results
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
    """
    return draw(one_line(base), *results, ax=ax)


def draw(line: OneLine, *results: Any, ax: "Axes | None" = None) -> "Axes":
    """Plot a one-line diagram; arguments as for `plot`."""
    for result in results:
        if type(result) not in one_line_results.KINDS:
            kinds = ", ".join(kind.__name__ for kind in one_line_results.KINDS)
            raise StudyError(f"{shown(result)} cannot be drawn on a one-line diagram; give one of {kinds}.")
    low, high = _extent(line)
    size = np.maximum(high - low, 1.0)
    ax = single(ax, *_inches(size))
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    ax.axis("off")
    screened = any(one_line_results.colors_lines(r) for r in results)
    point = _points(ax, size)
    if not screened:
        _branches(ax, line, point)
    _transformers(ax, line, point)
    notes = [note for r in results for note in one_line_results.KINDS[type(r)](ax, line, r, point)]
    _symbols(ax, line, point, bare=bool(results))
    one_line_labels.draw(ax, line, notes, point)
    ax.set_title(line.case.name, fontsize="medium", loc="left")
    return ax


def _extent(line: OneLine) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the diagram, with room for labels."""
    every = np.vstack([line.buses, line.machines, line.storage])
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
    tooltips.name(drawn, [f"{kind} {name}: {mva:.0f} MVA" for kind, name, mva in loads])
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

    place = {b.bus: i for i, b in enumerate(line.case.buses)}
    stubs = [(line.buses[place[m.bus]], at) for m, at in zip(line.case.machines, line.machines, strict=True)]
    ax.add_collection(LineCollection(stubs, colors=INK, linewidths=0.7, zorder=0.9))
    kinds = voltage_colors(), VOLTAGES[0][0], VOLTAGES[-1][0]
    dots = ax.scatter(
        line.buses[:, 0],
        line.buses[:, 1],
        s=(0.15 * point) ** 2,
        c=line.voltage,
        zorder=3,
        linewidths=0.4,
        edgecolors=INK,
    )
    buses = zip(line.case.buses, line.voltage, strict=True)
    tooltips.name(dots, [f"{f'bus {b.bus} {b.name}'.rstrip()}: {v:.3f} pu" for b, v in buses])
    dots.set_cmap(kinds[0])
    dots.set_clim(*kinds[1:])
    look: Any = {"edgecolors": INK, "linewidths": 0.8, "zorder": 2}
    disks = ax.scatter(line.machines[:, 0], line.machines[:, 1], s=(0.28 * point) ** 2, facecolors="white", **look)
    tooltips.name(disks, [f"machine {m.called} at bus {m.bus}: {m.base:g} MVA" for m in line.case.machines])
    size = 0.15 * point
    ax.plot(*line.machines.T, ls="none", marker=r"$\sim$", color=INK, markersize=size, mew=0.3, zorder=2.2)
    ax.scatter(line.storage[:, 0], line.storage[:, 1], s=(0.17 * point) ** 2, marker="s", facecolors=COLORS[2], **look)
    if not bare:
        ax.figure.colorbar(dots, ax=ax, label="voltage (pu)", shrink=0.6, pad=0.01, aspect=25)
