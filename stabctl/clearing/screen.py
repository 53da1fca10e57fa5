"""The screen: every line fault of a case, or other contingencies, ranked by critical clearing time.

A job finds the clearing times of faults at one place, each cleared by opening other circuits. Its row keeps them as
plain values.
"""

import json
import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import cycles
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.jobs import Found, Kind, Runner, Task
from stabctl.jobs.task import Base, sha256, text
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.outcome import Kind as OutcomeKind
from stabctl.simulation.simulate import checked_control
from stabctl.simulation.swings import Swings

from .critical_time import LONGEST, critical, first_try
from .index import Severity, ranked
from .result import ClearingTime
from .screen_result import Lines, Screen, lines
from .templates import CATEGORIES, contingencies
from .trial import Margin, Run, Search, Trial

if TYPE_CHECKING:
    from stabctl.judgment import Criteria

FORMAT = 13
FAULTS = "lines", "buses"
ANSWER = "case", "status", "cycles", "seconds", "machine", "wall_s"
NEAR = 0.5  # cycles   first stride from the answer of another contingency at the same place


def screen(
    base: Case | OperatingPoint,
    below: str | float | None = None,
    *,
    faults: str | Iterable[Contingency | str] = "lines",
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
    buses: int | str | Iterable[int] | None = None,
    workers: int | None = None,
    store: str | Path | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
    each: Callable[[Sequence[ClearingTime]], None] | None = None,
    ranking: Callable[[Sequence[Severity]], None] | None = None,
) -> Screen:
    """The critical clearing times of bolted faults at both ends of every line, or of other contingencies.

    A fault at the end of a line is cleared by opening that line. The search is that of `clearing_time`, with the same
    answers; only longer faults are not tried, and `monotone` of a pair is therefore unknown (None). Lines whose opening
    splits the network, and circuits equal to a parallel one, are left out. The answers do not depend on the number of
    threads.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    below : str or float, optional
        Clearing time from which on a pair is not listed: "8cyc", or seconds. Saves most of the work.
    faults : str or iterable of Contingency or str
        "lines": faults at both ends of every line. "buses": a fault at every bus that is not inside a transformer,
        cleared without opening a circuit. Categories of NERC TPL-001-5, Table 1: "P1", "P2", "P4", "P5", "P6", "P7",
        with a clearing time that a study compares with: "P4@15cyc". Several: "lines, P7". Or the contingencies; the
        search ignores their own clearing times. Default "lines".
    storage, control, resolution, limit, observe, longest, scan, step, criterion, criteria
        As in `clearing_time`.
    buses : int, str, or iterable of int, optional
        Buses with a fault, "83, 102" or [83, 102]; by default all. Not for contingencies that are given.
    workers : int, optional
        Threads; by default one per core.
    store : str or Path, optional
        Folder that keeps what is done, place by place, in screen.db; called again, the screen continues from there.
    scheduler : str, optional
        Scheduler of a Dask cluster instead of threads: "tcp://host:8786".
    progress : callable, optional
        Called with the number of pairs done and the total.
    each : callable, optional
        Called with the pairs of one place, as soon as they are found; the worst places come first, as one short run of
        every pair ranks them. The pairs do not depend on it.
    ranking : callable, optional
        Called before the search with what these runs show, the worst first.

    Returns
    -------
    Screen

    Raises
    ------
    StudyError
        If the grid has no points, there is no line to open, the case lacks what a contingency names, or the store or
        the cluster cannot be used.

    Examples
    --------
    >>> screen = st.load("two_area").screen(below="10cyc")
    >>> screen.df[["fault", "trip", "cycles", "machine"]]
      fault trip  cycles  machine
    0     7  7-8     9.0        4
    """
    point = operating_point(base, storage)
    given: dict[str, Any] = {"resolution": resolution, "limit": limit, "observe": observe, "longest": longest}
    given |= {"scan": scan, "step": step, "criterion": criterion, "criteria": criteria}
    planned = plan(point.case, below, faults=faults, buses=buses, control=control, **given)
    how: dict[str, Any] = {"store": store, "workers": workers, "scheduler": scheduler}
    return carried_out(point, planned, progress=progress, each=each, ranking=ranking, **how)


class Plan(NamedTuple):
    """What a screen does."""

    search: Search
    lines: Lines  # screened, if lines are
    places: dict[str, list[Contingency]]  # place and impedance of a fault -> the contingencies with it
    control: Control
    below: str | float | None
    left_out: tuple[str, ...]  # sentences about contingencies of a file


