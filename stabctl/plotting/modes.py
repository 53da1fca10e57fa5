"""Figure of the eigenvalues of a system, with lines of constant damping ratio."""

import math
from typing import TYPE_CHECKING

from stabctl.smallsignal import Mode, Modes
from stabctl.smallsignal.eigen import ZERO

from . import tooltips
from .style import COLORS, GRAY, LABELS, single

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = 5.2, 4.2  # inches; letters stay readable on a phone
RATIOS = 0.05, 0.1, 0.2
KINDS = {  # marker, fill color, edge color
    "electromechanical mode": ("o", COLORS[0], COLORS[0]),
    "other oscillatory mode": ("o", "none", GRAY),
    "unstable": ("X", COLORS[1], COLORS[1]),
}


def plot(modes: Modes, *, ax: "Axes | None" = None) -> "Axes":
    """Plot the oscillatory eigenvalues around the electromechanical modes, the upper half of the complex plane.

    Parameters
    ----------
    modes
        The modes of a linear model.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        Frequency (Hz) against real part (1/s). Modes that are better damped or faster lie outside.
    """
    ax = single(ax, *SIZE)
    upper = modes.eigenvalues.imag > 0
    real, hertz = modes.eigenvalues.real, modes.frequency_hz
    swings = modes.swings() or [k for k in range(len(modes)) if upper[k]]
    left = min(-1.0, 1.25 * min(real[swings], default=-1.0))
    right = max(-0.08 * left, 1.5 * max(real[upper], default=0.0))
    top = 1.2 * max(hertz[swings], default=1.6)
    inside = upper & (real > left) & (real < right) & (hertz < top)
    kind = [
        "unstable" if s.real > ZERO else "electromechanical mode" if swing else "other oscillatory mode"
        for s, swing in zip(modes.eigenvalues, modes.electromechanical, strict=True)
    ]
    for name, (marker, face, edge) in KINDS.items():
        chosen = sorted((k for k in range(len(modes)) if upper[k] and kind[k] == name), key=inside.__getitem__)
        if chosen:
            dots = ax.plot(real[chosen], hertz[chosen], marker, mfc=face, mec=edge, ls="none", label=name, zorder=3)
            tooltips.name(dots[0], [describe(modes.mode(k)) for k in chosen if inside[k]])
    ax.set(xlim=(left, right), ylim=(0, top), xlabel="real part (1/s)", ylabel=LABELS["frequency"])
    ax.axvline(0, color=GRAY, linewidth=1)
    for ratio in RATIOS:
        ray(ax, ratio, left, top)
    look = {"frameon": False, "fontsize": "small", "columnspacing": 1, "handletextpad": 0}
    ax.legend(loc="lower center", bbox_to_anchor=(0.45, 1), ncols=3, **look)
    return ax


def describe(mode: Mode) -> str:
    """A mode in one line: what it is, its frequency, and its damping ratio."""
    return f"{mode.label}: {mode.frequency_hz:.3f} Hz, damping ratio {100 * mode.damping_ratio:.2f} %"


def ray(ax: "Axes", ratio: float, left: float, top: float) -> None:
    """The line of one damping ratio from the origin to the edge of the axes, with its value near the end."""
    slope = math.sqrt(1 - ratio**2) / ratio / (2 * math.pi)  # Hz per 1/s
    real = max(left, -top / slope)
    ax.plot((0, real), (0, -real * slope), "--", color=GRAY, linewidth=0.8)
    paper = {"facecolor": "white", "edgecolor": "none", "pad": 1}
    at = 0.93 * real, -0.93 * real * slope
    ax.text(*at, f"{100 * ratio:g} %", ha="center", va="center", fontsize="small", bbox=paper, zorder=2.5)
