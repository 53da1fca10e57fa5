"""Bode figures: the frequency response of a linear model, and loop gains with their gain and phase margins."""

from typing import TYPE_CHECKING

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.smallsignal.margins import LoopMargins, Margins
from stabctl.smallsignal.model import Model

from .palette import COLORS, GRAY, LABELS
from .style import legend_beside, subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


BAND = (0.05, 5.0)  # Hz
POINTS = 400
SIZE = 7.0, 5.4  # inches, of the figure of margins
MOST = 4  # loops that are shown
SEEN = 1e-3  # of the largest loop gain; frequencies at which all are smaller are left out
FLOOR = -60.0  # dB   loop gains below it are not shown


def plot_frequency_response(model: Model, *, band: tuple[float, float] = BAND) -> "Figure":
    """Plot the frequency response from each input to each output of a linear model.

    Parameters
    ----------
    model
        The linear model, with inputs and outputs.
    band
        Lowest and highest frequency, Hz.

    Returns
    -------
    matplotlib.figure.Figure
        The magnitude, in output units per input unit, and below it the phase.

    Raises
    ------
    StudyError
        If the model has no inputs or no outputs.
    """
    if not model.inputs or not model.outputs:
        raise StudyError(
            "A frequency response needs inputs and outputs; linearize with inputs='vref:2' and outputs='speed:2', for "
            "example."
        )
    hz = np.geomspace(*band, POINTS)
    response = model.response(hz)
    figure, axes = subplots(8, 5, 2, 1, sharex=True)
    magnitude, phase = axes[:, 0]
    for i, output in enumerate(model.outputs):
        for j, name in enumerate(model.inputs):
            magnitude.loglog(hz, np.abs(response[:, i, j]), label=f"{name} to {output}")
            phase.semilogx(hz, np.rad2deg(np.unwrap(np.angle(response[:, i, j]))))
    magnitude.set_ylabel("magnitude")
    phase.set(xlabel=LABELS["frequency"], ylabel="phase (deg)")
    legend_beside(magnitude, magnitude.get_legend_handles_labels()[1])
    figure.align_ylabels(axes)
    return figure


def plot_margins(found: Margins) -> "Figure":
    """Plot the loop gain of each output, all others closed: size and phase over frequency.

    Parameters
    ----------
    found
        The margins of controllers.

    Returns
    -------
    matplotlib.figure.Figure
        With negative feedback the loop becomes unstable where the loop gain is 0 dB at -180 degrees. A vertical line
        from 0 dB is a gain margin, one from -180 degrees the phase margin; the legend has their values. Of several
        loops those with the smallest disk margins are shown, at most 4.

    Raises
    ------
    StudyError
        If the controllers have no single loops.

    Examples
    --------
    >>> found = st.load("two_area").margins(st.Feedback(10.0), storage="1=50MW")
    >>> found.plot().savefig("margins.png")
    """
    if not found.loops:
        raise StudyError("There is no loop to plot: the controllers have several rates, or no linear part.")
    figure, axes = subplots(*SIZE, rows=2, sharex=True)
    size, phase = axes[:, 0]
    order = sorted(range(len(found.loops)), key=lambda r: found.loops[r].disk)[:MOST]
    shown = np.abs(found.gain[:, order])
    within = np.flatnonzero((shown > SEEN * shown.max()).any(axis=1))
    part = slice(within[0], within[-1] + 1) if len(within) else slice(None)
    for k, r in enumerate(order):
        hz, gain = found.hz[part], found.gain[part, r]
        with np.errstate(divide="ignore"):
            size.plot(
                hz, np.maximum(20 * np.log10(np.abs(gain)), FLOOR), color=COLORS[k], label=_margins(found.loops[r])
            )
        phase.plot(hz, _degrees(gain), color=COLORS[k])
        _gains(size, found.loops[r], COLORS[k])
        _phases(phase, found.loops[r], COLORS[k], hz, gain)
    size.axhline(0, color=GRAY, linewidth=0.8, zorder=1)
    phase.axhline(-180, color=GRAY, linewidth=0.8, zorder=1)
    size.set(xscale="log", ylabel="loop gain (dB)")
    phase.set(xlabel=LABELS["frequency"], ylabel="phase (deg)", yticks=range(-360, 1, 90), ylim=(-370, 10))
    few = f"{len(order)} of {len(found.loops)} loops, those with the smallest disk margins"
    title = few if len(found.loops) > len(order) else None
    size.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, frameon=False, fontsize="small", title=title)
    figure.align_ylabels(axes)
    return figure


def _margins(loop: LoopMargins) -> str:
    """Name and margins of a loop."""
    factors = (loop.gain_up, loop.gain_up_hz), (loop.gain_down, loop.gain_down_hz)
    told = [f"{20 * np.log10(factor):+.1f} dB" for factor, hz in factors if 0 < factor < np.inf and 0 < hz < np.inf]
    told += [f"{loop.phase_deg:.0f} deg"] * bool(np.isfinite(loop.phase_deg))
    return f"{loop.name}: {', '.join(told)}" if told else loop.name


def _degrees(gain: np.ndarray) -> np.ndarray:
    """Angles of a loop gain from -360 to 0 degrees, nan where they leap from one end to the other."""
    angle = np.rad2deg(np.angle(-gain)) - 180
    angle[1:][np.abs(np.diff(angle)) > 180] = np.nan
    return angle


def _gains(ax: "Axes", loop: LoopMargins, color: str) -> None:
    """The gain margins, from the loop gain to 0 dB."""
    for factor, hz in ((loop.gain_up, loop.gain_up_hz), (loop.gain_down, loop.gain_down_hz)):
        if 0 < factor < np.inf and 0 < hz < np.inf:
            change = 20 * np.log10(factor)
            ax.plot([hz, hz], [-change, 0], color=color, linewidth=2.5, solid_capstyle="butt")


def _phases(ax: "Axes", loop: LoopMargins, color: str, hz: np.ndarray, gain: np.ndarray) -> None:
    """The phase margin, from the phase to -180 degrees."""
    if np.isfinite(loop.phase_deg):
        side = np.sign(np.angle(-gain[np.abs(hz - loop.phase_hz).argmin()]))
        ax.plot([loop.phase_hz] * 2, [-180, -180 + side * loop.phase_deg], color=color, linewidth=2.5)
