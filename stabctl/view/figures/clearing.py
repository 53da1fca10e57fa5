"""Figures of clearing times: the runs of a search, times over a parameter, and a screen."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from stabctl.clearing import ClearingTime, Screen

from . import style
from .palette import COLORS, GRAY, LABELS
from .style import MARKERS, ranked, single, subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


LABEL = LABELS["clearing"]


def plot_clearing_time(found: ClearingTime, *, ax: "Axes | None" = None) -> "Axes":
    """Plot the simulations of a search: how long each fault lasted and how long the system stayed in synchronism.

    Parameters
    ----------
    found
        The critical clearing time.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> st.load("two_area").clearing_time("7").plot().figure.savefig("clearing.png")
    """
    ax = single(ax, 7, 4)
    for stable, marker, color in ((True, "o", COLORS[0]), (False, "X", COLORS[1])):
        runs = [r for r in found.runs if r.stable is stable]
        points = [r.cycles for r in runs], [r.time_s for r in runs]
        ax.plot(*points, marker, color=color, label="stable" if stable else "unstable", linestyle="none")
    if found.cycles is not None:
        ax.axvline(found.cycles, color=GRAY, linestyle="--", linewidth=1, label=f"critical: {found.cycles:g} cycles")
    ax.set_ylim(bottom=0)
    ax.set_xlabel("fault duration (cycles)")
    ax.set_ylabel("end of the simulation,\nafter the fault (s)")
    trip = f", trip {', '.join(found.trip)}" if found.trip else ""
    ax.set_title(f"{found.case}, fault {found.fault}{trip}", fontsize="medium")
    ax.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def compare(
    x: Sequence[float],
    curves: Mapping[str, Sequence[float]],
    *,
    xlabel: str,
    reference: Mapping[str, float] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Plot critical clearing times against fault location, storage rating, latency or anything else.

    Parameters
    ----------
    x
        Values on the horizontal axis.
    curves
        Critical clearing times (cycles) at the abscissas, by the name of the curve.
    xlabel
        What the abscissa is, with its unit.
    reference
        Values (cycles) drawn as dashed lines, by the name of the curve to which each belongs.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = single(ax, 8, 4.4)
    for k, (name, cycles) in enumerate(curves.items()):
        color = COLORS[k % len(COLORS)]
        ax.plot(x, cycles, MARKERS[k % len(MARKERS)] + "-", color=color, label=name)
        if reference:
            ax.axhline(reference[name], color=color, linestyle="--", linewidth=1)
    ax.set_xlabel(xlabel)
    ax.set_ylabel(LABEL)
    ax.legend(frameon=False)
    return ax


def panels(
    sweeps: Mapping[str, tuple[Sequence[float], Mapping[str, Sequence[float]]]], reference: Mapping[str, float]
) -> "Figure":
    """Plot several sweeps of `compare` side by side, each given by its abscissa label: abscissas and curves."""
    figure, axes = subplots(5.2 * len(sweeps), 4.0, 1, len(sweeps), sharey=True)
    for ax, (xlabel, (x, curves)) in zip(axes[0], sweeps.items(), strict=True):
        compare(x, curves, xlabel=xlabel, reference=reference, ax=ax)
        ax.label_outer()
        ax.get_legend().remove()
    axes[0, 0].legend(frameon=False, title="dashed: with true speeds", fontsize="small")
    return figure


def plot_screen(found: Screen, *, most: int = 25, ax: "Axes | None" = None) -> "Axes":
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
        Each bar is labeled with what limits it: the machine that loses synchronism just beyond it, frequency, voltage.

    Examples
    --------
    >>> st.load("two_area").screen().plot(most=10).figure.savefig("screen.png")
    """
    shown = found.pairs[:most]
    ax = single(ax, 7, 1.2 + 0.25 * max(len(shown), 1))
    cycles = [p.reach_cycles for p in shown]
    open_ended = [p.status == "stable_at_limit" for p in shown]
    bars = ax.barh(range(len(shown)), cycles, 0.7, color=[GRAY if o else COLORS[0] for o in open_ended])
    for bar, p in zip(bars, shown, strict=True):
        style.name(bar, p.brief())
    ax.bar_label(bars, [_note(p) for p in shown], padding=4, fontsize="small")
    trips = [f", trip {', '.join(p.trip)}" if p.trip and not p.contingency.name else "" for p in shown]
    ranked(ax, [p.place + trip for p, trip in zip(shown, trips, strict=True)])
    ax.set_xlim(0, 1.3 * max(cycles, default=0.0) or 1.0)
    ax.set_xlabel(LABEL)
    ax.set_title(f"{found.case}: {len(shown)} of {found.screened} faults", fontsize="medium")
    return ax


def _note(pair: ClearingTime) -> str:
    """Label of a bar."""
    if pair.status == "stable_at_limit":
        return "stable at the search limit"
    if pair.limited_by == "criteria":
        return pair.limit
    first = pair.limited_by or "" if pair.machine is None else f"machine {pair.machine}"
    return f"unstable without a fault {first}".rstrip() if pair.status == "unstable_at_zero" else first
