"""Figures of the minimum-time control (the paper's Figures 10 and 11)."""

from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl.errors import StudyError
from stabctl.theory.minimum_time import MinimumTime

from .style import GRAY, single, subplots, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STATES = "$x_1$ (rad)", "$x_2$ (rad/s)", "$\\lambda_1$ (s/rad)", "$\\lambda_2$ (s$^2$/rad)"
TIME = "time after clearing (ms)"


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


def states(control: MinimumTime) -> "Figure":
    """Plot states and co-states from clearing to rest."""
    figure, axes = subplots(9, 6, 2, 2, sharex=True)
    _states(axes, control)
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
