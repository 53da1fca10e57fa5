"""Figures of the equal-area criterion (the paper's Figures 4, 5 and 9)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from stabctl.theory.equal_area import EqualArea
from stabctl.theory.swing_curve import SwingCurve

from .phase_plane import ANGLE, SPEED
from .style import COLORS, GRAY, LABELS, single, subplots, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot(area: EqualArea, *, title: str = "", ax: "Axes | None" = None) -> "Axes":
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
    ax.set(xlim=(0, area.angle[-1]), ylim=(0, 1.1 * max(lifted.max(), area.Pm)), xlabel=ANGLE, ylabel="power (pu)")
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
    plot(area, title="(a) ", ax=first)
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
        plot(area, title=title, ax=ax)
        ax.label_outer()
    top = 1.1 * max((area.Pe + area.absorbed).max() for area in areas.values())
    axes[0, 0].set_ylim(0, top)
    return figure
