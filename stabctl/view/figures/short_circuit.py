"""Figures of short-circuit power, and of short-circuit ratios of converters alone and with the others."""

from typing import TYPE_CHECKING

import numpy as np

from .palette import COLORS
from .style import ranked, single

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stabctl.model.short_circuit import ShortCircuit, ShortCircuitRatio


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
