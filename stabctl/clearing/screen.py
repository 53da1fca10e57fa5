"""The screen: every line fault of a case, one job per faulted bus, ranked by critical clearing time.

A job finds the clearing times of faults at its bus, each cleared by opening another line there. Its row keeps them as
plain values.
"""

import json
import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from stabctl._util.errors import StudyError
from stabctl._util.units import cycles
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.jobs import Found, Kind, Runner, Task
from stabctl.jobs.task import Base, sha256, text
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.model.naming import Circuit
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.outcome import Kind as OutcomeKind
from stabctl.simulation.simulate import checked_control
from stabctl.simulation.swings import Swings

from .critical_time import LONGEST, critical, first_try
from .result import ClearingTime
from .screen_result import Lines, Screen, lines
from .trial import Margin, Run, Search, Trial

FORMAT = 1
ANSWER = "case", "status", "cycles", "seconds", "machine", "wall_s"
NEAR = 0.5  # cycles   first stride from the answer of another line at the same bus


def screen(
    base: Case | OperatingPoint,
    below: str | float | None = None,
    *,
    storage: "Fleet | None" = None,
    control: Control = None,
    resolution: str | float = "0.125cyc",
    limit: str | float = "60cyc",
    observe: str | float = "5s",
    longest: str | float = LONGEST,
    scan: str | float = "auto",
    step: str | float | None = None,
    criterion: Criterion = DEFAULT,
    buses: int | str | Iterable[int] | None = None,
    workers: int | None = None,
    store: str | Path | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
    each: Callable[[Sequence[ClearingTime]], None] | None = None,
) -> Screen:
    """The critical clearing times of bolted faults at both ends of every line, cleared by opening that line.

    The search is that of `clearing_time`, with the same answers; only longer faults are not tried, and `monotone` of a
    pair is therefore unknown (None). Lines whose opening splits the network, and circuits equal to a parallel one, are
    left out. The answers do not depend on the number of threads.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    below : str or float, optional
        Clearing time from which on a pair is not listed: "8cyc", or seconds. Saves most of the work.
    storage, control, resolution, limit, observe, longest, scan, step, criterion
        As in `clearing_time`.
    buses : int, str, or iterable of int, optional
        Buses with a fault, "83, 102" or [83, 102]; by default both ends of every line.
    workers : int, optional
        Threads; by default one per core.
    store : str or Path, optional
        Folder that keeps every faulted bus that is done, in screen.db; called again, the screen continues from there.
    scheduler : str, optional
        Scheduler of a Dask cluster instead of threads: "tcp://host:8786".
    progress : callable, optional
        Called with the number of pairs done and the total.
    each : callable, optional
        Called with the pairs of one faulted bus, as soon as they are found.

    Returns
    -------
    Screen

    Raises
    ------
    StudyError
        If the grid has no points, there is no line to open, or the store or the cluster cannot be used.

    Examples
    --------
    >>> screen = st.load("two_area").screen(below="10cyc")
    >>> screen.df[["fault", "trip", "cycles", "machine"]]
      fault trip  cycles  machine
    0     7  7-8     9.0        4
    """
    point = operating_point(base, storage)
    search = Search.of(
        point.case,
        resolution=resolution,
        limit=limit,
        observe=observe,
        step=step,
        criterion=criterion,
        scan=scan,
        longest=longest,
    )
    if below is not None:
        search = replace(search, limit_cycles=min(search.limit_cycles, _next(below, search, point.case)))
    found = lines(point.case)
    by_bus = _by_bus(point.case, found, buses)
    shared = Shared(Base(point), search, checked_control(control, point.case))
    began, pairs = time.perf_counter(), list[ClearingTime]()
    simulations, size = 0, sum(map(len, by_bus.values()))
    with Runner(BUS, store=store, workers=workers, scheduler=scheduler) as runner:
        for _, row in runner.rows(tasks(by_bus, shared, runner.remote)):
            of_bus = pairs_of(row, search)
            pairs += of_bus
            simulations += row["simulations"]
            if each:
                each(of_bus)
            if progress:
                progress(len(pairs), size)
    order = {pair: k for k, pair in enumerate((bus, str(line)) for bus in by_bus for line in by_bus[bus])}
    pairs.sort(key=lambda p: (_rank(p), order[p.fault, p.trip[0]]))
    wall = time.perf_counter() - began
    whole = Screen(point.case.name, tuple(pairs), found, search, point.case.frequency_hz, size, simulations, wall)
    return whole if below is None else whole.below(below)


def _next(below: str | float, search: Search, case: Case) -> float:
    """The grid's first point (cycles) at or above a clearing time."""
    longest = cycles(below, case.frequency_hz)
    if not longest > 0:
        raise StudyError(f"No pair has a clearing time below {longest:g} cycles; give a time above 0.")
    return math.ceil(longest / search.resolution_cycles - 1e-9) * search.resolution_cycles