def plan(
    case: Case,
    below: str | float | None = None,
    *,
    faults: str | Iterable[Contingency | str],
    buses: int | str | Iterable[int] | None = None,
    control: Control,
    criteria: "Criteria | str | Path | None",
    longest: str | float = LONGEST,
    **search: Any,
) -> Plan:
    """What `screen` will do with these arguments. Raises `StudyError` if it cannot be done."""
    chosen = Search.of(case, keeping=criteria, longest=longest, **search)
    if below is not None:
        chosen = replace(chosen, limit_cycles=min(chosen.limit_cycles, _next(below, chosen, case)))
    found, left_out = _places(case, faults, buses), getattr(faults, "left_out", ())
    return Plan(chosen, *found, checked_control(control, case), below, left_out)


def carried_out(
    point: OperatingPoint,
    plan: Plan,
    *,
    progress: Callable[[int, int], None] | None,
    each: Callable[[Sequence[ClearingTime]], None] | None,
    ranking: Callable[[Sequence[Severity]], None] | None,
    **how: Any,
) -> Screen:
    """The screen that is planned; `how` are workers, store and scheduler."""
    shared = Shared(Base(point), plan.search, plan.control)
    began, pairs = time.perf_counter(), list[ClearingTime]()
    simulations, size = 0, sum(map(len, plan.places.values()))
    with Runner(PLACE, **how) as runner:
        ordered = tasks(plan.places, shared, runner.remote)
        if each or ranking:
            ordered, severities = ranked(ordered, **how)
            if ranking:
                ranking(severities)
        for task, row in runner.rows(ordered):
            here = pairs_of(row, task.job.contingencies, plan.search)
            pairs += here
            simulations += row["simulations"]
            if each:
                each(here)
            if progress:
                progress(len(pairs), size)
    order = {one: k for k, one in enumerate(one for several in plan.places.values() for one in several)}
    pairs.sort(key=lambda p: (_rank(p), order[p.contingency]))
    wall = time.perf_counter() - began
    about = plan.search, point.case.frequency_hz, size, simulations, wall, plan.left_out
    whole = Screen(point.case.name, tuple(pairs), plan.lines, *about)
    return whole if plan.below is None else whole.below(plan.below)


def _next(below: str | float, search: Search, case: Case) -> float:
    """The grid's first point (cycles) at or above a clearing time."""
    longest = cycles(below, case.frequency_hz)
    if not longest > 0:
        raise StudyError(f"No pair has a clearing time below {longest:g} cycles; give a time above 0.")
    return math.ceil(longest / search.resolution_cycles - 1e-9) * search.resolution_cycles


def _places(
    case: Case, faults: str | Iterable[Contingency | str], buses: int | str | Iterable[int] | None
) -> tuple[Lines, dict[str, list[Contingency]]]:
    """The lines and the places of a plan."""
    kinds = naming.listed(faults) if isinstance(faults, str) else []
    categories = [word for word in kinds if word[:1] in "Pp" and word[1:2].isdigit()]
    given = () if isinstance(faults, str) else tuple(faults) if isinstance(faults, Iterable) else (faults,)
    if not given and not (kinds and {*kinds} - {*categories} <= {*FAULTS}):
        known = f"'lines', 'buses', {', '.join(CATEGORIES)}, several of them"
        raise StudyError(f"faults = {shown(faults)} is not allowed; give {known}, or contingencies.")
    if not kinds and buses is not None:
        raise StudyError("buses = ... chooses among the faults at lines and buses; leave it out with contingencies.")
    wanted, found = _wanted(case, buses), lines(case) if "lines" in kinds else Lines((), (), ())
    chosen = [_own(case, one) for one in given]
    for circuit in found.screened:
        chosen += [Contingency(bus, trip=circuit) for bus in map(str, circuit[:2]) if wanted is None or bus in wanted]
    if "buses" in kinds:
        own = [str(b.bus) for b in case.buses if not naming.internal(b)] if wanted is None else wanted
        chosen += [Contingency(str(b.bus)) for b in case.buses if str(b.bus) in own]
    for word in categories:
        of = (one.placed(case) for one in contingencies(case, word))
        chosen += [one for one in of if wanted is None or one.fault in wanted]
    if categories and not chosen:
        raise StudyError(f"{case.name} has no contingencies {', '.join(categories)}{_at(wanted)}.")
    if not chosen:
        bridges = any(wanted is None or {str(k.a), str(k.b)} & wanted for k in found.bridges)
        what, why = (
            ("line", "can be opened without splitting the network") if bridges else ("branch", "counts as a line")
        )
        raise StudyError(f"{case.name} has no {what}{_at(wanted)} that {why}.")
    places: dict[str, dict[Contingency, None]] = {}
    for one in chosen:
        places.setdefault(f"{one.fault} through {one.impedance}", {})[one] = None
    return found, {place: [*several] for place, several in places.items()}


