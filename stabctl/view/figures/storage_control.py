"""Figures of designed storage control: a law and its clearing times, an optimal schedule."""

from typing import TYPE_CHECKING

import numpy as np

from stabctl.design.law_result import Judged, LawDesign
from stabctl.design.optimum import Optimum

from . import style
from .clearing import LABEL
from .palette import COLORS, GRAY
from .style import ranked, single, subplots
from .trajectory import plot as signal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


WIDTH = 6.0  # inches


def plot_law_design(design: LawDesign, *, ax: "Axes | None" = None) -> "Axes":
    """Plot the critical clearing times without a law, with the paper's law and with the designed law.

    Parameters
    ----------
    design
        The result of a design.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        The contingencies of the training are below the others; each group is in the order of the paper's law.

    Examples
    --------
    >>> options = {"resolution": "4cyc", "scan": 0, "observe": "1s", "longest": 0}
    >>> found = st.design.law(st.load("two_area").classical(), "7-8@0.4", storage="50MW", **options)
    >>> found.plot().figure.savefig("law.png")
    """
    rows = sorted(design.contingencies, key=lambda c: (c.training, c.reference.reach))
    ax = single(ax, WIDTH, 1.5 + 0.3 * len(rows))
    y = np.arange(len(rows))
    reach = np.array([[c.none.reach, c.reference.reach, c.designed.reach] for c in rows]).reshape(-1, 3)
    ax.hlines(y, reach.min(axis=1), reach.max(axis=1), color=GRAY, linewidth=1, alpha=0.5)
    marks = (("without a law", GRAY, "o"), ("the paper's law", COLORS[1], "s"), ("designed law", COLORS[0], "D"))
    for k, (name, color, marker) in enumerate(marks):
        dots = ax.plot(reach[:, k], y, marker, color=color, label=name, markersize=5)[0]
        style.name(dots, [f"{named(c)}, {name}: {x:g} cycles" for c, x in zip(rows, reach[:, k], strict=True)])
    ranked(ax, [named(c) for c in rows])
    ax.set_xlim(left=0)
    ax.set_xlabel(LABEL)
    ax.legend(loc="lower center", bbox_to_anchor=(0.4, 1), ncols=3, frameon=False, fontsize="small")
    return ax


def named(c: Judged) -> str:
    """A contingency in a table or figure."""
    trip = f", trip {', '.join(map(str, c.contingency.trip))}" if c.contingency.trip else ""
    return f"{c.contingency.fault}{trip}{' (training)' if c.training else ''}"


def plot_optimum(found: Optimum) -> "Figure":
    """Plot angles from the center of inertia and storage powers of the run with the schedule.

    Parameters
    ----------
    found
        The schedule and its run.

    Returns
    -------
    matplotlib.figure.Figure
        Dashed: the law takes over.

    Examples
    --------
    >>> options = {"resolution": "1cyc", "window": "1s", "rate": 20, "iterations": 3}
    >>> found = st.design.optimum(st.load("two_area"), "7-8@0.4", storage="50MW", **options)
    >>> found.plot().savefig("optimum.png")
    """
    figure, axes = subplots(9, 6.5, 2, 1, sharex=True)
    takes_over = found.cleared + len(found.schedule.orders[found.before :]) / found.schedule.rate
    for ax, what in zip(axes[:, 0], ("angle", "storage"), strict=True):
        signal(found.run, what, ax=ax)
        ax.axvline(takes_over, color=GRAY, ls="--", lw=1)
    axes[0, 0].set_xlabel("")
    axes[1, 0].set_title("")
    axes[0, 0].set_title(f"{found.case}, fault {found.contingency.label}: {found.cycles:g} cycles")
    return figure
