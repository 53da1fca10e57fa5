"""Figures of simulations: one signal, an overview, several runs side by side, storage device by device."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.simulation.trajectory import Trajectory

from .palette import COLORS, GRAY, LABELS, MANY
from .style import legend_beside, single, subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


SIGNALS = "speed", "angle", "voltage", "power", "storage"
JUMPING = "voltage", "power"  # signals that jump at events
LEAST = {"speed": 0.01, "angle": 1.0, "voltage": 0.01, "power": 1.0, "storage": 1.0}  # smallest range of an axis


class Signal(NamedTuple):
    """Curves of one signal."""

    values: np.ndarray  # (rows, curves)
    names: list[str]
    machines: list[int | str]  # to which the curves belong


def plot(
    run: Trajectory,
    signal: str = "speed",
    *others: str,
    machines: Sequence[int | str] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Plot one signal of a simulation against time.

    Parameters
    ----------
    run
        The simulation, with its rows recorded.
    signal
        ``"speed"`` (Hz), ``"angle"`` (deg, from the center of inertia), ``"voltage"`` (pu, at the buses where storage
        connects), ``"power"`` (MW, electrical) or ``"storage"`` (MW, positive when absorbing).
    *others
        Not allowed: one plot shows one signal.
    machines
        Names or numbers of the machines to show. Default: all.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    StudyError
        If there is no such signal, more than one, or the case has no storage to show.

    Examples
    --------
    >>> run = st.load("two_area").simulate(st.Contingency("7", clear="6cyc"), until="3s")
    >>> run.plot("angle", machines=[1, 4]).figure.savefig("angle.png")
    """
    if others:
        raise StudyError(
            f"One plot shows one signal, but {1 + len(others)} are given; plot each of them, with ax= on axes of one "
            "figure if you like."
        )
    if signal not in SIGNALS:
        raise StudyError(f"There is no signal {signal!r}; choose one of {', '.join(SIGNALS)}.")
    if signal == "storage" and not run.point.case.storage:
        raise StudyError(f"{run.point.case.name} has no storage to plot; add some with storage='50MW', for example.")
    ax = single(ax, 8, 4)
    _draw(ax, run, signal, machines)
    ax.set_xlabel(LABELS["time"])
    ax.set_title(f"{run.point.case.name}: {run.outcome.message}", fontsize="medium", wrap=True)
    return ax


def overview(run: Trajectory, machines: Sequence[int | str] | None = None) -> "Figure":
    """Plot speeds, angles, voltages and, if there is storage, its power, one above the other."""
    signals = ["speed", "angle", "voltage"] + ["storage"] * bool(run.point.case.storage)
    figure, axes = subplots(9, 2.3 * len(signals) + 0.6, len(signals), sharex=True)
    for ax, signal in zip(axes[:, 0], signals, strict=True):
        _draw(ax, run, signal, machines)
    axes[-1, 0].set_xlabel(LABELS["time"])
    figure.align_ylabels(axes)
    figure.suptitle(f"{run.point.case.name}: {run.outcome.message}", fontsize="medium", wrap=True)
    return figure


def compare(
    runs: Mapping[str, Trajectory], signal: str = "speed", machines: Sequence[int | str] | None = None
) -> "Figure":
    """Plot one signal of several runs, given by title, side by side on the same scale."""
    figure, axes = subplots(5 * len(runs), 3.8, 1, len(runs), sharey=True)
    for ax, (title, run) in zip(axes[0], runs.items(), strict=True):
        _draw(ax, run, signal, machines, legend=ax is axes[0, -1])
        ax.set_title(f"{title}\n{run.outcome.kind.value.replace('_', ' ')}", fontsize="medium")
        ax.set_xlabel(LABELS["time"])
        ax.label_outer()
    return figure


def storage(run: Trajectory, machines: Sequence[int | str] | None = None) -> "Figure":
    """Plot the power of the storage devices of some machines (default: all), one above the other."""
    case = run.point.case
    shown = [k for k, s in enumerate(case.storage) if machines is None or case.machine(s.machine).called in machines]
    figure, axes = subplots(9, 1.25 * len(shown) + 0.6, len(shown), sharex=True, sharey=len(shown) > 2)
    for ax, k in zip(axes[:, 0], shown, strict=True):
        device = case.storage[k]
        ax.plot(run.time, run.arrays.storage[:, k], drawstyle="steps-post")
        ax.set_title(
            f"storage of machine {case.machine(device.machine).called} at bus {device.bus}",
            loc="left",
            fontsize="small",
        )
    axes[-1, 0].set_xlabel(LABELS["time"])
    figure.supylabel("power absorbed (MW)", fontsize="medium")
    return figure


