"""One look for every figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c564b")  # Okabe-Ito


def figure(
    width: float, height: float, rows: int = 1, columns: int = 1, **options: object
) -> "tuple[Figure, Sequence]":
    """A figure (inches) and its axes, drawn without a screen."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    fig = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(fig)
    axes = fig.subplots(rows, columns, squeeze=False, **options)
    for ax in axes.flat:
        ax.grid(alpha=0.25)
        ax.spines[["top", "right"]].set_visible(False)
        ax.set_prop_cycle(color=COLOURS)
    return fig, axes


def legend(ax: "Axes", lines: int, title: str | None = None) -> None:
    """A legend beside the axes while the lines can be told apart."""
    if 0 < lines <= len(COLOURS):
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, title=title, fontsize="small")
