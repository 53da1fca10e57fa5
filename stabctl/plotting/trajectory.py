"""Figures of simulations: one signal, an overview, several runs side by side, storage device by device."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stabctl.errors import StudyError
from stabctl.simulation.trajectory import Trajectory

from .style import COLORS, legend_beside, single, subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LABELS = {
    "speed": "speed (Hz)",
    "angle": "angle from COI (deg)",
    "voltage": "voltage (pu)",
    "power": "electrical power (MW)",
    "storage": "storage power absorbed (MW)",
}
LEAST = {"speed": 0.01, "angle": 1.0, "voltage": 0.01, "power": 1.0, "storage": 1.0}  # smallest range of an axis


class Signal(NamedTuple):
    """Curves of one signal."""

    values: np.ndarray  # (rows, curves)
    names: list[str]
    machines: list[int]  # to which the curves belong


def plot(
    run: Trajectory, signal: str = "speed", *, machines: Sequence[int] | None = None, ax: "Axes | None" = None
) -> "Axes":
    """Plot one signal of a simulation against time.

    Parameters
    ----------
    run
        The simulation, with its rows recorded.
    signal
        ``"speed"`` (Hz), ``"angle"`` (deg, from the center of inertia), ``"voltage"`` (pu, at the buses where storage
        connects), ``"power"`` (MW, electrical) or ``"storage"`` (MW, absorbing positive).
    machines
        Numbers of the machines to show. Default: all.
    ax
        Axes to draw on. Default: a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    StudyError
        If there is no such signal, or the case has no storage to show.
    """
    if signal not in LABELS:
        raise StudyError(f"There is no signal {signal!r}; choose one of {', '.join(LABELS)}.")
    if signal == "storage" and not run.point.case.storage:
        raise StudyError(f"{run.point.case.name} has no storage to plot; add some with storage='50MW', for example.")
    ax = single(ax, 8, 4)
    _draw(ax, run, signal, machines)
    ax.set_xlabel("time (s)")
    ax.set_title(f"{run.point.case.name}: {run.outcome.message}", fontsize="medium", wrap=True)
    return ax


def overview(run: Trajectory, machines: Sequence[int] | None = None) -> "Figure":
    """Plot speeds, angles, voltages and, if there is storage, its power, one above the other."""
    signals = ["speed", "angle", "voltage"] + ["storage"] * bool(run.point.case.storage)
    figure, axes = subplots(9, 2.3 * len(signals) + 0.6, len(signals), sharex=True)
    for ax, signal in zip(axes[:, 0], signals, strict=True):
        _draw(ax, run, signal, machines)
    axes[-1, 0].set_xlabel("time (s)")
    figure.align_ylabels(axes)
    figure.suptitle(f"{run.point.case.name}: {run.outcome.message}", fontsize="medium", wrap=True)
    return figure


def compare(runs: Mapping[str, Trajectory], signal: str = "speed", machines: Sequence[int] | None = None) -> "Figure":
    """Plot one signal of several runs, given by title, side by side on the same scale."""
    figure, axes = subplots(5 * len(runs), 3.8, 1, len(runs), sharey=True)
    for ax, (title, run) in zip(axes[0], runs.items(), strict=True):
        _draw(ax, run, signal, machines, legend=ax is axes[0, -1])
        ax.set_title(f"{title}\n{run.outcome.kind.value.replace('_', ' ')}", fontsize="medium")
        ax.set_xlabel("time (s)")
        ax.label_outer()
    return figure


def storage(run: Trajectory, machines: Sequence[int] | None = None) -> "Figure":
    """Plot the power of the storage devices of some machines (default: all), one above the other."""
    case = run.point.case
    shown = [k for k, s in enumerate(case.storage) if machines is None or s.machine in machines]
    figure, axes = subplots(9, 1.25 * len(shown) + 0.6, len(shown), sharex=True, sharey=len(shown) > 2)
    for ax, k in zip(axes[:, 0], shown, strict=True):
        device = case.storage[k]
        ax.plot(run.time, run.arrays.storage[:, k], drawstyle="steps-post")
        ax.set_title(f"storage of machine {device.machine} at bus {device.bus}", loc="left", fontsize="small")
    axes[-1, 0].set_xlabel("time (s)")
    figure.supylabel("power absorbed (MW)", fontsize="medium")
    return figure


def _draw(ax: "Axes", run: Trajectory, signal: str, machines: Sequence[int] | None, legend: bool = True) -> None:
    """Draw the curves of a signal: each in its own color if they are few, else only the unstable machine stands out."""
    values, names, owners = _signal(run, signal, machines)
    few, lost = len(names) <= len(COLORS), run.outcome.machine
    for column, name, owner in zip(values.T, names, owners, strict=True):
        marked = not few and owner == lost
        look = {} if few else {"color": COLORS[1] if marked else COLORS[0], "linewidth": 1.3 if marked else 0.6}
        ax.plot(run.time, column, **{"linewidth": 1.3} | look, label=name if few or marked else None)
    ax.set_ylabel(LABELS[signal])
    low, high = ax.get_ylim()
    if high - low < LEAST[signal]:
        ax.set_ylim((low + high - LEAST[signal]) / 2, (low + high + LEAST[signal]) / 2)
    if legend:
        legend_beside(ax, ax.get_legend_handles_labels()[1])


def _signal(run: Trajectory, signal: str, machines: Sequence[int] | None) -> Signal:
    """The curves of a signal."""
    case = run.point.case
    if signal == "storage":
        devices = zip(case.storage, run.devices(), run.arrays.storage.T, strict=True)
        owners = [(s.machine, f"storage {name}", column) for s, name, column in devices]
    else:
        column_of = {b.bus: k for k, b in enumerate(case.buses)}
        values = {
            "speed": lambda: run.arrays.speed * case.frequency_hz,
            "angle": lambda: np.rad2deg(run.arrays.angle - _coi_angle(run)[:, None]),
            "voltage": lambda: np.abs(run.arrays.V[:, [column_of[m.storage_bus] for m in case.machines]]),
            "power": lambda: run.arrays.P,
        }[signal]()
        name = "bus {0.storage_bus}" if signal == "voltage" else "machine {0.machine}"
        rotors = signal in ("speed", "angle")
        units = [case.machines[i] for i in run.point.rotors.unit] if rotors else case.machines
        owners = [(m.machine, name.format(m), column) for m, column in zip(units, values.T, strict=True)]
    shown = [one for one in owners if machines is None or one[0] in machines]
    columns = np.array([column for _, _, column in shown]).reshape(len(shown), len(run.time)).T
    return Signal(columns, [name for _, name, _ in shown], [machine for machine, _, _ in shown])


def _coi_angle(run: Trajectory) -> np.ndarray:
    """Angle of the center of inertia of all machines (rows), rad."""
    H = run.point.inertia
    return run.arrays.angle @ H / H.sum() if len(H) else np.zeros(len(run.time))
