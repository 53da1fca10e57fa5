"""Figures of simulations: one quantity, an overview, several runs side by side, storage device by device."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.simulation.channels import QUANTITIES, Channel, chosen
from stabctl.simulation.trajectory import Trajectory

from .palette import COLORS, GRAY, LABELS, MANY
from .style import legend_below, name_at_ends, single, subplots

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


USUAL = "speed", "angle", "voltage", "storage"
JUMPING = "voltage", "voltage_angle", "electrical_power"  # quantities that jump at events
LEAST = {"angle": 1.0, "voltage_angle": 1.0, "electrical_power": 1.0, "storage": 1.0, "storage_energy": 0.001}
MOVING = 5  # curves in color if there are too many for all
STILL = 0.01  # smallest range of an axis, if not in LEAST


class Signal(NamedTuple):
    """Curves of one quantity."""

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
    """Plot one quantity of a simulation against time.

    Parameters
    ----------
    run
        The simulation, with its rows recorded.
    signal
        ``"speed"`` (Hz), ``"angle"`` (deg, from the center of inertia), ``"voltage"`` (pu, at the buses where storage
        connects), ``"field_voltage"`` (pu), ``"mechanical_power"`` (pu), ``"electrical_power"`` (MW),
        ``"voltage_angle"`` (deg), ``"storage"`` (MW, positive when absorbing), ``"storage_order"`` (in ratings) or
        ``"storage_energy"`` (MWh); of certain machines, buses or devices: ``"voltage:16,voltage:17"``.
    *others
        Not allowed: one plot shows one quantity.
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
        If there is no such quantity or machine, more than one quantity, or the case has no storage to show.

    Examples
    --------
    >>> run = st.load("two_area").simulate(st.Contingency("7", clear="6cyc"), until="3s")
    >>> run.plot("angle", machines=[1, 4]).figure.savefig("angle.png")
    """
    quantities = _quantities(run, signal)
    if others or len(quantities) != 1:
        raise StudyError(
            f"One plot shows one quantity, but {len(others) + len(quantities)} are given; plot each of them, with ax= "
            "on axes of one figure if you like."
        )
    ((quantity, shown),) = quantities.items()
    ax = single(ax, 8, 4)
    _draw(ax, run, quantity, shown, machines=machines)
    ax.set_xlabel(LABELS["time"])
    ax.set_title(f"{run.point.case.name}: {run.outcome.message}", fontsize="medium", wrap=True)
    return ax


def overview(run: Trajectory, signals: str = "", *, machines: Sequence[int | str] | None = None) -> "Figure":
    """Plot quantities one above the other, by default speeds, angles, voltages and, if there is storage, its power."""
    usual = [name for name in USUAL if run.point.case.storage or name != "storage"]
    quantities = _quantities(run, signals or ",".join(usual))
    figure, axes = subplots(9, 2.3 * len(quantities) + 0.6, len(quantities), sharex=True)
    for ax, (quantity, shown) in zip(axes[:, 0], quantities.items(), strict=True):
        _draw(ax, run, quantity, shown, machines=machines, legend=ax is axes[-1, 0], height=1.9)
    axes[-1, 0].set_xlabel(LABELS["time"])
    figure.align_ylabels(axes)
    figure.suptitle(f"{run.point.case.name}: {run.outcome.message}", fontsize="medium", wrap=True)
    return figure


def compare(
    runs: Mapping[str, Trajectory], signal: str = "speed", machines: Sequence[int | str] | None = None
) -> "Figure":
    """Plot one signal of several runs, given by title, side by side on the same scale."""
    figure, axes = subplots(5 * len(runs), 3.8, 1, len(runs), sharex=True, sharey=True)
    for ax, (title, run) in zip(axes[0], runs.items(), strict=True):
        _draw(ax, run, signal, machines=machines, legend=ax is axes[0, -1])
        ax.set_title(f"{title}\n{run.outcome.kind.value.replace('_', ' ')}", fontsize="medium")
        ax.set_xlabel(LABELS["time"])
        ax.label_outer()
    return figure


def storage(run: Trajectory, machines: Sequence[int | str] | None = None) -> "Figure":
    """Plot the power of the storage devices of some machines (default: all), one above the other."""
    case, named = run.point.case, wanted(run.point.case, machines)
    shown = [k for k, s in enumerate(case.storage) if case.machine(s.machine).called in named]
    figure, axes = subplots(9, 1.25 * len(shown) + 0.6, len(shown), sharex=True, sharey=len(shown) > 2)
    for ax, k in zip(axes[:, 0], shown, strict=True):
        device = case.storage[k]
        ax.plot(run.time, run.arrays.storage[:, k], drawstyle="steps-post")
        title = f"storage of machine {case.machine(device.machine).called} at bus {device.bus}"
        ax.set_title(title, loc="left", fontsize="small")
    axes[-1, 0].set_xlabel(LABELS["time"])
    figure.supylabel("power absorbed (MW)", fontsize="medium")
    return figure


def _quantities(run: Trajectory, text: str) -> dict[str, tuple[Channel, ...]]:
    """What a text such as "voltage:16,voltage:17,speed" shows of each quantity; nothing: what is usual."""
    case, found = run.point.case, dict[str, tuple[Channel, ...]]()
    for name in naming.listed(text):
        channels = chosen(case, name, run.point.rotors.unit.tolist())
        before = found.get(channels[0].quantity, ())
        found[channels[0].quantity] = (*before, *channels) if ":" in name else ()
    if not found:
        chosen(case, text, ())  # says what is wrong
    return found


def _draw(
    ax: "Axes",
    run: Trajectory,
    quantity: str,
    shown: Sequence[Channel] = (),
    *,
    machines: Sequence[int | str] | None = None,
    legend: bool = True,
    height: float = 3.0,
) -> None:
    """Draw the curves of a quantity in colors that tell them apart; see `_colors`."""
    values, names, owners = _signal(run, quantity, shown, machines)
    colors = _colors(values, owners, run)
    times, values = _with_jumps(run, values) if quantity in JUMPING else (run.time, values)
    named: dict[Line2D, str] = {}
    thin = [color in (GRAY, MANY) for color in colors]
    for k in sorted(range(len(names)), key=thin.__getitem__):
        look: Any = {"linewidth": 0.6, "zorder": 1.9} if thin[k] else {"linewidth": 1.3}
        (line,) = ax.plot(times, values[:, k], color=colors[k], **look)
        named |= {} if thin[k] else {line: names[k]}
    if GRAY in colors:
        ax.lines[-1].set_label("the others")
    _mark_events(ax, run)
    ax.set_ylabel(LABELS[quantity])
    low, high = ax.get_ylim()
    least = LEAST.get(quantity, STILL)
    if high - low < least:
        ax.set_ylim((low + high - least) / 2, (low + high + least) / 2)
    name_at_ends(ax, [*named], [*named.values()], height=height)
    if legend:
        legend_below(ax)


def _colors(values: np.ndarray, owners: Sequence[int | str], run: Trajectory) -> list[str]:
    """A color for each curve (rows, curves): of its machine, the same for every quantity; of few, one that is free.

    Of many machines, those that are unstable or move have a color, and the unstable ones one if they are many, too.
    """
    names, lost, rest = run.point.rotor_names, run.unstable_machines or run.outcome.off_frequency, GRAY
    if len(names) <= len(COLORS):
        own: dict[Any, str] = dict(zip(names, COLORS, strict=False))
    elif len(lost) >= len(COLORS):
        own, rest = dict.fromkeys(lost, COLORS[1]), MANY
    else:
        marked = lost or [names[k] for k in np.argsort(-run.peak, kind="stable")[:MOVING]]
        own = dict(zip(sorted(marked, key=naming.order), COLORS[1:], strict=False))
    if len(owners) <= len(COLORS):
        found, shown = list[str](), {own.get(owner) for owner in owners}
        free = sorted((color for color in COLORS if color not in shown), key=[*own.values()].__contains__)
        for owner in owners:
            color = own.get(owner)
            found.append(free.pop(0) if color is None or color in found else color)
        return found
    if own.keys().isdisjoint(owners):  # buses without a machine
        moves = np.nanmax(values, axis=0, initial=-np.inf) - np.nanmin(values, axis=0, initial=np.inf)
        most = np.argsort(-moves, kind="stable")[:MOVING].tolist()
        own, owners = dict(zip(most, COLORS[1:], strict=False)), range(len(owners))
    return [own.get(owner, rest) for owner in owners]


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


def _signal(run: Trajectory, quantity: str, shown: Sequence[Channel], machines: Sequence[int | str] | None) -> Signal:
    """The curves of a quantity; voltages, unless buses are chosen, where the storage of machines connects."""
    case, of = run.point.case, QUANTITIES[quantity].of
    if quantity == "speed":
        values = run.values("speed") * case.frequency_hz
    elif quantity == "angle":
        values = run.angle_from_coi_deg
    else:
        values = run.values(quantity) * QUANTITIES[quantity].factor
    if quantity == "voltage" and not shown:
        owners = [(m.called, f"bus {m.storage_bus}", case.row_of_bus[m.storage_bus]) for m in case.machines]
    else:
        word = {"bus": "bus", "device": "storage"}.get(of, "machine")
        channels = shown or chosen(case, quantity, run.point.rotors.unit.tolist())
        owners = [(_owner(case, of, c.row), f"{word} {c.label}", c.place) for c in channels]
    drawn = owners if machines is None else [one for one in owners if one[0] in wanted(run.point.case, machines)]
    columns = values[:, [place for _, _, place in drawn]]
    return Signal(columns, [name for _, name, _ in drawn], [machine for machine, _, _ in drawn])


def wanted(case: Case, machines: int | str | Sequence[int | str] | None) -> set[int | str]:
    """What the machines given by number or name are called; without any, all."""
    several = (machines,) if isinstance(machines, int | str) else machines
    return {m.called for m in (case.machines if several is None else map(case.machine, several))}


def _owner(case: Case, of: str, row: int) -> int | str:
    """The machine that a curve belongs to; of a bus, the first machine at it."""
    if of == "bus":
        return next((m.called for m in case.machines if m.bus == case.buses[row].bus), "")
    return case.machine(case.storage[row].machine).called if of == "device" else case.machines[row].called