def _at(wanted: set[str] | None) -> str:
    return "" if wanted is None else f" at bus {', '.join(sorted(wanted))}"


def _own(case: Case, one: Contingency | str) -> Contingency:
    """A contingency that is given, checked."""
    given = Contingency(one) if isinstance(one, str) else one
    if not isinstance(given, Contingency) or given.fault is None:
        raise StudyError(f"{shown(one)} has no fault whose clearing time could be found; give Contingency('7-8@0.4').")
    placed = given.placed(case)
    placed.with_clear(0.1).check(case)
    return placed


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


class FaultedPlace(NamedTuple):
    """The contingencies with a fault at one place, one after the other."""

    case: str
    fault: str
    contingencies: tuple[Contingency, ...]
    study: str  # search and control, as text

    def given(self) -> dict[str, Any]:
        """Column -> value."""
        told = "; ".join(", ".join(map(str, one.opened)) for one in self.contingencies)
        return {"case": self.case, "fault": self.fault, "trip": told, "study": self.study}


def tasks(places: dict[str, list[Contingency]], shared: Shared, identified: bool) -> list[Task]:
    """A task for every place of a fault.

    Unless `identified`, its key says nothing about case, search and control. Raises StudyError if a control cannot be
    identified.
    """
    case, found = shared.base.point.case, []
    study = text([shared.search, shared.control]) if identified else ""
    content = shared.base.fingerprint if identified else ""
    for several in places.values():
        job = FaultedPlace(case.name, str(several[0].fault), tuple(several), study)
        told = {"job": job.given(), "contingencies": text(several), "case": content}
        found.append(Task(sha256({"format": FORMAT} | told), job, shared, PLACE))
    return found


def run(task: Task) -> Found:
    """The clearing times of the contingencies at one place."""
    job, (base, search, control) = task.job, task.shared
    first, *others = job.contingencies
    trial = Trial(base.point, first, control, search)
    pairs = _pairs([trial, *map(trial.of, others)])
    shortest = min((p.cycles for p in pairs if p.cycles is not None), default=None)
    simulations = sum(len(p.runs) for p in pairs) + 1
    found = json.dumps([as_plain(pair) for pair in pairs])
    return Found({"simulations": simulations, "shortest_cycles": shortest, "pairs": found})


def _pairs(trials: list[Trial]) -> list[ClearingTime]:
    """The clearing times at one place; the search of each begins at the longest answer so far."""
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
    """A clearing time without its search and its contingency."""
    return {name: getattr(found, name) for name in ANSWER} | {"runs": [_run_as_plain(run) for run in found.runs]}


def _run_as_plain(run: Run) -> list[Any]:
    margin = None if run.margin is None else [float(energy) for energy in run.margin]
    swings = None if run.swings is None else list(run.swings)
    violated = None if run.violated is None else [*run.violated]
    return list(run._replace(margin=margin, swings=swings, stalled=[*run.stalled], violated=violated))  # type: ignore[arg-type]


def pairs_of(row: dict[str, Any], contingencies: Iterable[Contingency], search: Search) -> list[ClearingTime]:
    """The clearing times in a row."""
    plain = json.loads(row["pairs"])
    return [from_plain(one, of, search) for one, of in zip(plain, contingencies, strict=True)]


def from_plain(plain: dict[str, Any], contingency: Contingency, search: Search) -> ClearingTime:
    """The clearing time that was found by a search, from its plain values."""
    runs = tuple(map(_run_from_plain, plain["runs"]))
    return ClearingTime(contingency=contingency, search=search, runs=runs, **{name: plain[name] for name in ANSWER})


def _run_from_plain(plain: list[Any]) -> Run:
    run = Run(*plain)
    if run.violated is not None:
        from stabctl.judgment import Violation

        run = run._replace(violated=Violation(*run.violated))
    return run._replace(
        outcome=OutcomeKind(run.outcome),
        margin=None if run.margin is None else Margin(*run.margin),
        swings=None if run.swings is None else Swings(*run.swings),
        stalled=tuple(run.stalled),
    )


PLACE = Kind(
    "screen",
    {"case": str, "fault": str, "trip": str, "study": str},
    {"simulations": int, "shortest_cycles": float, "pairs": str},
    run,
    FORMAT,
)
