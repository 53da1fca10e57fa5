"""Figures of one machine: phase plane (the paper's Figures 3 and 7), equal areas (4, 5, 9), minimum time (10, 11)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.theory.equal_area import EqualArea
from stabctl.theory.feedback_laws import FeedbackComparison
from stabctl.theory.minimum_time import MinimumTime
from stabctl.theory.omib import SwingCurve
from stabctl.theory.phase_plane import PhasePortrait, Separatrix

from .palette import COLORS, GRAY, LABELS
from .style import single, subplots, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


ANGLE, SPEED = "angle $\\delta$ (rad)", "speed $\\dot\\delta$ (rad/s)"
STATES = "$x_1$ (rad)", "$x_2$ (rad/s)", "$\\lambda_1$ (s/rad)", "$\\lambda_2$ (s$^2$/rad)"
TIME = "time after clearing (ms)"


def plot_phase_plane(portrait: PhasePortrait, *, ax: "Axes | None" = None) -> "Axes":
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
    for ax, response in zip(axes.flat[: len(laws)], laws, strict=True):
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


def plot_equal_area(area: EqualArea, *, title: str = "", ax: "Axes | None" = None) -> "Axes":
    """Plot the power-angle curve with the accelerating area A1 and the decelerating area A2.

    Parameters
    ----------
    area
        The areas.
    title
        What to put before the sizes of the areas.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = single(ax, 7, 4.5)
    lifted = area.Pe + area.absorbed
    ax.plot(area.angle, area.Pe, "k", label="$P_e$")
    if area.absorbed:
        ax.plot(area.angle, lifted, "k--", label="$P_e + P_C$")
    if area.Pe_fault.any():
        ax.plot(area.angle, area.Pe_fault, "k-.", label="$P_e$, fault")
    ax.axhline(area.Pm, color=COLORS[0], lw=1, label="$P_m$")
    during = (area.angle >= area.start) & (area.angle <= area.clearing)
    after = (area.angle >= area.clearing) & (area.angle <= area.stop)
    ax.fill_between(area.angle, area.Pe_fault, area.Pm, where=during, color=COLORS[1], alpha=0.35, label="$A_1$")
    ax.fill_between(area.angle, area.Pm, lifted, where=after, color=COLORS[2], alpha=0.35, label="$A_2$")
    end = "$\\delta_1$" if area.stable else "$\\delta_u$"
    for name, angle in (("$\\delta_0$", area.start), ("$\\delta_{cl}$", area.clearing), (end, area.stop)):
        ax.axvline(angle, color=GRAY, lw=0.8, ls=":")
        ax.annotate(name, (angle, 0), (3, 4), textcoords="offset points")
    result = f"stops at {area.stop:.3f} rad" if area.stable else "loses synchronism"
    sizes = f"$A_1$ = {area.A1:.4f}, $A_2$ = {area.A2:.4f} pu rad: {result}"
    ax.set_title(f"{title}{sizes}", fontsize="medium", loc="left", pad=24)
    low, top = min(0, area.Pe_fault.min()), max(lifted.max(), area.Pm)
    ax.set(xlim=(0, area.angle[-1]), ylim=(1.1 * low, 1.1 * top), xlabel=ANGLE, ylabel="power (pu)")
    legend: Any = {
        "loc": "lower left",
        "bbox_to_anchor": (-0.02, 0.98),
        "ncols": 6,
        "columnspacing": 1,
        "handlelength": 1.6,
    }
    ax.legend(**legend, frameon=False, fontsize="small")
    return ax


def in_time(area: EqualArea, curve: SwingCurve) -> "Figure":
    """Plot (a) the areas of a fault and (b) its angle, speed and acceleration against time."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(12, 5), layout="constrained")
    parts: Any = figure.subfigures(1, 2)
    left, right = parts
    first = left.subplots()
    tidy(first)
    plot_equal_area(area, title="(a) ", ax=first)
    axes = right.subplots(3, 1, sharex=True)
    names = ANGLE, SPEED, "acceleration (rad/s$^2$)"
    for ax, name, y in zip(axes, names, (curve.angle, curve.speed, curve.acceleration), strict=True):
        tidy(ax)
        ax.plot(curve.t, y)
        ax.axvline(curve.clearing, color=GRAY, ls=":")
        ax.set_ylabel(name)
    axes[0].set_title("(b) dotted: fault cleared", loc="left", fontsize="medium")
    axes[-1].set_xlabel(LABELS["time"])
    right.align_ylabels(axes)
    return figure


def compare(areas: Mapping[str, EqualArea]) -> "Figure":
    """Plot the areas of several cases, given by title, side by side."""
    figure, axes = subplots(6 * len(areas), 4.8, 1, len(areas), sharey=True)
    for ax, (title, area) in zip(axes[0], areas.items(), strict=True):
        plot_equal_area(area, title=title, ax=ax)
        ax.label_outer()
    top = 1.1 * max((area.Pe + area.absorbed).max() for area in areas.values())
    axes[0, 0].set_ylim(0, top)
    return figure


def plot_swing_curve(curve: SwingCurve) -> "Figure":
    """Plot angle, speed and absorbed power against time; the clearing of the fault is dotted."""
    figure, axes = subplots(7, 6, 3, sharex=True)
    rows = (ANGLE, curve.angle), (SPEED, curve.speed), ("absorbed $P_C$ (pu)", curve.power)
    for ax, (name, y) in zip(axes[:, 0], rows, strict=True):
        ax.plot(curve.t, y)
        ax.axvline(curve.clearing, color=GRAY, ls=":")
        ax.set_ylabel(name)
    axes[-1, 0].set_xlabel(LABELS["time"])
    figure.align_ylabels(axes)
    return figure


def plot(control: MinimumTime) -> "Figure":
    """Plot states, co-states and absorbed power from clearing to rest.

    Parameters
    ----------
    control
        The solution.

    Returns
    -------
    matplotlib.figure.Figure
        Switching times are dotted.

    Raises
    ------
    StudyError
        If there is no solution.
    """
    import matplotlib.pyplot as plt

    if not control.feasible:
        raise StudyError(f"There is nothing to plot. {control.outcome}")
    figure = plt.figure(figsize=(9, 8), layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=(2, 1))
    upper, lower = parts
    _states(upper.subplots(2, 2, sharex=True), control)
    power(control, ax=lower.subplots())
    return figure


def power(control: MinimumTime, *, ax: "Axes | None" = None) -> "Axes":
    """Plot the absorbed power from clearing to rest."""
    ax = single(ax, 7, 3.5)
    tidy(ax)
    ax.plot(1e3 * control.t, control.Pc, lw=2)
    ax.axhline(0, color=GRAY, lw=0.8)
    ax.margins(y=0.3)
    ax.set(xlabel=TIME, ylabel="absorbed power $P_C$ (pu)")
    return ax


def states(control: MinimumTime) -> "Figure":
    """Plot states and co-states from clearing to rest."""
    figure, axes = subplots(9, 6, 2, 2, sharex=True)
    _states(axes, control)
    return figure


def _states(axes: np.ndarray, control: MinimumTime) -> None:
    """Fill four axes."""
    rows = control.x1, control.x2, control.lambda1, control.lambda2
    for ax, name, y in zip(axes.flat, STATES, rows, strict=True):
        tidy(ax)
        ax.plot(1e3 * control.t, y)
        for t in control.switches:
            ax.axvline(1e3 * t, color=GRAY, ls=":")
        ax.set_ylabel(name)
    for ax in axes[-1]:
        ax.set_xlabel(TIME)
    axes[0, 0].figure.align_ylabels(axes)
