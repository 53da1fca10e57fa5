"""The search for a critical clearing time, of one contingency."""

import time
from collections.abc import Callable
from dataclasses import replace

from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError, shown
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.simulate import checked_control

from .last_stable import last_stable
from .result import ClearingTime
from .search import ABOVE, Search
from .trial import Run, Trial

APART = 0.5  # cycles   of which the first guess is a multiple
LONGEST = "20s"  # observed at most


def clearing_time(
    base: Case | OperatingPoint,
    contingency: Contingency | str,
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
    progress: Callable[[Run], None] | None = None,
) -> ClearingTime:
    """The critical clearing time of a contingency.

    Clearing times are multiples of the resolution. The answer is stable and the next one is not. Then shorter and
    longer faults are tried every eighth of a cycle: if a shorter one is unstable, the answer lies below it, and if a
    longer one is stable, stability is not monotone. Runs whose swings do not decay are watched longer. `screen` and
    the studies that use clearing times search in the same way, but try no longer faults.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    contingency : Contingency or str
        The fault and the circuits opened to clear it; its own clearing time is ignored. A text is the fault
        location, such as "7-8@0.4".
    storage, control, step, criterion
        As in `simulate`.
    resolution, limit : str or float
        Spacing of the clearing times, and the longest one tried: "0.125cyc", or seconds.
    observe : str or float
        Time simulated after clearing: "5s", or seconds.
    longest : str or float
        Longest time simulated after clearing, while the swings neither decay nor are small; 0: never more than
        `observe`.
    scan : str or float
        Range below and above the answer in which every eighth of a cycle (every point of a coarser grid) is tried:
        "4cyc", or seconds; with 0 only the fault half a cycle shorter is tried. By default 4 cycles above, and below as
        the last swings of the answer demand: 2 cycles, 1 if they are below 60 degrees and do not grow, and half a
        cycle if they decay or are below 30 degrees.
    progress : callable, optional
        Called after every simulation.

    Returns
    -------
    ClearingTime

    Raises
    ------
    StudyError
        If the case lacks something named, or the grid has no points.
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
    search = replace(search, above_cycles=ABOVE if search.scan_cycles is None else search.scan_cycles)
    trial = Trial(point, _one(contingency), checked_control(control, point.case), search)
    return critical(trial, progress=progress)


def critical(
    trial: Trial,
    start: tuple[int, int] | None = None,
    progress: Callable[[Run], None] | None = None,
) -> ClearingTime:
    """The critical clearing time of a trial.

    Parameters
    ----------
    trial : Trial
    start : tuple of int, optional
        First point of the grid and first stride; by default from the time at which an uncleared fault causes loss
        of synchronism.
    progress : callable, optional
        Called after every simulation.
    """
    began, search, case = time.perf_counter(), trial.search, trial.point.case

    def attempt(k: int) -> Run:
        ran = trial.attempt(k)
        if progress:
            progress(ran)
        return ran

    guess, stride = start or first_try(trial)
    found = last_stable(attempt, search.last, guess, stride, **search.shorter())
    cycles, runs = found.critical * search.resolution_cycles, dict(found.runs)
    if found.status == "found":
        longer = search.scan(search.above_cycles)
        above = (min(found.critical + n * longer.spacing, search.last) for n in range(1, longer.number + 1))
        runs |= {k: attempt(k) for k in dict.fromkeys(above) if k not in runs}
    answer = cycles if found.status == "found" else None
    seconds = None if answer is None else answer / case.frequency_hz
    ordered, wall = tuple(runs[k] for k in sorted(runs)), time.perf_counter() - began
    return ClearingTime(
        case.name, trial.contingency, found.status, answer, seconds, found.machine, search, ordered, wall
    )


def first_try(trial: Trial) -> tuple[int, int]:
    """Where the search begins: first point of the grid, a multiple of the spacing, and first stride."""
    step = trial.search.points(APART)
    guess = round(trial.guess() / step) * step
    return guess, max(1, guess // 4)


def _one(contingency: Contingency | str) -> Contingency:
    if isinstance(contingency, str):
        return Contingency(contingency)
    if not isinstance(contingency, Contingency):
        raise StudyError(
            f"{shown(contingency)} is not a contingency; give one, such as Contingency('7-8@0.4', trip='7-8')."
        )
    return contingency
