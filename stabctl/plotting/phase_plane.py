"""Figures of one machine in the phase plane: faults of several durations, feedback laws (the paper's Figures 3, 7)."""

from typing import TYPE_CHECKING

from stabctl.theory.feedback_laws import FeedbackComparison
from stabctl.theory.phase import PhasePortrait, Separatrix

from .style import GRAY, single, subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ANGLE, SPEED = "angle $\\delta$ (rad)", "speed $\\dot\\delta$ (rad/s)"


def plot(portrait: PhasePortrait, *, ax: "Axes | None" = None) -> "Axes":
    """Plot speed against angle for faults of several durations, with the boundary of the stability region.

    Parameters
    ----------
    portrait
        The faults and the boundary.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        The motion during the fault is drawn thick. A is the initial state; B, C, D ... are the states at clearing.
    """
    ax = single(ax, 7, 5)
    _boundary(ax, portrait.separatrix)
    for i, (c, curve) in enumerate(zip(portrait.cleared, portrait.curves, strict=True)):
        fault = curve.t <= curve.clearing
        (line,) = ax.plot(curve.angle[~fault], curve.speed[~fault], lw=1, label=f"{c.cycles:g} cycles")
        ax.plot(curve.angle[fault], curve.speed[fault], lw=2.5, color=line.get_color(), zorder=3 - 0.1 * i)
        ax.plot(c.angle, c.speed, "o", color=line.get_color(), zorder=4)
        ax.annotate(chr(ord("B") + i), (c.angle, c.speed), (-12, 5), textcoords="offset points")
    ax.plot(portrait.start, 0, "ko", zorder=4)
    ax.annotate("A", (portrait.start, 0), (-12, -13), textcoords="offset points")
    _limits(ax, portrait.separatrix, 1.2)
    ax.set(xlabel=ANGLE, ylabel=SPEED)
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=4, frameon=False)
    return ax


def feedback(comparison: FeedbackComparison) -> "Figure":
    """Plot speed against angle for each feedback law, on the same scale."""
    laws = comparison.responses
    figure, axes = subplots(10, 8, -(-len(laws) // 2), 2, sharex=True, sharey=True)
    for ax, response in zip(axes.flat, laws, strict=False):
        _boundary(ax, comparison.separatrix)
        ax.plot(response.curve.angle, response.curve.speed, lw=1)
        ax.plot(comparison.start, 0, "ko", ms=4)
        ax.set_title(f"{response.name}: peak {response.peak_angle:.3f} rad", fontsize="medium")
        ax.set(xlabel=ANGLE, ylabel=SPEED)
        ax.label_outer()
    _limits(axes[0, 0], comparison.separatrix, 1.25)
    return figure


def _boundary(ax: "Axes", separatrix: Separatrix) -> None:
    """The boundary of the stability region."""
    for sign, label in ((1, "stability region"), (-1, None)):
        ax.plot(separatrix.angle, sign * separatrix.speed, ":", color=GRAY, lw=1.4, label=label)


def _limits(ax: "Axes", separatrix: Separatrix, margin: float) -> None:
    """Axes around the stability region."""
    left, right = separatrix.angle[[0, -1]]
    top = margin * separatrix.speed.max()
    ax.set(xlim=(left - 0.3, right + 0.6), ylim=(-top, top))
