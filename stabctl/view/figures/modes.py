"""Figures of modes: eigenvalues with lines of constant damping, the shape of a mode, what changes its damping."""

import math
from typing import TYPE_CHECKING, Any

from stabctl._util.wording import number
from stabctl.smallsignal import Mode, Modes, Part
from stabctl.smallsignal.eigen import ZERO
from stabctl.smallsignal.sensitivity import Sensitivity

from . import style
from .palette import COLORS, GRAY, LABELS
from .style import apart, ranked, single

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.projections.polar import PolarAxes


SIZE = 5.2, 4.2  # inches; letters stay readable on a phone
RATIOS = 0.05, 0.1, 0.2
KINDS = {  # marker, fill color, edge color
    "electromechanical mode": ("o", COLORS[0], COLORS[0]),
    "other oscillatory mode": ("o", "none", GRAY),
    "unstable": ("X", COLORS[1], COLORS[1]),
}
NAMED = 4  # arrows with a number, on each side
SMALLEST_NAMED, SMALLEST_DRAWN = 0.1, 0.02
GAP = 17.0  # deg between numbers
MOST = 20  # parameters shown


def plot_modes(modes: Modes, *, ax: "Axes | None" = None) -> "Axes":
    """Plot the oscillatory eigenvalues around the electromechanical modes, and all that grow, the upper half plane.

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

    Examples
    --------
    >>> st.load("two_area").modes().plot().figure.savefig("modes.png")
    """
    ax = single(ax, *SIZE)
    upper = modes.eigenvalues.imag > 0
    upper[modes.unstable] = True
    real, hertz = modes.eigenvalues.real, modes.frequency_hz
    swings = [*(modes.swings() or upper.nonzero()[0]), *modes.least_damped(), *modes.unstable]
    left = min(-1.0, 1.25 * min(real[swings], default=-1.0))
    right = max(-0.08 * left, 1.5 * max(real[upper], default=0.0))
    top = 1.2 * (max(hertz[swings], default=0.0) or 1.6)
    bottom = -0.04 * top * any(hertz[modes.unstable] < 0.04 * top)  # room for their marks
    inside = upper & (real > left) & (real < right) & (hertz < top)
    kind = [
        "unstable" if s.real > ZERO else "electromechanical mode" if swing else "other oscillatory mode"
        for s, swing in zip(modes.eigenvalues, modes.electromechanical, strict=True)
    ]
    for name, (marker, face, edge) in KINDS.items():
        chosen = sorted((k for k in range(len(modes)) if upper[k] and kind[k] == name), key=inside.__getitem__)
        if chosen:
            dots = ax.plot(real[chosen], hertz[chosen], marker, mfc=face, mec=edge, ls="none", label=name, zorder=3)
            style.name(dots[0], [describe(modes.mode(k)) for k in chosen if inside[k]])
    ax.set(xlim=(left, right), ylim=(bottom, top), xlabel="real part (1/s)", ylabel=LABELS["frequency"])
    ax.axvline(0, color=GRAY, linewidth=1)
    for ratio in RATIOS:
        ray(ax, ratio, left, top)
    look = {"frameon": False, "fontsize": "small", "columnspacing": 1, "handletextpad": 0}
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="lower center", bbox_to_anchor=(0.45, 1), ncols=3, **look)
    return ax


def describe(mode: Mode) -> str:
    """A mode in one line: what it is, its frequency, and its damping ratio."""
    return f"{mode.label}: {mode.frequency_hz:.3f} Hz, damping ratio {100 * mode.damping_ratio:z.2f} %"


def ray(ax: "Axes", ratio: float, left: float, top: float) -> None:
    """The line of one damping ratio from the origin to the edge of the axes, with its value near the end."""
    slope = math.sqrt(1 - ratio**2) / ratio / (2 * math.pi)  # Hz per 1/s
    real = max(left, -top / slope)
    ax.plot((0, real), (0, -real * slope), "--", color=GRAY, linewidth=0.8)
    paper = {"facecolor": "white", "edgecolor": "none", "pad": 1}
    at = 0.93 * real, -0.93 * real * slope
    ax.text(*at, f"{100 * ratio:g} %", ha="center", va="center", fontsize="small", bbox=paper, zorder=2.5)


