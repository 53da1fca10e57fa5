"""Figures of estimators: true and estimated speeds, and the commands that follow from them."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from stabctl._util.errors import StudyError, shown
from stabctl.estimation.estimates import Estimates

from .palette import COLORS, LABELS
from .style import subplots
from .trajectory import wanted

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MOST = 6  # panels


def plot(
    found: Estimates, *, machines: int | str | Sequence[int | str] | None = None, seed: int | None = None
) -> "Figure":
    """Plot true and estimated speeds of machines relative to the rest of the system.

    Parameters
    ----------
    found
        The estimates of a simulation.
    machines
        Names or numbers of the machines to show. Default: the first six.
    seed
        Which of the seeds. Default: the first.

    Returns
    -------
    matplotlib.figure.Figure
        A panel per machine, in mHz; the band is three standard deviations as reported by the estimator.

    Examples
    --------
    >>> base = st.load("two_area").classical().initialize(storage="50MW")
    >>> found = base.estimate(st.Contingency("7", clear="8cyc"), "2s")
    >>> found.plot(machines=[1, 4]).savefig("estimates.png")
    """
    case, (rows, row) = found.point.case, _chosen(found, machines, seed)
    figure, axes = subplots(9, 1.7 * len(rows) + 0.8, len(rows), sharex=True)
    scale = 1e3 * case.frequency_hz
    for ax, i in zip(axes[:, 0], rows, strict=True):
        true, seen, sigma = (
            part[:, row, i] * scale for part in (found.deviation, found.deviation_estimated, found.sigma)
        )
        ax.fill_between(found.time, seen - 3 * sigma, seen + 3 * sigma, color=COLORS[1], alpha=0.25, linewidth=0)
        ax.plot(found.time, seen, color=COLORS[1], linewidth=1, label="estimated, with ±3 sigma")
        ax.plot(found.time, true, color=COLORS[0], linewidth=1, label="true")
        ax.set_title(f"machine {case.machines[i].called}", loc="left", fontsize="small")
    axes[0, 0].legend(frameon=False, fontsize="small", ncols=2)
    axes[-1, 0].set_xlabel(LABELS["time"])
    figure.supylabel("speed relative to the COI of the other machines (mHz)", fontsize="medium")
    figure.suptitle(_title(found, row), fontsize="medium", wrap=True)
    return figure


def commands(
    found: Estimates, *, machines: int | str | Sequence[int | str] | None = None, seed: int | None = None
) -> "Figure":
    """Plot the bang-bang commands that follow from true and from estimated speeds; arguments as for `plot`."""
    case, (rows, row) = found.point.case, _chosen(found, machines, seed)
    figure, axes = subplots(9, 1.1 * len(rows) + 0.9, len(rows), sharex=True, sharey=True)
    for ax, i in zip(axes[:, 0], rows, strict=True):
        ax.step(found.time, found.true_commands[:, row, i], where="post", color=COLORS[0], linewidth=2.5, alpha=0.45)
        ax.step(found.time, found.estimated_commands[:, row, i], where="post", color=COLORS[1], linewidth=1)
        ax.set_yticks((-1, 0, 1), ("inject", "idle", "absorb"))
        ax.set_title(f"machine {case.machines[i].called}", loc="left", fontsize="small")
    labels = "from true speeds", "from estimates"
    axes[0, 0].legend(
        axes[0, 0].lines, labels, frameon=False, fontsize="small", ncols=2, loc="lower right", bbox_to_anchor=(1, 1)
    )
    axes[-1, 0].set_xlabel(LABELS["time"])
    figure.suptitle(_title(found, row), fontsize="medium", wrap=True)
    return figure


def _title(found: Estimates, row: int) -> str:
    outcome = f": {found.runs[row].outcome.message}" if found.runs else ""
    return f"{found.point.case.name}, {found.control.estimator} estimator, seed {found.seeds[row]}{outcome}"


def _chosen(
    found: Estimates, machines: int | str | Sequence[int | str] | None, seed: int | None
) -> tuple[list[int], int]:
    """Rows of the machines named, or the first few, and that of the seed, or the first."""
    case = found.point.case
    rows = [i for i, m in enumerate(case.machines) if m.called in wanted(case, machines)]
    if not rows:
        raise StudyError("machines is empty; name some, or leave it out.")
    if seed not in (None, *found.seeds):
        raise StudyError(f"There is no seed {shown(seed)}; choose one of {', '.join(map(str, found.seeds))}.")
    return rows if machines is not None else rows[:MOST], 0 if seed is None else found.seeds.index(seed)
