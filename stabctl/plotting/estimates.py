"""Figures of estimators: true and estimated speeds, orders, clearing time against noise and latency."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from stabctl.estimation.record import Record

from .style import COLOURS, figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 6  # panels


def speeds(found: Record, machines: Sequence[int] | None = None, seed: int = 0) -> "Figure":
    """True and estimated speed of machines against the rest, with the band of three standard deviations, mHz."""
    case, shown = found.point.case, _rows(found, machines)
    fig, axes = figure(9, 1.7 * len(shown) + 0.8, len(shown), sharex=True)
    scale = 1e3 * case.frequency_hz
    for ax, i in zip(axes[:, 0], shown, strict=True):
        true, seen, sigma = (
            part[:, seed, i] * scale for part in (found.deviation, found.deviation_estimated, found.sigma)
        )
        ax.fill_between(found.time, seen - 3 * sigma, seen + 3 * sigma, color=COLOURS[1], alpha=0.25, linewidth=0)
        ax.plot(found.time, seen, color=COLOURS[1], linewidth=1, label="estimated, with 3 sigma")
        ax.plot(found.time, true, color=COLOURS[0], linewidth=1, label="true")
        ax.set_title(f"machine {case.machines[i].machine}", loc="left", fontsize="small")
    axes[0, 0].legend(frameon=False, fontsize="small", ncols=2)
    axes[-1, 0].set_xlabel("time, s")
    fig.supylabel("own speed less the COI speed of the rest, mHz", fontsize="medium")
    fig.suptitle(_title(found, seed), fontsize="medium")
    return fig


def commands(found: Record, machines: Sequence[int] | None = None, seed: int = 0) -> "Figure":
    """Bang-bang orders by the true and by the estimated deviations of machines, over time."""
    case, shown = found.point.case, _rows(found, machines)
    fig, axes = figure(9, 1.1 * len(shown) + 0.9, len(shown), sharex=True, sharey=True)
    for ax, i in zip(axes[:, 0], shown, strict=True):
        ax.step(found.time, found.wanted[:, seed, i], where="post", color=COLOURS[0], linewidth=2.5, alpha=0.45)
        ax.step(found.time, found.given[:, seed, i], where="post", color=COLOURS[1], linewidth=1)
        ax.set_yticks((-1, 0, 1), ("inject", "idle", "absorb"))
        ax.set_title(f"machine {case.machines[i].machine}", loc="left", fontsize="small")
    axes[0, 0].legend(
        axes[0, 0].lines,
        ("by true speeds", "by estimates"),
        frameon=False,
        fontsize="small",
        ncols=2,
        loc="upper right",
    )
    axes[-1, 0].set_xlabel("time, s")
    fig.suptitle(_title(found, seed), fontsize="medium")
    return fig


def clearing(
    panels: Mapping[str, tuple[Sequence[float], Mapping[str, Sequence[float]]]], ideal: Mapping[str, float]
) -> "Figure":
    """Critical clearing time (cycles): a panel per label of the abscissa, a curve per case, its ideal value dashed."""
    fig, axes = figure(5.2 * len(panels), 4.0, 1, len(panels), sharey=True)
    for ax, (label, (values, curves)) in zip(axes[0], panels.items(), strict=True):
        for k, (name, cycles) in enumerate(curves.items()):
            ax.plot(values, cycles, "os^D"[k % 4] + "-", color=COLOURS[k], label=name)
            ax.axhline(ideal[name], color=COLOURS[k], linestyle="--", linewidth=1)
        ax.set_xlabel(label)
    axes[0, 0].set_ylabel("critical clearing time, cycles")
    axes[0, 0].legend(frameon=False, title="dashed: with true speeds", fontsize="small")
    return fig


def _title(found: Record, seed: int) -> str:
    outcome = f": {found.runs[seed].outcome.message}" if found.runs else ""
    return f"{found.point.case.name}, {found.driven.kind} estimator, seed {found.seeds[seed]}{outcome}"


def _rows(found: Record, machines: Sequence[int] | None) -> list[int]:
    """Rows of the machines named, or the first few."""
    rows = [i for i, m in enumerate(found.point.case.machines) if machines is None or m.machine in machines]
    return rows if machines is not None else rows[:MOST]