def plot_mode_shape(mode: Mode, *, ax: "PolarAxes | None" = None) -> "PolarAxes":
    """Plot a mode shape as arrows, the largest of length 1, colored by the side of the swing.

    Parameters
    ----------
    mode
        The mode.
    ax
        Polar axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.projections.polar.PolarAxes
        The largest arrows of each side carry the numbers of their machines.

    Examples
    --------
    >>> modes = st.load("two_area").modes()
    >>> modes.mode(modes.swings()[0]).plot().figure.savefig("shape.png")
    """
    ax = _new() if ax is None else ax
    ax.set(ylim=(0, 1), yticks=(0.5, 1), xticks=[math.pi * k / 2 for k in range(4)])
    ax.tick_params(labelbottom=False, labelleft=False)
    ax.grid(alpha=0.4)
    ax.spines["polar"].set_visible(False)
    parts = sorted(mode.shape, key=lambda p: -p.magnitude)
    lead = parts[0].angle_deg if parts else 0.0
    for p in reversed([p for p in parts if p.magnitude >= SMALLEST_DRAWN]):
        angle = math.radians(p.angle_deg)
        ax.plot((0, angle), (0, p.magnitude), color=_color(p, lead), linewidth=1.6, zorder=3)
        dot = ax.plot(angle, p.magnitude, "o", color=_color(p, lead), markersize=4, clip_on=False, zorder=3)[0]
        style.name(dot, f"machine {p.machine}: {p.magnitude:.2f}, {number(p.angle_deg, 0)} degrees")
    large = [p for p in parts if p.magnitude >= SMALLEST_NAMED]
    named = [p for side in (True, False) for p in [p for p in large if _with(p, lead) is side][:NAMED]]
    for p, at in zip(named, spread([p.angle_deg for p in named], GAP), strict=True):
        rim, angle = math.radians(at), math.radians(p.angle_deg)
        ax.plot((angle, rim), (p.magnitude, 1.06), color=GRAY, linewidth=0.6, clip_on=False, zorder=2)
        ax.text(rim, 1.17, str(p.machine), color=_color(p, lead), ha="center", va="center", fontsize="small")
    return ax


def _new() -> "PolarAxes":
    """Polar axes with room for the numbers around the rim."""
    import matplotlib.pyplot as plt

    axes: Any = plt.figure(figsize=(3, 3)).add_axes((0.12, 0.12, 0.76, 0.76), projection="polar")
    return axes


def _color(p: Part, lead: float) -> str:
    return COLORS[0] if _with(p, lead) else COLORS[1]


def _with(p: Part, lead: float) -> bool:
    """Whether the machine moves with the largest arrow."""
    return math.cos(math.radians(p.angle_deg - lead)) >= 0


def spread(angles: list[float], gap: float) -> list[float]:
    """Move angles (deg) apart around the circle until they are at least `gap` apart, each group about its middle."""
    order = sorted(range(len(angles)), key=lambda i: angles[i] % 360)
    if not order:
        return []
    around = [angles[i] % 360 for i in order]
    widest = max(range(len(around)), key=lambda i: (around[i] - around[i - 1]) % 360 or 360)
    order = order[widest:] + order[:widest]
    start = angles[order[0]] % 360
    placed = apart([start + (angles[i] % 360 - start) % 360 for i in order], gap)
    return [at for _, at in sorted(zip(order, placed, strict=True))]


def plot_sensitivity(found: Sensitivity, *, ax: "Axes | None" = None) -> "Axes":
    """Plot by how much parameters change the damping ratio of a mode, the 20 with the largest changes.

    Parameters
    ----------
    found
        The sensitivities.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        Changes in percentage points per 1 % of each parameter, or per 0.01 of its unit if it is 0.

    Examples
    --------
    >>> st.load("two_area").modes().sensitivity("pss").plot().figure.savefig("sensitivity.png")
    """
    rows = found.rows[:MOST]
    ax = single(ax, SIZE[0], 1.2 + 0.24 * len(rows))
    percent = [100 * row.damping_ratio for row in rows]
    for bar, row, size in zip(ax.barh(range(len(rows)), percent, 0.6, color=COLORS[0]), rows, percent, strict=True):
        style.name(bar, f"{row.path} = {row.value:g} {row.unit}: {size:+.3g} % per {row.step:g}")
    ranked(ax, [row.path if row.value else f"{row.path} (0)" for row in rows])
    ax.axvline(0, color=GRAY, linewidth=1)
    ax.set_xlabel("change of the damping ratio (%) per 1 % of the parameter")
    return ax
