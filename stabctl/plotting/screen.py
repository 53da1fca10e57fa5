"""Figure of a screen: the most critical faults and their clearing times."""

from typing import TYPE_CHECKING

from stabctl.clearing import ClearingTime, Screen

from . import tooltips
from .clearing_time import LABEL
from .style import COLORS, GRAY, single

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot(found: Screen, *, most: int = 25, ax: "Axes | None" = None) -> "Axes":
    """Plot the critical clearing times of a screen as bars, the shortest on top.

    Parameters
    ----------
    found
        The screen.
    most
        Number of bars.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        Each bar is labeled with the machine that loses synchronism just beyond the clearing time.
    """
    shown = found.pairs[:most]
    ax = single(ax, 7, 1.2 + 0.25 * max(len(shown), 1))
    cycles = [_cycles(p, found.search.limit_cycles) for p in shown]
    open_ended = [p.status == "stable_at_limit" for p in shown]
    bars = ax.barh(range(len(shown)), cycles, 0.7, color=[GRAY if o else COLORS[0] for o in open_ended])
    for bar, p in zip(bars, shown, strict=True):
        tooltips.name(bar, p.brief())
    ax.bar_label(bars, [_note(p) for p in shown], padding=4, fontsize="small")
    ax.set_yticks(range(len(shown)), [f"bus {p.fault}, trip {', '.join(p.trip)}" for p in shown])
    ax.set_ylim(len(shown) - 0.4, -0.6)
    ax.set_xlim(0, 1.3 * max(cycles, default=0.0) or 1.0)
    ax.grid(visible=False, axis="y")
    ax.set_xlabel(LABEL)
    ax.set_title(f"{found.case}: {len(shown)} of {found.screened} faults", fontsize="medium")
    return ax


def _cycles(pair: ClearingTime, limit: float) -> float:
    """Length of a bar."""
    return limit if pair.status == "stable_at_limit" else pair.cycles or 0.0


def _note(pair: ClearingTime) -> str:
    """Label of a bar."""
    if pair.status == "stable_at_limit":
        return "stable at the search limit"
    machine = "" if pair.machine is None else f"machine {pair.machine}"
    return f"unstable without a fault {machine}".rstrip() if pair.status == "unstable_at_zero" else machine
