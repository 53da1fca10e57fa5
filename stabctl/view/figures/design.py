"""Figures of a design: modes, root locus, loop gains, step responses, and pairs of signals."""

from typing import TYPE_CHECKING

import numpy as np

from stabctl.design.evidence import Evidence
from stabctl.design.pairs import Pairs
from stabctl.design.result import FAST, Design
from stabctl.design.tuning.robustness import RingDown

from . import style
from .modes import RATIOS, ray
from .palette import COLORS, GRAY, LABELS
from .style import single, subplots

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stabctl.smallsignal.modes import Modes


SIZE, TALL, LOW = (5.2, 4.2), (5.6, 5.0), (5.6, 3.2)  # inches; letters stay readable on a phone
WIDE = 50  # letters in a row of a legend
MOST = 20  # pairs shown
EACH = 15  # points of a simulation, of which one is drawn


def plot_design(design: Design, *, ax: "Axes | None" = None) -> "Axes":
    """Plot the modes of all operating points without and with the controllers, the upper half of the complex plane.

    Parameters
    ----------
    design
        The design.
    ax
        Axes to draw on. Default: a new figure.

    Examples
    --------
    >>> base = st.load("two_area_thyristor").initialize(storage="3@11=50MW")
    >>> found = st.design.pod(base, "deviation:3", "order:3@11", damping=0.05)
    >>> found.plot().figure.savefig("design.png")
    """
    ax = single(ax, *SIZE)
    for several, color, marker, label in (
        (design.before, GRAY, "o", "without"),
        (design.after, COLORS[0], "s", "with"),
    ):
        s = np.concatenate([m.eigenvalues for m in several])
        _dots(ax, s, color, marker, label)
    _plane(ax, (*design.before, *design.after))
    _above(ax)
    return ax


def locus(found: Evidence) -> "Axes":
    """Plot the root locus: the eigenvalues with 0 to 2 times the gains, from light to dark."""
    import matplotlib as mpl

    ax, (low, high) = single(None, *SIZE), found.locus.factors[[0, -1]]
    colors = mpl.colormaps["viridis_r"]
    for k, s in zip(found.locus.factors, found.locus.eigenvalues, strict=True):
        upper = s[s.imag > 0]
        ax.plot(upper.real, upper.imag / (2 * np.pi), ".", ms=4, color=colors(0.1 + 0.9 * (k - low) / (high - low)))
    for k, color, marker, label in ((0.0, GRAY, "o", "without"), (1.0, COLORS[1], "s", "as designed")):
        _dots(ax, found.locus.eigenvalues[int(np.abs(found.locus.factors - k).argmin())], color, marker, label)
    _plane(ax, (found.design.before[0], found.design.after[0]))
    _above(ax)
    return ax


def bode(found: Evidence) -> "Figure":
    """Plot the loop gains: magnitude and phase, opened at one output each."""
    figure, axes = subplots(*TALL, 2, 1, sharex=True)
    size, phase = axes[:, 0]
    for loop in found.loops:
        curves = size.loglog(loop.hz, np.abs(loop.response), label=loop.name)
        curves += phase.semilogx(loop.hz, np.rad2deg(np.unwrap(np.angle(loop.response))))
        for curve in curves:
            style.name(curve, loop.name)
    size.axhline(1, color=GRAY, linewidth=1)
    size.set_ylabel("magnitude")
    phase.set(xlabel=LABELS["frequency"], ylabel="phase (deg)")
    _above(size)
    figure.align_ylabels(axes)
    return figure


def steps(found: Evidence) -> "Figure":
    """Plot the speeds after a load step, without and with the controllers."""
    scale = 1e3 * found.design.base.case.frequency_hz  # mHz per pu
    figure, axes = subplots(*TALL, 2, 1, sharex=True)
    for ax, (t, y), what in zip(axes[:, 0], (found.steps.before, found.steps.after), ("without", "with"), strict=True):
        for name, row in zip(found.steps.machines, y.T, strict=True):
            style.name(ax.plot(t, scale * row, linewidth=1, label=f"machine {name}")[0], f"machine {name}, {what}")
        ax.set_ylabel(f"{what} (mHz)")
    _above(axes[0, 0])
    axes[1, 0].set_xlabel(LABELS["time"])
    figure.align_ylabels(axes)
    return figure


