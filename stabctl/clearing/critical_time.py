"""The search for a critical clearing time: the last stable point of a grid, in few runs.

The answer is extrapolated from unstable runs, which end early.
"""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from stabctl._util.errors import StudyError, shown
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.simulate import checked_control

from .result import ClearingTime, Status
from .trial import ABOVE, NO_SCAN, Margin, Run, Scan, Search, Trial

if TYPE_CHECKING:
    from stabctl.judgment import Criteria

APART = 0.5  # cycles   of which the first guess is a multiple
LONGEST = "20s"  # observed at most
FORETOLD = 10  # runs after which the interval is only bisected
HELD = 3.0  # energy the network absorbs, relative to that of the run at clearing; errs on the unstable side
REACH = 2.0  # how far below two unstable runs their extrapolation is trusted, in multiples of their spacing
PATIENCE = 5  # unstable runs without a stable one, after which the fault cleared immediately is tried
UPPER = 2 / 3  # where an interval is divided: an unstable run costs about a third of a stable one


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
    criteria: "Criteria | str | Path | None" = None,
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
    storage, control
        As in `simulate`.
    resolution, limit : str or float
        Spacing of the clearing times, and the longest one tried: "0.125cyc", or seconds.
    observe : str or float
        Time simulated after the last event, which is the clearing unless others follow: "5s", or seconds.
    longest : str or float
        Longest time simulated after it, while the swings neither decay nor are small; 0: never more than
        `observe`.
    scan : str or float
        Range below and above the answer in which every eighth of a cycle (every point of a coarser grid) is tried:
        "4cyc", or seconds; with 0 only the fault half a cycle shorter is tried. By default 4 cycles above, and below as
        the last swings of the answer demand: 2 cycles, 1 if they are below 60 degrees and do not grow, and half a
        cycle if they decay, or are below 30 degrees and do not grow.
    step, criterion
        As in `simulate`.
    criteria : Criteria, str or Path, optional
        Criteria of performance that a run must keep to count as stable: "wecc-tpl-001", or a file. A run that is too
        short for them is repeated with the longest observation.
    progress : callable, optional
        Called after every simulation.

    Returns
    -------
    ClearingTime

    Raises
    ------
    StudyError
        If the case lacks something named, or the grid has no points.

    Examples
    --------
    >>> base = st.load("two_area").initialize()
    >>> base.clearing_time("7-8@0.4").cycles
    20.375
    >>> base.clearing_time("7-8@0.4", storage="50MW", control=st.BangBang()).cycles
    26.0
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
        keeping=criteria,
    )
    search = replace(search, above_cycles=ABOVE if search.scan_cycles is None else search.scan_cycles)
    trial = Trial(point, _one(contingency).placed(point.case), checked_control(control, point.case), search)
    return critical(trial, progress=progress)


def _one(contingency: Contingency | str) -> Contingency:
    if isinstance(contingency, str):
        return Contingency(contingency)
    if not isinstance(contingency, Contingency):
        raise StudyError(
            f"{shown(contingency)} is not a contingency; give one, such as Contingency('7-8@0.4', trip='7-8')."
        )
    return contingency


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


class Found(NamedTuple):
    """The answer on the grid."""

    status: Status
    critical: int  # last stable point; 0 if there is none
    runs: dict[int, Run]  # by point of the grid

    @property
    def machine(self) -> int | str | None:
        """Machine that loses synchronism first just beyond."""
        beyond = self.runs.get(0 if self.status == "unstable_at_zero" else self.critical + 1)
        return beyond.machine if beyond else None


def last_stable(
    attempt: Callable[[int], Run],
    last: int,
    guess: int,
    stride: int,
    *,
    always: Scan,
    lasting: Scan = NO_SCAN,
    coarse: int = 1,
) -> Found:
    """The last stable point of the grid 0 ... `last` before the lowest unstable one found: a run at each of the two.

    Starts at a guess and moves up in growing steps. The excess energy of unstable runs is extrapolated to zero over the
    square of the clearing time; if that does not help, the interval is divided. Shorter faults are tried as well: if
    one is unstable, in a later swing, the answer lies below it. They are those of `always`, and those of `lasting`
    unless the swings of the answer are calm; the nearer half of them if the swings have settled, and none if the answer
    is the last point of the grid, too. Multiples of `coarse` come before the points between them, so that a finer grid
    gives the same answer, only finer.
    """
    tried: dict[int, Run] = {}
    low, high = -1, last + 1
    k = min(max(guess, 0), last)
    while True:
        tried[k] = attempt(k)
        if tried[k].stable:
            low = max(low, k)
        else:
            high = k
            low = max((s for s, run in tried.items() if run.stable and s < k), default=-1)
        if high - low > 1:
            k, stride = _multiple(_next(low, high, last, tried, stride), low, high, coarse), 2 * stride
        elif low < 1:
            break
        else:
            swings = tried[low].swings
            settled, calm = swings is not None and swings.settled, swings is not None and swings.calm
            number = 0 if calm or (settled and low == last) else -(-lasting.number // 2) if settled else lasting.number
            gap = _gap(low, tried, always) or _gap(low, tried, lasting._replace(number=number))
            if not gap:
                break
            k = max(low - gap, 0)
    if low < 0:
        return Found("unstable_at_zero", 0, tried)
    return Found("stable_at_limit" if low == last else "found", low, tried)


def _next(low: int, high: int, last: int, tried: Mapping[int, Run], stride: int) -> int:
    """The point to try: the lowest that is predicted to be unstable."""
    if high > last:
        return min(last, low + stride)
    if low < 0 and len(tried) >= PATIENCE:
        return 0
    cut = min(low + max(1, round(UPPER * (high - low))), high - 1)
    if tried[high].margin is None or len(tried) > FORETOLD:
        return max(cut, high - stride) if low < 0 else cut
    foretold = _critical({k: run.margin for k, run in tried.items() if run.margin and k >= high})
    return min(max(int(foretold) + 1, low + 1), high - 1) if foretold > low else cut


def _critical(lost: Mapping[int, Margin]) -> float:
    """Where the excess of the unstable runs goes to zero, on the grid."""
    near, *others = sorted(lost)
    excess, given = lost[near]
    slope, least = (HELD * given / near**2 if near else 0.0), 0.0
    if others and lost[others[0]].excess > excess:
        further = others[0]
        slope = (lost[further].excess - excess) / (further**2 - near**2)
        least = max(near - REACH * (further - near), 0.0)
    return max(near**2 - excess / slope, least**2) ** 0.5 if slope > 0 else float(near)


def _multiple(k: int, low: int, high: int, spacing: int) -> int:
    """The multiple of the spacing nearest to k between low and high; k itself if there is none."""
    least, most = (low // spacing + 1) * spacing, (high - 1) // spacing * spacing
    return min(max(round(k / spacing) * spacing, least), most) if least <= most else k


def _gap(low: int, tried: Iterable[int], scan: Scan) -> int:
    """The first distance below the answer near which nothing was tried, 0 if there is none."""
    for n in range(1, scan.number + 1):
        far, near = low - n * scan.spacing, low - (n - 1) * scan.spacing
        if near > 0 and not any(far <= s < near for s in tried):
            return low - far
    return 0
