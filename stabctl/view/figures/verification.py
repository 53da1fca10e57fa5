"""Figure of a verification: reference oscillations and ours on one plane, and the differences of all numbers."""

from typing import TYPE_CHECKING

import numpy as np

from stabctl.verification.compare import SWING, UNITS, Verification

from . import style
from .palette import COLORS, GRAY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE = 9.6, 4.4  # inches
LEFT, TOP = -3.5, 2.6  # 1/s, Hz   edges of the plane
LEAST = 1e-8  # a smaller difference is drawn there


def plot(found: Verification) -> "Figure":
    """Draw the oscillations of the references with ours, and how much every number differs.

    Parameters
    ----------
    found : Verification
        Of one or more systems.

    Returns
    -------
    matplotlib.figure.Figure
        Left: frequency (Hz) against real part (1/s) of oscillations from 0.1 to 5 Hz; those above 2.6 Hz or left of
        -3.5 1/s are outside. Right: the difference of every number in the unit of its quantity, from small to large.

    Examples
    --------
    >>> st.verify("wscc9_sauer_pai").plot().savefig("verification.png")
    """
    figure, axes = style.subplots(*SIZE, columns=2)
    _plane(axes[0, 0], found)
    _spread(axes[0, 1], found)
    return figure


def _plane(ax: "Axes", found: Verification) -> None:
    rows = [row for row in found.rows if row.swing]
    for name, marker, color, size in (("reference", "o", COLORS[0], 7.0), ("here", "+", COLORS[1], 5.0)):
        s = np.array([complex(row.published if name == "reference" else row.ours) for row in rows])
        ax.plot(s.real, s.imag / (2 * np.pi), marker, mfc="none", mec=color, ms=size, mew=1.1, ls="none", label=name)
    ax.axvline(0, color=GRAY, linewidth=0.8)
    theirs = [complex(row.published) for row in rows]
    ax.set(xlabel="real part (1/s)", ylabel="frequency (Hz)", ylim=(0, TOP))
    ax.set_xlim(LEFT, max([0.5, *(1.1 * s.real for s in theirs)]))
    shown = sum(s.real > LEFT and s.imag < 2 * np.pi * TOP for s in theirs)
    number = f"{shown} of {len(rows)}, the others outside" if shown < len(rows) else f"{shown}"
    ax.set_title(f"Oscillations between {SWING[0]:g} and {SWING[1]:g} Hz: {number}")
    ax.legend(loc="upper left")


def _spread(ax: "Axes", found: Verification) -> None:
    for color, (quantity, unit) in zip([*COLORS, *COLORS], UNITS.items(), strict=False):
        off = np.sort([row.difference for row in found.rows if row.quantity == quantity])
        if len(off):
            share = 100 * (np.arange(len(off)) + 1) / len(off)
            ax.plot(np.maximum(off, LEAST), share, ".-", ms=3, color=color, label=f"{quantity} ({unit}), {len(off)}")
    ax.set(xscale="log", xlabel="difference, in the unit of the quantity", ylabel="share of the numbers (%)")
    ax.set_title("Differences not above a value")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