def ring_down(found: RingDown, frequency_hz: float) -> "Axes":
    """Plot the speeds after a pulse of load, of the machines that swing most: simulated, and by the linear model."""
    ax, scale = single(None, *LOW), 1e3 * frequency_hz  # mHz per pu
    most = np.argsort(-np.abs(found.linear).max(axis=0))[: len(COLORS)]
    for k, color in zip(sorted(most), COLORS, strict=False):
        name = f"machine {found.machines[k]}"
        ax.plot(found.time[::EACH], scale * found.simulated[::EACH, k], ".", color=color, markersize=4)
        style.name(ax.plot(found.time, scale * found.linear[:, k], linewidth=1, color=color, label=name)[0], name)
    ax.set(xlabel=LABELS["time"], ylabel="speed deviation (mHz)")
    _above(ax)
    return ax


def own_steps(found: Evidence) -> "Axes":
    """Plot what every controller gives after a unit step of its input."""
    ax = single(None, *LOW)
    for name, t, y in found.steps.own:
        for row in y.T:
            style.name(ax.plot(t, row, linewidth=1, label=name)[0], name)
    ax.set(xlabel=LABELS["time"], ylabel="output")
    _above(ax)
    return ax


def plot_pairs(pairs: Pairs, *, ax: "Axes | None" = None) -> "Axes":
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

    Examples
    --------
    >>> st.design.pairs(st.load("two_area_thyristor"), storage="50MW").plot().figure.savefig("pairs.png")
    """
    first = pairs.df.head(MOST)
    ax = single(ax, 6.4, 1.2 + 0.24 * len(first))
    at = np.arange(len(first))
    ax.barh(at, first["score"], height=0.6, color=COLORS[0])
    ax.set_yticks(at, [f"{row.input} to {row.output}" for row in first.itertuples()], fontsize="small")
    ax.set(xlabel=f"score (1/s), mode at {pairs.mode_hz:.3f} Hz", ylim=(len(first) - 0.5, -0.5))
    ax.grid(visible=False, axis="y")
    return ax


def _above(ax: "Axes") -> None:
    """A legend above the axes, if there are few enough lines to tell apart."""
    labels = ax.get_legend_handles_labels()[1]
    if 0 < len(labels) <= len(COLORS):
        columns = max(1, min(len(labels), WIDE // max(map(len, labels))))
        ax.legend(loc="lower center", bbox_to_anchor=(0.45, 1), ncols=columns, frameon=False, fontsize="small")


def _dots(ax: "Axes", s: np.ndarray, color: str, marker: str, label: str) -> None:
    upper = s[s.imag > 0]
    face = "none" if color == GRAY else color
    ax.plot(upper.real, upper.imag / (2 * np.pi), marker, mfc=face, mec=color, ms=5, ls="none", label=label, zorder=3)


def _plane(ax: "Axes", several: "Sequence[Modes]") -> None:
    """Limits around the electromechanical modes and the least damped ones, and lines of constant damping ratio."""
    s = np.concatenate([m.eigenvalues[[*m.swings(), *m.least_damped()]] for m in several])
    left = min(-1.0, 1.15 * s.real.min(initial=0.0))
    right = max(-0.08 * left, 1.5 * s.real.max(initial=0.0))
    top = min(FAST, 1.4 * s.imag.max(initial=2 * np.pi) / (2 * np.pi))
    ax.set(xlim=(left, right), ylim=(0, top), xlabel="real part (1/s)", ylabel=LABELS["frequency"])
    ax.axvline(0, color=GRAY, linewidth=1)
    for ratio in RATIOS:
        ray(ax, ratio, left, top)