def _by_bus(case: Case, found: Lines, buses: int | str | Iterable[int] | None) -> dict[str, list[Circuit]]:
    """Faulted bus -> the lines that are opened."""
    wanted = _wanted(case, buses)
    by_bus: dict[str, list[Circuit]] = {}
    for circuit in found.screened:
        for bus in (str(circuit.a), str(circuit.b)):
            if wanted is None or bus in wanted:
                by_bus.setdefault(bus, []).append(circuit)
    if not by_bus:
        where = "" if wanted is None else f" at bus {', '.join(sorted(wanted))}"
        raise StudyError(f"{case.name} has no line{where} that can be opened without splitting the network.")
    return by_bus


def _wanted(case: Case, buses: int | str | Iterable[int] | None) -> set[str] | None:
    """Numbers of the faulted buses, which the case has; None: all."""
    if buses is None:
        return None
    listed = buses.replace(",", " ").split() if isinstance(buses, str) else [buses] if isinstance(buses, int) else buses
    if not isinstance(listed, Iterable):
        raise StudyError(f"buses = {buses!r} does not name buses; write buses=[83, 102].")
    return {str(case.buses[naming.row(case, "buses", bus)].bus) for bus in listed}


def _rank(pair: ClearingTime) -> float:
    return {"unstable_at_zero": -1.0, "stable_at_limit": math.inf}.get(pair.status, pair.cycles or 0.0)


class Shared(NamedTuple):
    """What the faulted buses of a screen share."""

    base: Base
    search: Search
    control: Control


class FaultedBus(NamedTuple):
    """The lines that are opened, one after the other, to clear a fault at a bus."""

    case: str
    fault: str
    trip: tuple[Circuit, ...]
    study: str  # search and control, as text

    def given(self) -> dict[str, Any]:
        """Column -> value."""
        return self._asdict() | {"trip": ", ".join(map(str, self.trip))}


def tasks(by_bus: dict[str, list[Circuit]], shared: Shared, identified: bool) -> list[Task]:
    """A task for every faulted bus, from the lines that are opened there.

    Unless `identified`, its key says nothing about case, search and control. Raises StudyError if a control cannot be
    identified.
    """
    case, found = shared.base.point.case, []
    study = text([shared.search, shared.control]) if identified else ""
    content = shared.base.fingerprint if identified else ""
    for bus, circuits in by_bus.items():
        job = FaultedBus(case.name, bus, tuple(circuits), study)
        found.append(Task(sha256({"format": FORMAT, "job": job.given(), "case": content}), job, shared, BUS))
    return found


def run(task: Task) -> Found:
    """The clearing times of a faulted bus."""
    job, (base, search, control) = task.job, task.shared
    first, *others = (Contingency(job.fault, trip=one) for one in job.trip)
    trial = Trial(base.point, first, control, search)
    pairs = _pairs([trial, *map(trial.of, others)])
    shortest = min((p.cycles for p in pairs if p.cycles is not None), default=None)
    simulations = sum(len(p.runs) for p in pairs) + 1
    found = json.dumps([as_plain(pair) for pair in pairs])
    return Found({"simulations": simulations, "shortest_cycles": shortest, "pairs": found})


def _pairs(trials: list[Trial]) -> list[ClearingTime]:
    """The clearing times of one faulted bus; the search of each begins at the longest answer so far."""
    start, longest, pairs = first_try(trials[0]), -1, []
    for trial in trials:
        pairs.append(critical(trial, start))
        if pairs[-1].status != "unstable_at_zero":
            found, search = pairs[-1].cycles, trial.search
            k = search.last if found is None else round(found / search.resolution_cycles)
            if k > longest:
                longest, start = k, (k + 1, search.points(NEAR))
    return pairs


def as_plain(found: ClearingTime) -> dict[str, Any]:
    """The clearing time of a fault and the lines opened, without its search."""
    answer = {name: getattr(found, name) for name in (*ANSWER, "fault", "trip")}
    return answer | {"runs": [_run_as_plain(run) for run in found.runs]}


def _run_as_plain(run: Run) -> list[Any]:
    margin = None if run.margin is None else [float(energy) for energy in run.margin]
    swings = None if run.swings is None else list(run.swings)
    return list(run._replace(margin=margin, swings=swings, stalled=list(run.stalled)))  # type: ignore[arg-type]


def pairs_of(row: dict[str, Any], search: Search) -> list[ClearingTime]:
    """The clearing times in a row."""
    return [from_plain(one, search) for one in json.loads(row["pairs"])]


def from_plain(plain: dict[str, Any], search: Search) -> ClearingTime:
    """The clearing time that was found by a search, from its plain values."""
    contingency = Contingency(plain["fault"], trip=plain["trip"])
    runs = tuple(map(_run_from_plain, plain["runs"]))
    return ClearingTime(contingency=contingency, search=search, runs=runs, **{name: plain[name] for name in ANSWER})


def _run_from_plain(plain: list[Any]) -> Run:
    run = Run(*plain)
    return run._replace(
        outcome=OutcomeKind(run.outcome),
        margin=None if run.margin is None else Margin(*run.margin),
        swings=None if run.swings is None else Swings(*run.swings),
        stalled=tuple(run.stalled),
    )


BUS = Kind(
    "screen",
    {"case": str, "fault": str, "trip": str, "study": str},
    {"simulations": int, "shortest_cycles": float, "pairs": str},
    run,
    FORMAT,
)
