"""Figure of short-circuit power: the weakest buses."""

from typing import TYPE_CHECKING

import numpy as np

from .style import COLORS, single

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stabctl.model.short_circuit import ShortCircuit


def plot(found: "ShortCircuit", *, most: int = 25, ax: "Axes | None" = None) -> "Axes":
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
    ax.set_yticks(range(len(shown)), [f"bus {found.case.buses[k].bus}" for k in shown])
    ax.set_ylim(len(shown) - 0.4, -0.6)
    ax.set_xlim(0, 1.15 * found.mva[shown].max() or 1.0)
    ax.grid(visible=False, axis="y")
    ax.set_xlabel("short-circuit power (MVA)")
    ax.set_title(f"{found.case.name}: {len(shown)} of {len(found.mva)} buses", fontsize="medium")
    return ax
