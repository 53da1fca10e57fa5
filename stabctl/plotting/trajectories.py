"""Figures of trajectories: an overview of one run; speeds and storage powers of several side by side."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from stabctl.simulation.trajectory import Trajectory

from .style import COLOURS, figure, legend

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def overview(run: Trajectory) -> "Figure":
    """Speeds, angles, voltages at the storage buses and storage powers of one run."""
    case = run.point.case
    names = [f"machine {m.machine}" for m in case.machines]
    center = run.angle @ run.point.plant.inertia / run.point.plant.inertia.sum()
    places = [run.point.net.place[m.storage_bus] for m in case.machines]
    panels = [
        ("speed deviation, Hz", (run.speed - 1) * case.frequency_hz, names, 0.01),
        ("angle from the COI, deg", np.rad2deg(run.angle - center[:, None]), names, 1.0),
        ("voltage, pu", np.abs(run.V[:, places]), [f"bus {m.storage_bus}" for m in case.machines], 0.01),
    ]
    if case.storage:
        panels.append(("storage, MW absorbed", run.storage, [f"ESD {name}" for name in run.devices()], 1.0))
    fig, axes = figure(9, 2.3 * len(panels) + 0.6, len(panels), sharex=True)
    for ax, (label, values, labels, least) in zip(axes[:, 0], panels, strict=True):
        _lines(ax, run.time, values, labels)
        ax.set_ylabel(label)
        middle, span = sum(ax.get_ylim()) / 2, ax.get_ylim()[1] - ax.get_ylim()[0]
        if span < least:
            ax.set_ylim(middle - least / 2, middle + least / 2)
        legend(ax, len(labels))
    axes[-1, 0].set_xlabel("time, s")
    fig.suptitle(f"{case.name}: {run.outcome.message}", fontsize="medium", wrap=True)
    return fig


def speeds(runs: Mapping[str, Trajectory], machines: Sequence[int] | None = None) -> "Figure":
    """Speeds (Hz) of chosen machines, a panel per run: the paper's Figures 14, 17 and 18."""
    fig, axes = figure(5 * len(runs), 3.8, 1, len(runs), sharey=True)
    for ax, (title, run) in zip(axes[0], runs.items(), strict=True):
        case = run.point.case
        shown = [i for i, m in enumerate(case.machines) if machines is None or m.machine in machines]
        _lines(ax, run.time, run.speed[:, shown] * case.frequency_hz, [f"G{case.machines[i].machine}" for i in shown])
        ax.set_title(f"{title}\n{run.outcome.kind.value.replace('_', ' ')}", fontsize="medium")
        ax.set_xlabel("time, s")
    axes[0, 0].set_ylabel("speed, Hz")
    legend(axes[0, -1], len(shown))
    return fig


def storage(run: Trajectory, devices: Sequence[int] | None = None) -> "Figure":
    """Power (MW) of the storage devices of chosen machines: the paper's Figures 15 and 19."""
    case = run.point.case
    shown = [j for j, s in enumerate(case.storage) if devices is None or s.machine in devices]
    fig, axes = figure(9, 1.25 * len(shown) + 0.6, len(shown), sharex=True, sharey=len(shown) > 2)
    for ax, j in zip(axes[:, 0], shown, strict=True):
        ax.plot(run.time, run.storage[:, j], color=COLOURS[0], drawstyle="steps-post")
        ax.set_title(
            f"ESD of machine {case.storage[j].machine} at bus {case.storage[j].bus}", loc="left", fontsize="small"
        )
    axes[-1, 0].set_xlabel("time, s")
    fig.supylabel("power absorbed, MW", fontsize="medium")
    return fig


def _lines(ax: "Axes", time: np.ndarray, values: np.ndarray, labels: Sequence[str]) -> None:
    few = len(labels) <= len(COLOURS)
    for column, name in zip(values.T, labels, strict=True):
        ax.plot(time, column, label=name, linewidth=1.3 if few else 0.7, **({} if few else {"color": COLOURS[0]}))
