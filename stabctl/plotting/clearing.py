"""Figures of clearing times: against the place of a fault, against the size of the storage."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from .style import COLOURS, figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def against_place(
    places: Sequence[float],
    curves: Mapping[str, Sequence[float]],
    cleared: float,
    between: tuple[float, float],
    line: str,
) -> "Figure":
    """Critical clearing time (cycles) against the place of a fault; `between`, `cleared` parts the curves."""
    fig, axes = figure(8, 4.4)
    ax = axes[0, 0]
    for k, (name, values) in enumerate(curves.items()):
        ax.plot(places, values, "os"[k % 2] + "-", label=name)
    ax.axhline(cleared, color="0.35", linestyle="--", linewidth=1)
    ax.annotate(f"{cleared:g} cycles", (places[0], cleared), (0, 4), textcoords="offset points", color="0.35")
    text = f"{cleared:g} cycles: lost without,\nstable with storage\n({between[0]:.2f} to {between[1]:.2f})"
    ax.axvspan(*between, color=COLOURS[4], alpha=0.25, label=text)
    ax.set_xlabel(f"place of the fault along {line}, fraction from its first bus")
    ax.set_ylabel("critical clearing time, cycles")
    ax.legend(frameon=False)
    return fig


def against_size(sizes: Sequence[float], curves: Mapping[str, Sequence[float]], label: str) -> "Figure":
    """Critical clearing time (cycles) against the rating of the storage devices, a curve per reading: Table 4."""
    fig, axes = figure(7, 4.2)
    ax = axes[0, 0]
    for k, (name, values) in enumerate(curves.items()):
        ax.plot(sizes, values, "os^D"[k % 4] + "-", label=name)
    ax.set_xlabel(label)
    ax.set_ylabel("critical clearing time, cycles")
    ax.legend(frameon=False)
    return fig
