"""Critical clearing time: the longest fault, on a grid of clearing times, after which the system stays stable."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.controllers import Law
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError, shown
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.sampled import Sampled
from stabctl.simulation.simulate import checked_control

from .last_stable import Status, last_stable
from .search import Search
from .trial import Run, Trial

if TYPE_CHECKING:
    import pandas as pd

PROBES = (0.5, 1.0, 2.0, 4.0)  # cycles above the answer at which monotony is checked
BELOW = 0.5  # cycles below the answer, where the system must be stable as well: a later swing may be lost in between


@dataclass(frozen=True, repr=False)
class ClearingTime:
    """A critical clearing time, and how it was found."""

    case: str
    contingency: Contingency
    status: Status
    cycles: float | None  # last stable clearing time on the grid
    seconds: float | None
    machine: int | None  # loses synchronism first just beyond
    search: Search
    runs: tuple[Run, ...]  # by clearing time
    wall_s: float

    plot = verb("stabctl.plotting.clearing_time:plot")

    @property
    def fault(self) -> str:
        """Fault location."""
        return self.contingency.fault or ""

    @property
    def trip(self) -> tuple[str, ...]:
        """Circuits opened to clear it, in addition to the faulted one."""
        return self.contingency.trip

    @property
    def monotone(self) -> bool:
        """Was every longer fault that was tried unstable?"""
        return not any(r.stable and r.cycles > (self.cycles or 0.0) for r in self.runs) or self.status != "found"

    @property
    def df(self) -> "pd.DataFrame":
        """The simulations of the search, a row for each clearing time tried."""
        import pandas as pd

        columns = "clearing_cycles", "stable", "outcome", "machine", "end_s"
        frame = pd.DataFrame([(r.cycles, r.stable, r.outcome.value, r.machine, r.time_s) for r in self.runs])
        return frame.set_axis(columns, axis=1).astype({"machine": "Int64"})

    def brief(self) -> str:
        """The answer, without case and search."""
        first = f"; machine {self.machine} loses synchronism first" if self.machine is not None else ""
        what = f"fault {self.fault}" + (f", trip {', '.join(self.trip)}" if self.trip else "")
        if self.status == "unstable_at_zero":
            return f"{what}: unstable for any clearing time{first}"
        if self.status == "stable_at_limit":
            return f"{what}: stable up to the limit"
        return f"{what}: {self.cycles:g} cycles{first}"

    def __str__(self) -> str:
        observed = f"observed {self.search.observed_s:g} s after clearing, {counted(len(self.runs), 'run')}"
        what = f"{self.case}, fault {self.fault}" + (f", trip {', '.join(self.trip)}" if self.trip else "")
        first = f"; machine {self.machine} loses synchronism first" if self.machine is not None else ""
        if self.status == "unstable_at_zero":
            return f"{what}: unstable even if cleared immediately{first} ({observed})."
        if self.status == "stable_at_limit":
            return f"{what}: stable up to the search limit of {self.search.limit_cycles:g} cycles ({observed})."
        text = f"{what}: critical clearing time {self.cycles:g} cycles ({self.seconds:.4f} s){first} ({observed})."
        again = [r.cycles for r in self.runs if r.stable and r.cycles > self.cycles]
        return f"{text} Stability is not monotone: stable again at {again[0]:g} cycles." if again else text

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return f"<p>{escape(str(self))}</p>{self.df.to_html(index=False)}"


def clearing_time(
    base: Case | OperatingPoint,
    contingency: Contingency | str,
    *,
    storage: "Fleet | None" = None,
    control: Law | Sampled | None = None,
    resolution: str | float = "0.125cyc",
    limit: str | float = "60cyc",
    observe: str | float = "5s",
    step: str | float | None = None,
    criterion: Criterion = DEFAULT,
    progress: Callable[[Run], None] | None = None,
) -> ClearingTime:
    """The critical clearing time of a contingency.

    Clearing times are multiples of the resolution. The answer is stable and the next one is not; a fault half a cycle
    shorter must be stable too, and some longer ones are tried to see whether stability is monotone.

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
    options = {"resolution": resolution, "limit": limit, "observe": observe, "step": step, "criterion": criterion}
    search = Search.of(point.case, **options)
    trial = Trial(point, _one(contingency), checked_control(control, point.case), search)
    return critical(trial, probes=PROBES, progress=progress)


def critical(
    trial: Trial,
    start: tuple[int, int] | None = None,
    probes: Sequence[float] = (),
    progress: Callable[[Run], None] | None = None,
) -> ClearingTime:
    """The critical clearing time of a trial.

    Parameters
    ----------
    trial : Trial
    start : tuple of int, optional
        First point of the grid and first stride; by default from the time at which an uncleared fault causes loss
        of synchronism.
    probes : sequence of float, cycles
        Distances above the answer that are tried as well.
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
    found = last_stable(attempt, search.last, guess, stride, search.points(BELOW))
    cycles, runs = found.critical * search.resolution_cycles, dict(found.runs)
    if found.status == "found":
        for k in {min(found.critical + search.points(p), search.last) for p in probes} - runs.keys():
            runs[k] = attempt(k)
    answer = (cycles, cycles / case.frequency_hz) if found.status == "found" else (None, None)
    ordered, wall = tuple(runs[k] for k in sorted(runs)), time.perf_counter() - began
    return ClearingTime(case.name, trial.contingency, found.status, *answer, found.machine, search, ordered, wall)


def first_try(trial: Trial) -> tuple[int, int]:
    """Where the search begins: first point of the grid, and first stride."""
    guess = trial.guess()
    return guess, max(1, guess // 4)


def _one(contingency: Contingency | str) -> Contingency:
    if isinstance(contingency, str):
        return Contingency(contingency)
    if not isinstance(contingency, Contingency):
        raise StudyError(
            f"{shown(contingency)} is not a contingency; give one, such as Contingency('7-8@0.4', trip='7-8')."
        )
    return contingency
