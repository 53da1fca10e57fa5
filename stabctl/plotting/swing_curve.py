"""Figures of swing curves: one machine in time."""

from typing import TYPE_CHECKING

from stabctl.theory.swing_curve import SwingCurve

from .phase_plane import ANGLE, SPEED
from .style import GRAY, LABELS, subplots

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot(curve: SwingCurve) -> "Figure":
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
