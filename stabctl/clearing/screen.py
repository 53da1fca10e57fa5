"""The screen: every line fault of a case, ranked by critical clearing time."""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.jobs import Runner
from stabctl.jobs.base import Base
from stabctl.model import circuits, keys
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.simulation.control import Control
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.simulate import checked_control
from stabctl.units import cycles

from . import faulted_bus
from .critical_time import LONGEST
from .lines import Lines, lines
from .result import ClearingTime
from .screen_result import Screen
from .search import Search


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
    shared = faulted_bus.Shared(Base(point), search, checked_control(control, point.case))
    began, pairs = time.perf_counter(), list[ClearingTime]()
    simulations, size = 0, sum(map(len, by_bus.values()))
    with Runner(faulted_bus.BUS, store=store, workers=workers, scheduler=scheduler) as runner:
        for _, row in runner.rows(faulted_bus.tasks(by_bus, shared, runner.remote)):
            of_bus = faulted_bus.pairs_of(row, search)
            pairs += of_bus
            simulations += row["simulations"]
            if each:
                each(of_bus)
            if progress:
                progress(len(pairs), size)
    order = {(bus, name): k for k, (bus, name) in enumerate((bus, name) for bus in by_bus for name in by_bus[bus])}
    pairs.sort(key=lambda p: (_rank(p), order[p.fault, p.trip[0]]))
    wall = time.perf_counter() - began
    whole = Screen(point.case.name, tuple(pairs), found, search, point.case.frequency_hz, size, simulations, wall)
    return whole if below is None else whole.below(below)


def _by_bus(case: Case, found: Lines, buses: int | str | Iterable[int] | None) -> dict[str, list[str]]:
    """Faulted bus -> the lines that are opened."""
    wanted = _wanted(case, buses)
    branch = dict(zip(circuits.names(case.branches), case.branches, strict=True))
    by_bus: dict[str, list[str]] = {}
    for name in found.screened:
        for bus in (str(branch[name].from_bus), str(branch[name].to_bus)):
            if wanted is None or bus in wanted:
                by_bus.setdefault(bus, []).append(name)
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
    return {str(case.buses[keys.row(case, "buses", bus)].bus) for bus in listed}


def _next(below: str | float, search: Search, case: Case) -> float:
    """The grid's first point (cycles) at or above a clearing time."""
    longest = cycles(below, case.frequency_hz)
    if not longest > 0:
        raise StudyError(f"No pair has a clearing time below {longest:g} cycles; give a time above 0.")
    return math.ceil(longest / search.resolution_cycles - 1e-9) * search.resolution_cycles


def _rank(pair: ClearingTime) -> float:
    return {"unstable_at_zero": -1.0, "stable_at_limit": math.inf}.get(pair.status, pair.cycles or 0.0)
