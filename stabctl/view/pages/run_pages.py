"""The pages of runs: a simulation, estimates from PMU reports, an optimal schedule, a sweep."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from stabctl._util.errors import StudyError
from stabctl._util.wording import enumerated, listed, number
from stabctl.design.optimum import Optimum
from stabctl.estimation.estimates import Estimates
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.network import INTACT, Switching
from stabctl.simulation.trajectory import Trajectory
from stabctl.sweep import results
from stabctl.sweep.results import Results

from ..figures import estimates as estimated
from ..figures import storage_control, trajectory
from .pattern import Page, Part, Section, about, figure, table

LOWEST = 20  # voltages in a table
MACHINES = "machine", "largest change of angle (deg)", "lowest (Hz)", "highest (Hz)", "disconnected (s)"
VOLTAGES = "bus", "lowest voltage (pu)", "at (s)", "voltage at the end (pu)"
DEVICES = "device", "rating (MW)", "largest absorbed (MW)", "largest injected (MW)", "range of energy (kWh)"
ITERATIONS = "convex program", "clearing time (cycles)", "excursion (rad)", "solver", "simulations so far"
SPEEDS = (
    "True and estimated speeds",
    "against the center of inertia of the others, with three standard deviations as the filter reports them.",
)
COMMANDS = "Bang-bang commands", "from true and from estimated speeds."
SCHEDULED = "Angles and storage powers with the schedule.", "The law takes over at the dashed line."
EXCURSION = (
    "Excursion, which the programs make small: the largest change of an angle from the center of inertia, plus "
    "a tenth of the mean over time of the sum of their squares, in rad."
)


def simulation(run: Trajectory) -> Page:
    """Return the page of a simulation."""
    case, f = run.point.case, run.point.case.frequency_hz
    if len(run.time) < 2:
        raise StudyError("The run has no rows to show: they were not recorded; leave out record=False.")
    speeds = run.arrays.speed[run.on] * f
    numbers = [
        (run.outcome.kind.value.replace("_", " "), f"at {run.outcome.time_s:.3f} s"),
        (f"{run.max_angle_from_coi_deg:.1f}°", "largest change of an angle from the center of inertia"),
        (f"{speeds.min():.2f} to {speeds.max():.2f}", "Hz, the speeds of the machines"),
    ]
    return Page(
        f"{case.name}_simulate",
        f"Simulation of {case.name}",
        [*about(case), run.outcome.message],
        numbers,
        [
            Section("Curves", _curves(run)),
            Section("Events", [table(("time (s)", "what changes"), _events(run))] if run.happened.changes[1:] else []),
            Section("Machines", [table(MACHINES, _machines(run), "Angles from the center of inertia of the island.")]),
            Section("Lowest voltages", [table(VOLTAGES, _voltages(run), "After the last event.")]),
            Section("Storage", [table(DEVICES, _devices(run))] if case.storage else []),
        ],
    )


def _curves(run: Trajectory) -> list[Part]:
    """The usual quantities, one above the other."""
    storage = ", powers of storage" if run.point.case.storage else ""
    text = "Angles are relative to the center of inertia; voltages are those at the machines, where storage connects."
    return [figure(trajectory.overview(run), f"Speeds, angles, voltages{storage}.", text)]


def _events(run: Trajectory) -> Iterator[tuple[str, str]]:
    """What every event changes."""
    case, changes = run.point.case, run.happened.changes
    for before, now in pairwise(changes):
        yield f"{now.at:.3f}", "; ".join(_switched(case, before.switching, now.switching)) or "nothing"


def _switched(case: Case, before: Switching, now: Switching) -> Iterator[str]:
    """What is different in the network."""
    names, buses = naming.keys(case, "branches"), [b.bus for b in case.buses]
    was, states = dict(before.branches), dict(now.branches)
    faulted, earlier = (
        {f"bus {buses[row]}" for row, _ in at.faults}
        | {f"{names[row]}@{one.fault_at:g}" for row, one in at.branches if one.faulted}
        for at in (now, before)
    )
    yield from (f"fault at {place}" for place in sorted(faulted - earlier))
    yield from (f"the fault at {place} is cleared" for place in sorted(earlier - faulted))
    opened = []
    for row, one in states.items():
        then, k = was.get(row, INTACT), case.branches[row]
        breakers = (k.from_bus, then.from_closed, one.from_closed), (k.to_bus, then.to_closed, one.to_closed)
        if ends := [bus for bus, closed, still in breakers if closed and not still]:
            opened.append(f"{names[row]}" + (f" at bus {ends[0]}" if len(ends) == 1 else ""))
    if opened:
        yield f"{listed(opened)} opened"
    if off := sorted(now.tripped - before.tripped):
        yield f"{enumerated('machine', [case.machines[row].called for row in off])} tripped"
    loads = [(f"load {key[1]}".strip(), key[0], value - dict(before.loads).get(key, 0j)) for key, value in now.loads]
    shunts = [("shunt", row, value - dict(before.shunts).get(row, 0j)) for row, value in now.shunts]
    for what, row, change in loads + shunts:
        if step := change * case.base_mva:
            yield f"{what} at bus {buses[row]} changed by {step.real:+.4g} MW and {step.imag:+.4g} Mvar"


def _machines(run: Trajectory) -> Iterator[tuple[str, ...]]:
    """Every machine with a rotor."""
    speeds = run.values("speed") * run.point.case.frequency_hz
    for k, name in enumerate(run.point.rotor_names):
        column = speeds[:, k][np.isfinite(speeds[:, k])]
        off = run.happened.off_s[run.point.rotors.unit[k]]
        low, high = (f"{x:.3f}" for x in (column.min(initial=np.inf), column.max(initial=-np.inf)))
        gone = "" if np.isinf(off) else f"{off:.3f}"
        yield str(name), f"{np.rad2deg(run.peak[k]):.1f}", low, high, gone


def _voltages(run: Trajectory) -> Iterator[tuple[str, ...]]:
    """The buses with the lowest voltages after the last event."""
    size, buses = run.values("voltage"), run.point.case.buses
    after = np.flatnonzero(run.time >= run.happened.last_event_s - 1e-9)
    lowest = size[after].min(axis=0)
    for k in np.argsort(lowest, kind="stable")[:LOWEST]:
        at = run.time[after[size[after, k].argmin()]]
        yield str(buses[k].bus), f"{lowest[k]:.4f}", f"{at:.3f}", f"{size[-1, k]:.4f}"


def _devices(run: Trajectory) -> Iterator[tuple[str, ...]]:
    """Every storage device."""
    power, energy = run.arrays.storage, 1e3 * run.arrays.energy
    for k, (name, s) in enumerate(zip(run.devices(), run.point.case.storage, strict=True)):
        most, least = power[:, k].max(initial=0.0), power[:, k].min(initial=0.0)
        yield name, f"{s.rating:g}", f"{most:.2f}", number(-least, 2), f"{np.ptp(energy[:, k]):.2f}"


def estimates(found: Estimates) -> Page:
    """Return the page of estimates."""
    accuracy, case = found.accuracy, found.point.case
    rows = [
        ("error, root mean square", f"{accuracy.rmse_mhz:.1f}", "mHz"),
        ("error, 99th percentile", f"{accuracy.p99_mhz:.1f}", "mHz"),
        ("delay", *accuracy.delay.partition(" ")[::2]),
        ("wrong commands", f"{100 * accuracy.wrong_command_share:.2f}", "%"),
        ("opposite commands", f"{100 * accuracy.opposite_command_share:.2f}", "%"),
    ]
    note = (
        "Of speeds against the center of inertia of the other machines, from 50 ms after the last event. Wrong: the "
        "bang-bang command is not that of the true speed. Opposite: absorbing and injecting are exchanged."
    )
    return Page(
        f"{case.name}_estimate",
        f"Speeds of {case.name}, estimated from PMU reports",
        [*(f"{run.outcome.message}" for run in found.runs[:1]), *(f"{one}" for one in str(found).splitlines())],
        [(value, f"{unit}, {what}") for what, value, unit in rows[:1] + rows[2:4]],
        [
            Section("Speeds", [figure(estimated.plot(found), *SPEEDS), figure(estimated.commands(found), *COMMANDS)]),
            Section("Accuracy", [table(("", "value", "unit"), rows, note)]),
        ],
    )


def optimum(found: Optimum) -> Page:
    """Return the page of an optimal schedule."""
    rows = [
        (str(x.number), f"{x.cycles:g}", f"{x.excursion:.3f}", x.status, str(x.simulations)) for x in found.iterations
    ]
    energy = [(name, f"{kwh:.3g}") for name, kwh in zip(found.run.devices(), found.energy_kwh, strict=True)]
    return Page(
        f"{found.case}_optimum",
        f"Storage schedule for {found.case}",
        [str(found)],
        [
            (f"{found.cycles:g}", "cycles with the best schedule found"),
            ("none" if found.start.cycles is None else f"{found.start.cycles:g}", "cycles with the law alone"),
            (f"{found.energy_kwh.sum():.3g}", "kWh used in total"),
        ],
        [
            Section("Run", [figure(storage_control.plot_optimum(found), *SCHEDULED)]),
            Section("Energy", [table(("device", "range of energy (kWh)"), energy)]),
            Section("Convex programs", [table(ITERATIONS, rows, EXCURSION)]),
        ],
    )


def sweep(found: Results) -> Page:
    """Return the page of a sweep."""
    names = sorted({str(row["case"]) for row in found.rows})
    rows = [tuple(map(results.cell, found.columns, cells)) for cells in found.cells]
    common = ", ".join(f"{column} {value}" for column, value in found.common.items())
    heads = [c.replace("_", " ") if c in results.SWEEP.columns else c for c in found.columns]
    failed = len(found.errors)
    return Page(
        f"{names[0] if len(names) == 1 else 'cases'}_sweep",
        f"Sweep of {listed(names)}",
        [f"In every run: {common}."] if common else [],
        [(str(len(rows) - failed), "runs"), *([(str(failed), "ended in an error")] if failed else [])],
        [
            Section("Results", [table(heads, rows)]),
            Section("Errors", [table(("job", "message"), found.errors)] if failed else []),
        ],
    )
