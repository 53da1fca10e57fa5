"""The search for a critical clearing time, of one contingency."""

import math
import time
from collections.abc import Callable

from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError, shown
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.simulate import checked_control

from .last_stable import Scan, last_stable
from .result import ClearingTime
from .search import Search
from .trial import Run, Trial

SPACING = 0.125  # cycles between the faults of the scan, and between those tried first on a finer grid
APART = 0.5  # cycles   without a scan, between the answer and the one shorter fault tried
WARY = 1.0  # cycles   range below an answer whose swings have not settled that is always scanned
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
    scan: str | float = "4cyc",
    step: str | float | None = None,
    criterion: Criterion = DEFAULT,
    progress: Callable[[Run], None] | None = None,
) -> ClearingTime:
    """The critical clearing time of a contingency.

    Clearing times are multiples of the resolution. The answer is stable and the next one is not. Then shorter and
    longer faults are tried every eighth of a cycle: if a shorter one is unstable, the answer lies below it, and if a
    longer one is stable, stability is not monotone. Runs whose swings do not decay are watched longer.

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
        "4cyc", or seconds; with 0 only the fault half a cycle shorter is tried.
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
    wide, wary = scan(search, search.scan_cycles), scan(search, WARY if search.extended else 0.0)
    below, coarse = (wide, wide.spacing) if wide.number else (near(search), 1)
    found = last_stable(attempt, search.last, guess, stride, scan=below, unsettled=wary, coarse=coarse)
    cycles, runs = found.critical * search.resolution_cycles, dict(found.runs)
    if found.status == "found":
        above = (min(found.critical + n * wide.spacing, search.last) for n in range(1, wide.number + 1))
        runs |= {k: attempt(k) for k in dict.fromkeys(above) if k not in runs}
    answer = cycles if found.status == "found" else None
    seconds = None if answer is None else answer / case.frequency_hz
    ordered, wall = tuple(runs[k] for k in sorted(runs)), time.perf_counter() - began
    return ClearingTime(
        case.name, trial.contingency, found.status, answer, seconds, found.machine, search, ordered, wall
    )


def scan(search: Search, reach: float) -> Scan:
    """The faults tried on one side of the answer, over a range in cycles."""
    spacing = search.points(SPACING)
    return Scan(spacing, math.ceil(reach / (spacing * search.resolution_cycles) - 1e-9))


def near(search: Search) -> Scan:
    """The one shorter fault that is tried without a scan."""
    return Scan(search.points(APART), 1)


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
