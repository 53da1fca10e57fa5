"""The screen: every line fault of a case, ranked by critical clearing time."""

import csv
import io
import math
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from stabctl._util import cores, files
from stabctl._util.tabular import machine_column
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.model import keys
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.simulate import checked_control
from stabctl.units import cycles

from .critical_time import LONGEST, critical, first_try
from .lines import Lines, lines
from .result import ClearingTime, watched
from .search import Search
from .trial import Trial

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = "fault", "trip", "cycles", "status", "machine"  # of a table
NEAR = 0.5  # cycles   first stride from the answer of another line at the same bus


@dataclass(frozen=True, repr=False)
class Screen:
    """Clearing times of faults at the ends of lines, the shortest first, and how they were found."""

    case: str
    pairs: tuple[ClearingTime, ...]  # of a fault and the line opened to clear it
    lines: Lines
    search: Search
    frequency_hz: float
    screened: int  # pairs that were tried
    simulations: int
    wall_s: float

    plot = verb("stabctl.plotting.screen:plot")

    def below(self, longest: str | float) -> "Screen":
        """The pairs with a shorter clearing time ("8cyc", or seconds), and those that are always unstable."""
        limit = cycles(longest, self.frequency_hz)
        kept = (p for p in self.pairs if p.status == "unstable_at_zero" or (p.cycles is not None and p.cycles < limit))
        shortest, longest = self.search.resolution_cycles, self.search.limit_cycles
        search = replace(self.search, limit_cycles=max(shortest, min(limit, longest)))
        return replace(self, pairs=tuple(kept), search=search)

    @property
    def observed_s(self) -> float:
        """Longest time (s) that a stable run was watched after clearing."""
        return max((p.observed_s for p in self.pairs), default=self.search.observed_s)

    def rows(self) -> list[tuple[str, str, float | None, str, int | str | None]]:
        """A row of `COLUMNS` for every pair."""
        return [(p.fault, " ".join(p.trip), p.cycles, p.status, p.machine) for p in self.pairs]

    @property
    def df(self) -> "pd.DataFrame":
        """The pairs, a row each; `machine` loses synchronism first just beyond the clearing time."""
        import pandas as pd

        return machine_column(pd.DataFrame(self.rows(), columns=COLUMNS).astype({"cycles": float}))

    def save(self, path: str | Path) -> Path:
        """Write the pairs to a .csv file atomically; returns the path."""
        path = files.path_of(path)
        if path.suffix.lower() != ".csv":
            raise StudyError(f"The file {path.name!r} must end in .csv.")
        text = io.StringIO()
        csv.writer(text).writerows([COLUMNS, *self.rows()])
        files.replace(path, text.getvalue())
        return path

    def remarks(self) -> tuple[str, ...]:
        """How the pairs were found and what was left out, in sentences."""
        search, lost = self.search, [p for p in self.pairs if p.status == "unstable_at_zero"]
        shown = f"{len(self.pairs)} of {self.screened} fault and trip pairs"
        if not self.pairs:
            shown = f"all {self.screened} fault and trip pairs are stable for {search.limit_cycles:g} cycles"
        said = [
            f"{self.case}: {shown} (grid of {search.resolution_cycles:g} cycles up to {search.limit_cycles:g}, "
            f"observed {watched(search, self.observed_s)} after clearing, {self.simulations} simulations in "
            f"{self.wall_s:.1f} s)."
        ]
        if lasting := sum(bool(p.remark()) for p in self.pairs):
            said.append(
                f"The swings of {counted(lasting, 'pair')} do not decay within {self.observed_s:g} s: watched longer, "
                "the clearing time may be shorter."
            )
        if lost:
            opened = dict.fromkeys(name for p in lost for name in p.trip)
            said.append(f"Unstable after opening the line, even without a fault: {', '.join(opened)}.")
        if self.lines.bridges:
            said.append(f"Left out because opening them splits the network: {', '.join(self.lines.bridges)}.")
        if self.lines.twins:
            said.append(f"Left out because a parallel circuit is identical: {', '.join(self.lines.twins)}.")
        return tuple(said)

    def __str__(self) -> str:
        first, *others = self.remarks()
        return "\n".join([first, *(f"  {p.brief()}" for p in self.pairs), *others])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        first, *others = map(escape, self.remarks())
        return f"<p>{first}</p>{self.df.to_html(index=False)}<p>{'<br>'.join(others)}</p>"


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
    step: str | float | None = None,
    criterion: Criterion = DEFAULT,
    buses: int | str | Iterable[int] | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Screen:
    """The critical clearing times of bolted faults at both ends of every line, cleared by opening that line.

    The search is that of `clearing_time`, but of the other faults it tries only the one half a cycle shorter, and every
    eighth of a cycle from a cycle below if the swings of the answer have not settled. `monotone` of a pair is therefore
    unknown (None). Lines whose opening splits the network, and circuits equal to a parallel
    one, are left out. The answers do not depend on the number of threads.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    below : str or float, optional
        Clearing time from which on a pair is not listed: "8cyc", or seconds. Saves most of the work.
    storage, control, resolution, limit, observe, longest, step, criterion
        As in `clearing_time`.
    buses : int, str, or iterable of int, optional
        Buses with a fault, "83, 102" or [83, 102]; by default both ends of every line.
    workers : int, optional
        Threads; by default one per core.
    progress : callable, optional
        Called with the number of pairs done and the total.

    Returns
    -------
    Screen

    Raises
    ------
    StudyError
        If the grid has no points, or there is no line to open.
    """
    point = operating_point(base, storage)
    search = Search.of(
        point.case,
        resolution=resolution,
        limit=limit,
        observe=observe,
        step=step,
        criterion=criterion,
        longest=longest,
    )
    if below is not None:
        search = replace(search, limit_cycles=min(search.limit_cycles, _next(below, search, point.case)))
    found = lines(point.case)
    by_bus = _trials(point, found, checked_control(control, point.case), search, buses)
    everything = [trial for trials in by_bus.values() for trial in trials]
    began, pairs = time.perf_counter(), []
    pool = ThreadPoolExecutor(cores.used(workers))
    try:
        for done in as_completed([pool.submit(_at_one_bus, trials) for trials in by_bus.values()]):
            pairs += done.result()
            if progress:
                progress(len(pairs), len(everything))
    finally:
        pool.shutdown(cancel_futures=True)
    simulations = sum(len(p.runs) for p in pairs) + len(by_bus)
    order = {trial.contingency: k for k, trial in enumerate(everything)}
    pairs.sort(key=lambda p: (_rank(p), order[p.contingency]))
    size, wall = len(everything), time.perf_counter() - began
    whole = Screen(point.case.name, tuple(pairs), found, search, point.case.frequency_hz, size, simulations, wall)
    return whole if below is None else whole.below(below)


