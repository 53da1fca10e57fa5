"""The screen: every line fault of a case, ranked by critical clearing time."""

import csv
import io
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stabctl._util import cores, files
from stabctl.controllers import Law
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.events import Fault
from stabctl.simulation.sampled import Sampled
from stabctl.simulation.simulation import run

from .critical_time import BELOW, Status, Trial
from .lines import Lines, lines
from .margin import margin
from .search import Attempt, search

SUSTAINED = 0.45  # first guess, as a share of the time in which a fault that stays loses synchronism
NEAR = 0.5  # cycles   first stride from the answer of another line at the same bus


class Pair(NamedTuple):
    """A fault and the line that is opened to clear it."""

    fault: str
    trip: str
    cycles: float | None  # last stable clearing time on the grid
    status: Status
    machine: int | None  # goes first just beyond
    simulations: int

    def __str__(self) -> str:
        first = f"; machine {self.machine} goes first" if self.machine is not None else ""
        what = f"fault {self.fault}, trip {self.trip}"
        if self.status == "unstable_at_zero":
            return f"{what}: the system is lost by the opening alone{first}"
        if self.status == "stable_at_limit":
            return f"{what}: stable up to the limit"
        return f"{what}: {self.cycles:g} cycles{first}"


COLUMNS = Pair._fields[:5]  # of a file: without the number of simulations


@dataclass(frozen=True)
class Screen:
    """The pairs of a case, those of the shortest clearing time first, and how they were found."""

    case: str
    pairs: tuple[Pair, ...]
    lines: Lines
    resolution_cycles: float
    limit_cycles: float
    observed_s: float  # s   watched after clearing
    screened: int  # pairs that were tried
    simulations: int
    wall_s: float

    def below(self, cycles: float) -> "Screen":
        """The pairs with a clearing time of less than these cycles, those among them that opening alone loses."""
        kept = (p for p in self.pairs if p.status == "unstable_at_zero" or (p.cycles is not None and p.cycles < cycles))
        return replace(self, pairs=tuple(kept), limit_cycles=min(cycles, self.limit_cycles))

    def save(self, path: str | Path) -> Path:
        """Write the pairs to a .csv file, whole or not at all; the path."""
        path = Path(path)
        if path.suffix.lower() != ".csv":
            raise StudyError(f"The file {path.name!r} must end in .csv.")
        text = io.StringIO()
        table = csv.writer(text)
        table.writerow(COLUMNS)
        table.writerows(p[: len(COLUMNS)] for p in self.pairs)
        files.replace(path, text.getvalue())
        return path

    def remarks(self) -> tuple[str, ...]:
        """How the pairs were found and what was left out, in sentences."""
        lost = [p for p in self.pairs if p.status == "unstable_at_zero"]
        shown = f"{len(self.pairs)} of {self.screened} fault and trip pairs"
        if not self.pairs:
            shown = f"all {self.screened} fault and trip pairs are survived for {self.limit_cycles:g} cycles"
        said = [
            f"{self.case}: {shown} (grid of {self.resolution_cycles:g} cycles up to {self.limit_cycles:g}, observed "
            f"{self.observed_s:g} s after clearing, {self.simulations} simulations in {self.wall_s:.1f} s)."
        ]
        if lost:
            said.append(f"Opening loses the system even without a fault: {', '.join(_distinct(lost))}.")
        if self.lines.bridges:
            said.append(f"Left out as bridges, whose opening cuts the network: {', '.join(self.lines.bridges)}.")
        if self.lines.twins:
            said.append(f"Left out as equal to a circuit beside them: {', '.join(self.lines.twins)}.")
        return tuple(said)

    def __str__(self) -> str:
        first, *others = self.remarks()
        return "\n".join([first, *(f"  {p}" for p in self.pairs), *others])


