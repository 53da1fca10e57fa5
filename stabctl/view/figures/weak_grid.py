"""Figure of weak-grid operation: least damping ratio over short-circuit ratio and loop gain, and the boundary."""

from typing import TYPE_CHECKING

import numpy as np

from .style import single

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stabctl.smallsignal.weak_grid import WeakGrid


LEVELS = 0.3  # damping ratio at both ends of the colors


def plot(found: "WeakGrid", *, ax: "Axes | None" = None) -> "Axes":
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
        Red: a mode grows. Gray: no operating point.
    """
    ax = single(ax, 6.4, 4.2)
    ax.set_facecolor("0.85")
    colors = ax.pcolormesh(
        found.gain,
        found.scr,
        np.ma.masked_invalid(found.damping_ratio),
        cmap="RdBu",
        vmin=-LEVELS,
        vmax=LEVELS,
        shading="nearest" if min(found.damping_ratio.shape) < 2 else "gouraud",
    )
    bar = ax.figure.colorbar(colors, ax=ax, extend="both")
    bar.set_label("least damping ratio")
    boundary = np.where(found.boundary > 0, found.boundary, np.nan)
    if np.isfinite(boundary).any():
        ax.plot(found.gain, boundary, color="black", linewidth=2, label="boundary of stability")
        ax.legend(loc="upper left", fontsize="small")
    if len(found.gain) > 1:
        ax.set_xscale("log")
    ax.set_xlim(found.gain[0], found.gain[-1])
    ax.set_ylim(found.scr[0], found.scr[-1])
    ax.grid(visible=False)
    ax.set_xlabel("gain of the phase-locked loop (rad/s per pu)")
    ax.set_ylabel("short-circuit ratio")
    ax.set_title(f"{found.name} at an infinite bus", fontsize="medium")
    return ax
