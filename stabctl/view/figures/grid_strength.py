"""Figures of grid strength: short-circuit power and ratios, and the limits of weak-grid operation."""

from typing import TYPE_CHECKING, Any

import numpy as np

from .palette import COLORS
from .style import ranked, single

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stabctl.model.short_circuit import ShortCircuit, ShortCircuitRatio
    from stabctl.smallsignal.weak_grid import WeakGrid


WEAK = 3.0  # short-circuit ratio below which a grid is called weak (IEEE Std 1204-1997)


def plot_short_circuit(found: "ShortCircuit", *, most: int = 25, ax: "Axes | None" = None) -> "Axes":
    """Plot the short-circuit power of the weakest buses as bars, the weakest on top.

    Parameters
    ----------
    found
        The short-circuit powers.
    most
        Number of bars.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> st.load("two_area").short_circuit().plot(most=5).figure.savefig("strength.png")
    """
    shown = np.argsort(found.mva, kind="stable")[:most]
    ax = single(ax, 6, 1.2 + 0.25 * len(shown))
    bars = ax.barh(range(len(shown)), found.mva[shown], 0.7, color=COLORS[0])
    ax.bar_label(bars, [f"{found.mva[k]:.0f}" for k in shown], padding=4, fontsize="small")
    ranked(ax, [f"bus {found.case.buses[k].bus}" for k in shown])
    ax.set_xlim(0, 1.15 * found.mva[shown].max() or 1.0)
    ax.set_xlabel("short-circuit power (MVA)")
    ax.set_title(f"{found.case.name}: {len(shown)} of {len(found.mva)} buses", fontsize="medium")
    return ax


def plot_short_circuit_ratio(found: "ShortCircuitRatio", *, most: int = 25, ax: "Axes | None" = None) -> "Axes":
    """Plot the short-circuit ratios of the converters as bars, the smallest equivalent ratio on top.

    Parameters
    ----------
    found
        The short-circuit ratios.
    most
        Number of converters.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        The dashed line is the ratio of 3 below which a grid is called weak.

    Examples
    --------
    >>> found = st.load("two_area").with_storage("200MW").short_circuit_ratio()
    >>> found.plot(most=2).figure.savefig("ratios.png")
    """
    shown = np.argsort(found.equivalent, kind="stable")[:most]
    ax = single(ax, 6, 1.6 + 0.45 * len(shown))
    for shift, values, label, color in (
        (-0.19, found.ratio, "alone (SCR)", COLORS[0]),
        (0.19, found.equivalent, "with the others (ESCR)", COLORS[1]),
    ):
        bars = ax.barh(np.arange(len(shown)) + shift, values[shown], 0.36, color=color, label=label)
        ax.bar_label(bars, [f"{values[k]:.2f}" for k in shown], padding=3, fontsize="small")
    ax.axvline(WEAK, color="0.4", linestyle="--", linewidth=1)
    ranked(ax, [f"{found.converters[k]}, bus {found.buses[k]}" for k in shown])
    ax.set_xlim(0, 1.15 * max(WEAK, found.ratio[shown].max()))
    ax.set_xlabel("short-circuit ratio")
    ax.set_title(f"{found.case.name}: weighted ratio {found.weighted:.2f}", fontsize="medium")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.08), ncols=2, frameon=False, fontsize="small")
    return ax


# Figure of weak-grid operation: least damping ratio over short-circuit ratio and loop gain, and the boundary.

LEVELS = 0.3  # damping ratio at both ends of the colors


def plot_weak_grid(found: "WeakGrid", *, ax: "Axes | None" = None) -> "Axes":
    """Plot the least damping ratio in colors, with the boundary of stability as a line.

    Parameters
    ----------
    found
        The map.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        A cell for each point. Red: a mode grows. Gray: no operating point.

    Examples
    --------
    >>> found = st.load("two_area").with_device("regc_c", 3).weak_grid(3, scr=(1.5, 3), gain=(1, 4))
    >>> found.plot().figure.savefig("weak.png")
    """
    import matplotlib as mpl

    ax, across, up = single(ax, 6.4, 4.2), _edges(found.gain), _edges(found.scr)
    look: Any = {"cmap": mpl.colormaps["RdBu"].with_extremes(bad="0.8"), "edgecolors": "face", "linewidth": 0.5}
    colors = ax.pcolormesh(across, up, found.damping_ratio, vmin=-LEVELS, vmax=LEVELS, **look)
    bar = ax.figure.colorbar(colors, ax=ax, extend="both")
    bar.set_label("least damping ratio")
    boundary = np.where(found.boundary > 0, found.boundary, np.nan)
    if np.isfinite(boundary).any():
        ax.plot(found.gain, boundary, "o-", color="black", markersize=3, label="boundary of stability")
        ax.legend(loc="upper left", fontsize="small")
    ax.set(xscale="log", xlim=across[[0, -1]], ylim=up[[0, -1]])
    ax.grid(visible=False)
    ax.set_xlabel("gain of the phase-locked loop (rad/s per pu)")
    ax.set_ylabel("short-circuit ratio")
    ax.set_title(f"{found.name} at an infinite bus", fontsize="medium")
    return ax


def _edges(values: np.ndarray) -> np.ndarray:
    """Edges of the cells of ascending values, in the geometric middle between two."""
    x = np.log(values)
    step = np.diff(x) if len(x) > 1 else [0.5]
    x = np.array([x[0] - step[0], *x, x[-1] + step[-1]])
    return np.exp((x[1:] + x[:-1]) / 2)