def _trials(
    point: OperatingPoint,
    found: Lines,
    control: Control,
    search: Search,
    buses: int | str | Iterable[int] | None,
) -> dict[str, list[Trial]]:
    """The trials of every faulted bus."""
    wanted = _wanted(point.case, buses)
    by_bus: dict[str, list[Trial]] = {}
    for name in found.screened:
        for bus in name.split("#")[0].split("-"):
            if wanted is None or bus in wanted:
                by_bus.setdefault(bus, []).append(Trial(point, Contingency(bus, trip=name), control, search))
    if not by_bus:
        where = "" if wanted is None else f" at bus {', '.join(sorted(wanted))}"
        raise StudyError(f"{point.case.name} has no line{where} that can be opened without splitting the network.")
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


def _at_one_bus(trials: Sequence[Trial]) -> list[ClearingTime]:
    """The pairs of one faulted bus; each begins at the longest answer so far."""
    start, longest, pairs = first_try(trials[0]), -1, []
    for trial in trials:
        pairs.append(critical(trial, start))
        if pairs[-1].status != "unstable_at_zero":
            found, search = pairs[-1].cycles, trial.search
            k = search.last if found is None else round(found / search.resolution_cycles)
            if k > longest:
                longest, start = k, (k + 1, search.points(NEAR))
    return pairs