def _draw(ax: "Axes", run: Trajectory, signal: str, machines: Sequence[int | str] | None, legend: bool = True) -> None:
    """Draw the curves of a signal: each in its own color if they are few, else those of machines that are unstable."""
    values, names, owners = _signal(run, signal, machines)
    colors = _colors(names, owners, run.unstable_machines)
    times, values = _with_jumps(run, values) if signal in JUMPING else (run.time, values)
    thin = [color in (GRAY, MANY) for color in colors]
    for k in sorted(range(len(names)), key=thin.__getitem__):
        look: Any = {"linewidth": 0.6, "zorder": 1.9} if thin[k] else {"linewidth": 1.3}
        ax.plot(times, values[:, k], color=colors[k], label=None if thin[k] else names[k], **look)
    if GRAY in colors:
        ax.lines[-1].set_label("the others")
    _mark_events(ax, run)
    ax.set_ylabel(LABELS[signal])
    low, high = ax.get_ylim()
    if high - low < LEAST[signal]:
        ax.set_ylim((low + high - LEAST[signal]) / 2, (low + high + LEAST[signal]) / 2)
    if legend:
        legend_beside(ax, ax.get_legend_handles_labels()[1])


def _colors(names: Sequence[str], owners: Sequence[int | str], unstable: Sequence[int | str]) -> list[str]:
    """A color for each curve: all different if they are few; otherwise unstable machines in color, the rest in gray."""
    if len(names) <= len(COLORS):
        return list(COLORS[: len(names)])
    marked = [owner in unstable for owner in owners]
    if not 0 < sum(marked) < len(COLORS):  # none, or more than can be distinguished
        return [COLORS[1] if one else MANY for one in marked]
    own = iter(COLORS[1:])
    return [next(own) if one else GRAY for one in marked]


def _with_jumps(run: Trajectory, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Instants and values with the value before every event held up to it, so that no slope is drawn to the next."""
    at = [np.searchsorted(run.time, change.at - 1e-9) for change in run.happened.changes[1:]]
    rows = [row for row in at if 0 < row < len(run.time)]
    return np.insert(run.time, rows, run.time[rows]), np.insert(values, rows, values[[r - 1 for r in rows]], axis=0)


def _mark_events(ax: "Axes", run: Trajectory) -> None:
    """Shade the time with a fault on, and draw a line at every other event within the run."""
    end = run.time[-1] if len(run.time) else 0.0
    changes = [change for change in run.happened.changes if change.at <= end]
    labels, faulted = dict.fromkeys(("fault on", "clearing", "switching"), True), False  # each once
    for now, later in zip(changes, [*changes[1:], None], strict=True):
        if now.switching.faulted:
            off = later.at if later else end
            look: Any = {"color": COLORS[4], "alpha": 0.35, "linewidth": 0}
            ax.axvspan(now.at, off, label=_once(labels, "fault on"), **look)
        elif now.at > 0:
            label = _once(labels, "clearing" if faulted else "switching")
            ax.axvline(now.at, color=GRAY, linestyle=":", linewidth=1, zorder=1.5, label=label)
        faulted = now.switching.faulted


def _once(labels: dict[str, bool], name: str) -> str | None:
    """The label when it is first used, afterwards none."""
    return name if labels.pop(name, False) else None


def _signal(run: Trajectory, signal: str, machines: Sequence[int | str] | None) -> Signal:
    """The curves of a signal."""
    case = run.point.case
    if signal == "storage":
        devices = zip(case.storage, run.devices(), run.arrays.storage.T, strict=True)
        owners = [(case.machine(s.machine).called, f"storage {name}", column) for s, name, column in devices]
    else:
        values = {
            "speed": lambda: np.where(run.on, run.arrays.speed * case.frequency_hz, np.nan),
            "angle": lambda: run.angle_from_coi_deg,
            "voltage": lambda: np.abs(run.arrays.V[:, [case.row_of_bus[m.storage_bus] for m in case.machines]]),
            "power": lambda: run.arrays.P,
        }[signal]()
        name = "bus {0.storage_bus}" if signal == "voltage" else "machine {0.called}"
        rotors = signal in ("speed", "angle")
        units = [case.machines[i] for i in run.point.rotors.unit] if rotors else case.machines
        owners = [(m.called, name.format(m), column) for m, column in zip(units, values.T, strict=True)]
    shown = [one for one in owners if machines is None or one[0] in machines]
    columns = np.array([column for _, _, column in shown]).reshape(len(shown), len(run.time)).T
    return Signal(columns, [name for _, name, _ in shown], [machine for machine, _, _ in shown])
