"""Figure of pairs of signals and inputs: their scores for damping a mode."""

from typing import TYPE_CHECKING

import numpy as np

from stabctl.design.pairs import Pairs

from .style import COLORS, single

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST = 20  # pairs shown


def plot(pairs: Pairs, *, ax: "Axes | None" = None) -> "Axes":
    """Plot the scores of the best pairs.

    Parameters
    ----------
    pairs
        The ranked pairs.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        One bar for each of the 20 best pairs.
    """
    first = pairs.df.head(MOST)
    ax = single(ax, 6.4, 1.2 + 0.24 * len(first))
    at = np.arange(len(first))
    ax.barh(at, first["score"], height=0.6, color=COLORS[0])
    ax.set_yticks(at, [f"{row.input} to {row.output}" for row in first.itertuples()], fontsize="small")
    ax.set(xlabel=f"score (1/s), mode at {pairs.mode_hz:.3f} Hz", ylim=(len(first) - 0.5, -0.5))
    ax.grid(visible=False, axis="y")
    return ax
