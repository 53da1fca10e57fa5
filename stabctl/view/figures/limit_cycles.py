"""Nyquist figure of limit cycles: the loop gain L(jw) and -1/N(A) of what limits the output."""

from typing import TYPE_CHECKING

import numpy as np

from stabctl.smallsignal.limit_cycles import LimitCycles

from .palette import COLORS, GRAY
from .style import single

if TYPE_CHECKING:
    from matplotlib.axes import Axes


SIZE = 5.0, 5.2  # inches
WIDE = 1.6  # limits of the axes, relative to the largest limit cycle


def plot(found: LimitCycles, *, ax: "Axes | None" = None) -> "Axes":
    """Plot the loop gain and -1/N(A); limit cycles are where they meet.

    Parameters
    ----------
    found
        The limit cycles of a closed loop.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        L(jw) with the sign of negative feedback, for frequencies of the band. With several limited outputs there is a
        curve for each limit cycle, at the output with the largest amplitude.

    Examples
    --------
    >>> options = {"rate": 60, "delay": "200ms", "relay": True, "deadband": 2e-5, "limits": 1}
    >>> relay = st.Controller("deviation:1", "order:1@5", [], [], [], [[1.0]], **options)
    >>> st.load("two_area").limit_cycles(relay, storage="100MW").plot().figure.savefig("cycles.png")
    """
    ax = single(ax, *SIZE)
    for k, curve in enumerate(found.curves):
        ax.plot(curve.gain.real, curve.gain.imag, color=COLORS[k % len(COLORS)], label=f"L(jw), {curve.name}")
        gain = curve.acts.gain(curve.acts.grid())
        inverse = -1 / gain[gain > 0]
        ax.plot(
            inverse, np.zeros(len(inverse)), color=GRAY, linewidth=3, label="-1/N(A)" if k == 0 else None, zorder=1.5
        )
    for stable, name, size, fill in ((True, "stable limit cycle", 5, "k"), (False, "unstable limit cycle", 10, "none")):
        at = sorted({c.inverse for c in found.cycles if c.stable == stable})
        if at:
            ax.plot(at, np.zeros(len(at)), "o", ms=size, mfc=fill, mec="k", ls="none", label=name, zorder=3)
    for place, text in sorted({(c.inverse, f"{c.frequency_hz:.3g} Hz") for c in found.cycles}):
        ax.annotate(text, (place, 0), xytext=(0, 9), textcoords="offset points", ha="center", fontsize="small")
    half = _half(found)
    ax.set(xlim=(-half, half), ylim=(-half, half), xlabel="real part", ylabel="imaginary part", aspect="equal")
    if not found.curves:
        ax.set_title("no loop gain to show", fontsize="medium")
    ax.axhline(0, color=GRAY, linewidth=0.8, zorder=1)
    ax.axvline(0, color=GRAY, linewidth=0.8, zorder=1)
    ax.locator_params(nbins=5)
    ax.ticklabel_format(scilimits=(-2, 3))
    if found.curves:
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, frameon=False, fontsize="small")
    return ax


def _half(found: LimitCycles) -> float:
    """Half the width of the axes: the limit cycles are inside, or else the nearest end of -1/N(A), if there is one."""
    if found.cycles:
        return WIDE * max(abs(c.inverse) for c in found.cycles)
    return WIDE * max((1 / float(c.acts.gain(c.acts.grid()).max()) for c in found.curves), default=1.0)
