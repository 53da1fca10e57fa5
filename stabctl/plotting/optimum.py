"""The figure of an optimal schedule: the remaining swings, and the power of the devices."""

from typing import TYPE_CHECKING

from stabctl.design.optimum_result import Optimum

from .style import GRAY, subplots
from .trajectory import plot as signal

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot(found: Optimum) -> "Figure":
    """Plot angles from the center of inertia and storage powers of the run with the schedule.

    Parameters
    ----------
    found
        The schedule and its run.

    Returns
    -------
    matplotlib.figure.Figure
        Dashed: the law takes over.
    """
    figure, axes = subplots(9, 6.5, 2, 1, sharex=True)
    takes_over = found.cleared + len(found.schedule.orders[found.before :]) / found.schedule.rate
    for ax, what in zip(axes[:, 0], ("angle", "storage"), strict=True):
        signal(found.run, what, ax=ax)
        ax.axvline(takes_over, color=GRAY, ls="--", lw=1)
    axes[0, 0].set_xlabel("")
    axes[1, 0].set_title("")
    axes[0, 0].set_title(f"{found.case}, fault {found.contingency.fault}: {found.cycles:g} cycles")
    return figure
