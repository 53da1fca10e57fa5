"""Pictures of the one- and two-machine theory, Figures 3, 4, 5, 7, 9, 10, 11: records in, Figure out."""

from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import NDArray

from stabctl.errors import StudyError
from stabctl.theory.equal_area import EqualArea
from stabctl.theory.feedback_laws import FeedbackComparison
from stabctl.theory.minimum_time import MinimumTime
from stabctl.theory.phase import PhasePortrait, Separatrix
from stabctl.theory.swing_curve import SwingCurve

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ANGLE, SPEED, POWER = "angle $\\delta$ (rad)", "speed $\\dot\\delta$ (rad/s)", "power (pu)"


def save(figure: "Figure", path: Path) -> None:
    """Write a picture in the format of the file's ending. Raises StudyError where that cannot be done."""
    try:
        figure.savefig(path, dpi=150)
    except (OSError, ValueError) as error:
        raise StudyError(
            f"the picture {path} cannot be written: {getattr(error, 'strerror', None) or str(error).splitlines()[0]}"
        ) from None


def phase_plane(portrait: PhasePortrait) -> "Figure":
    """Figure 3: separatrix and fault trajectories, the faulted part thick."""
    figure = _figure(7, 5)
    ax = figure.subplots()
    _separatrix(ax, portrait.separatrix)
    for i, (c, run) in enumerate(zip(portrait.cleared, portrait.curves, strict=True)):
        fault = run.t <= run.clearing
        line = ax.plot(run.angle[~fault], run.speed[~fault], lw=1, label=f"{c.cycles:g} cycles")[0]
        ax.plot(run.angle[fault], run.speed[fault], lw=2.5, color=line.get_color(), zorder=3 - 0.1 * i)
        ax.plot(c.angle, c.speed, "o", color=line.get_color(), zorder=4)
        ax.annotate(chr(ord("B") + i), (c.angle, c.speed), (-12, 5), textcoords="offset points")
    ax.plot(portrait.start, 0, "ko", zorder=4)
    ax.annotate("A", (portrait.start, 0), (-12, -13), textcoords="offset points")
    left, right = portrait.separatrix.angle[[0, -1]]
    ax.set(xlim=(left - 0.3, right + 0.6), xlabel=ANGLE, ylabel=SPEED)
    ax.set_ylim(-1.2 * portrait.separatrix.speed.max(), 1.35 * portrait.separatrix.speed.max())
    ax.legend(loc="upper center", ncols=4, frameon=False)
    return figure


def power_angle(area: EqualArea) -> "Figure":
    """Figure 4: the power-angle curve with the accelerating and decelerating areas."""
    figure = _figure(7, 4.5)
    _areas(figure.subplots(), area)
    return figure


def fault_in_time(area: EqualArea, run: SwingCurve) -> "Figure":
    """Figure 5: (a) the areas, (b) angle, speed and acceleration against time."""
    figure = _figure(12, 5)
    left, right = figure.subfigures(1, 2)
    _areas(left.subplots(), area, "(a)")
    axes = right.subplots(3, 1, sharex=True)
    names = (ANGLE, SPEED, "acceleration (rad/s$^2$)")
    for ax, name, y in zip(axes, names, (run.angle, run.speed, run.acceleration), strict=True):
        ax.plot(run.t, y)
        ax.axvline(run.clearing, color="gray", ls=":")
        ax.set_ylabel(name)
    axes[0].set_title("(b)", loc="left")
    axes[-1].set_xlabel("time (s)")
    right.align_ylabels(axes)
    return figure