def screen(
    point: OperatingPoint,
    below: float | None = None,
    control: Law | Sampled | None = None,
    resolution_cycles: float = 0.125,
    limit_cycles: float = 60.0,
    observed_s: float = 5.0,
    step: float | None = None,
    criterion: Criterion = DEFAULT,
    buses: Iterable[int] | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Screen:
    """The critical clearing times of bolted faults at both ends of every line, cleared by opening that line.

    Criterion, observation and grid are those of `clearing.clearing_time`, and so are the answers; the search is shorter
    (`search.search`). Bridges and circuits equal to another beside them are left out.

    Args: operating point (its case's storage acts under `control`); clearing time (cycles) from which on a pair is not
    listed nor its answer sought; grid, limit, observation, step and end of a run as in `clearing_time`; the buses with
    a fault (default: every end of a line); threads (default: one per core); what is told the pairs done and their
    number. The answers do not depend on the threads. Raises `StudyError` for impossible grids, and where there is no
    line to open.
    """
    if below is not None and not below > 0:
        raise StudyError(f"No pair has a clearing time below {below:g} cycles; list those below a time above 0.")
    limit = limit_cycles if below is None else min(limit_cycles, _up(below, resolution_cycles))
    Trial(point, "", (), control, resolution_cycles, limit, observed_s, step, criterion)
    found, wanted = lines(point.case), None if buses is None else {str(bus) for bus in buses}
    by_bus: dict[str, list[Trial]] = {}
    for name in found.screened:
        for bus in name.split("#")[0].split("-"):
            if wanted is None or bus in wanted:
                trial = Trial(point, bus, (name,), control, resolution_cycles, limit, observed_s, step, criterion)
                by_bus.setdefault(bus, []).append(trial)
    if not by_bus:
        where = "" if wanted is None else f" at bus {', '.join(sorted(wanted))}"
        raise StudyError(
            f"{point.case.name} has no line{where} whose opening leaves the network whole; none to screen."
        )
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
    simulations = sum(p.simulations for p in pairs) + len(by_bus)
    order = {(t.fault, *t.trip): k for k, t in enumerate(everything)}
    pairs.sort(key=lambda p: (_rank(p), order[p[:2]]))
    whole = Screen(
        point.case.name,
        tuple(pairs),
        found,
        resolution_cycles,
        limit,
        observed_s,
        len(everything),
        simulations,
        time.perf_counter() - began,
    )
    return whole if below is None else whole.below(below)


def _up(cycles: float, resolution: float) -> float:
    """The grid's first point at or above these cycles."""
    return max(float(np.ceil(cycles / resolution - 1e-9) * resolution), 0.0) if resolution > 0 else cycles


def _distinct(pairs: Sequence[Pair]) -> list[str]:
    return list(dict.fromkeys(p.trip for p in pairs))


def _rank(pair: Pair) -> float:
    return {"unstable_at_zero": -1.0, "stable_at_limit": np.inf}.get(pair.status, pair.cycles)


def _at_one_bus(trials: Sequence[Trial]) -> list[Pair]:
    """The pairs of one faulted bus; each begins at the longest answer so far, the first at a share of the time in which
    the fault that stays loses synchronism.
    """
    first, grid = trials[0], trials[0].resolution_cycles
    guess = int(SUSTAINED * _sustained(first) / grid)
    stride = max(1, guess // 4)
    best, pairs = -1, []
    for trial in trials:
        found = search(lambda k, t=trial: _attempt(t, k), trial.last, guess, stride, max(1, round(BELOW / grid)))
        cycles = found.critical * grid if found.status == "found" else None
        pairs.append(Pair(trial.fault, trial.trip[0], cycles, found.status, found.machine, found.runs))
        if found.status != "unstable_at_zero" and found.critical > best:
            best = found.critical
            guess, stride = best + 1, max(1, round(NEAR / grid))
    return pairs


def _sustained(trial: Trial) -> float:
    """Cycles in which a fault that stays loses synchronism, sought as far as the guess needs it."""
    hz = trial.point.case.frequency_hz
    longest = min(trial.limit_cycles / SUSTAINED / hz, trial.observed_s)
    happens = [Fault(trial.fault, trial.at)]
    until = trial.at + longest
    ran = run(trial.point, happens, until, trial.control, trial.step, trial.criterion, record=False).outcome
    return trial.limit_cycles / SUSTAINED if ran.stable else (ran.time_s - trial.at) * hz


def _attempt(trial: Trial, k: int) -> Attempt:
    ran = trial.simulate(k, record=True)
    if ran.outcome.stable:
        return Attempt(True)
    return Attempt(False, ran.outcome.machine, margin(ran, trial.cleared(k)))