def feedback(comparison: FeedbackComparison) -> "Figure":
    """Figure 7: the feedback laws in the phase plane, each in its own frame on the same axes."""
    figure = _figure(10, 8)
    axes = figure.subplots(2, -(-len(comparison.responses) // 2), sharex=True, sharey=True).ravel()
    for ax, response in zip(axes, comparison.responses, strict=False):
        _separatrix(ax, comparison.separatrix)
        run = response.curve
        ax.plot(run.angle, run.speed, lw=1)
        ax.plot(comparison.start, 0, "ko", ms=4)
        ax.set_title(f"{response.name}: peak {response.peak_angle:.3f} rad", fontsize=10)
        ax.label_outer()
        ax.set(xlabel=ANGLE, ylabel=SPEED)
        ax.label_outer()
    top = 1.25 * comparison.separatrix.speed.max()
    axes[0].set(xlim=comparison.separatrix.angle[[0, -1]] + [-0.3, 0.6], ylim=(-top, top))
    return figure


def two_machine(without: EqualArea, absorbing: EqualArea) -> "Figure":
    """Figure 9: the areas of the two-machine system (a) without and (b) with the absorbed power."""
    figure = _figure(12, 4.8)
    axes = figure.subplots(1, 2, sharey=True)
    for ax, area, title in zip(axes, (without, absorbing), ("(a)", "(b)"), strict=True):
        _areas(ax, area, title)
    axes[1].set_ylabel("")
    return figure


def optimal_states(control: MinimumTime) -> "Figure":
    """Figure 10: states and co-states from release to rest."""
    figure = _figure(9, 6)
    _states(figure.subplots(2, 2, sharex=True), control)
    return figure


def optimal_power(control: MinimumTime) -> "Figure":
    """Figure 11: the absorbed power from release to rest."""
    figure = _figure(7, 3.5)
    _power(figure.subplots(), control)
    return figure


def optimal(control: MinimumTime) -> "Figure":
    """Figures 10 and 11 in one."""
    figure = _figure(9, 8)
    upper, lower = figure.subfigures(2, 1, height_ratios=(2, 1))
    _states(upper.subplots(2, 2, sharex=True), control)
    _power(lower.subplots(), control)
    return figure


def _figure(width: float, height: float) -> "Figure":
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _separatrix(ax: "Axes", separatrix: Separatrix) -> None:
    for sign in (1, -1):
        label = "stability region" if sign > 0 else None
        ax.plot(separatrix.angle, sign * separatrix.speed, "k:", lw=1.2, label=label)


def _areas(ax: "Axes", area: EqualArea, title: str = "") -> None:
    lifted = area.Pe + area.absorbed
    ax.plot(area.angle, area.Pe, "k", label="$P_e$")
    if area.absorbed:
        ax.plot(area.angle, lifted, "k--", label="$P_e + P_C$")
    if area.Pe_fault.any():
        ax.plot(area.angle, area.Pe_fault, "k-.", label="$P_e$ in the fault")
    ax.axhline(area.Pm, color="tab:blue", lw=1, label="$P_m$")
    during = (area.angle >= area.start) & (area.angle <= area.clearing)
    after = (area.angle >= area.clearing) & (area.angle <= area.stop)
    ax.fill_between(area.angle, area.Pe_fault, area.Pm, where=during, color="tab:red", alpha=0.35, label="$A1$")
    ax.fill_between(area.angle, area.Pm, lifted, where=after, color="tab:green", alpha=0.35, label="$A2$")
    end = "$\\delta_1$" if area.stable else "$\\delta_u$"
    marks = {"$\\delta_0$": area.start, "$\\delta_{cl}$": area.clearing, end: area.stop}
    top = 1.3 * max(lifted.max(), area.Pm)
    for name, angle in marks.items():
        ax.axvline(angle, 0, 0.88, color="gray", lw=0.8, ls=":")
        ax.annotate(name, (angle, 0), (3, 4), textcoords="offset points")
    fate = f"rest at {area.stop:.3f} rad" if area.stable else "lost"
    ax.set_title(f"{title} A1 = {area.A1:.4f}, A2 = {area.A2:.4f} pu rad: {fate}".strip(), fontsize=10, loc="left")
    ax.set(xlim=(0, area.angle[-1]), ylim=(0, top), xlabel=ANGLE, ylabel=POWER)
    ax.legend(loc="upper center", ncols=6, frameon=False, fontsize=9, columnspacing=1)


def _states(axes: "NDArray[Axes]", control: MinimumTime) -> None:
    names = ("$x_1$ (rad)", "$x_2$ (rad/s)", "$\\lambda_1$ (s/rad)", "$\\lambda_2$ (s$^2$/rad)")
    rows = (control.x1, control.x2, control.lambda1, control.lambda2)
    for ax, name, y in zip(axes.flat, names, rows, strict=True):
        ax.plot(1e3 * control.t, y)
        for t in control.switches:
            ax.axvline(1e3 * t, color="gray", ls=":")
        ax.set_ylabel(name)
    for ax in axes[-1]:
        ax.set_xlabel("time after release (ms)")
    axes[0, 0].figure.align_ylabels(axes)


def _power(ax: "Axes", control: MinimumTime) -> None:
    ax.plot(1e3 * control.t, control.Pc, lw=2)
    ax.axhline(0, color="gray", lw=0.8)
    ax.margins(y=0.3)
    ax.set(xlabel="time after release (ms)", ylabel="absorbed $P_C$ (pu)")
