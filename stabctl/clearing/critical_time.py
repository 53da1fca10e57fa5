"""Critical clearing time: the longest fault, on a grid of clearing times, that the system survives."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from stabctl.controllers import Law
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.outcome import Kind
from stabctl.simulation.sampled import Sampled
from stabctl.simulation.simulation import run
from stabctl.simulation.trajectory import Trajectory

Status = Literal["found", "unstable_at_zero", "stable_at_limit"]
QUIET = 0.5  # s   before the fault, in which a sampled controller sees the system at rest
PROBES = (0.5, 1.0, 2.0, 4.0)  # cycles above the answer at which monotony is checked
BELOW = 0.5  # cycles below the answer, where it must hold as well: a later swing may be lost between two that are not


class Run(NamedTuple):
    """One simulation of the search."""

    cycles: float
    stable: bool
    outcome: Kind
    machine: int | None  # that went first
    time_s: float  # s   end of the run, from the fault on


def check_observed(seconds: float) -> None:
    """Refuse, with a `StudyError`, a time watched after clearing that is none."""
    if not 0 < seconds < np.inf:
        raise StudyError(f"The observation of {seconds:g} s is not allowed; it must be more than 0.")


@dataclass(frozen=True)
class Trial:
    """A fault and what clears it, to be simulated at clearing times on a grid: the criterion of every study of them.

    Raises `StudyError` for impossible grids, and at the first run for impossible places.
    """

    point: OperatingPoint
    fault: str
    trip: tuple[str, ...] = ()
    control: Law | Sampled | None = None
    resolution_cycles: float = 0.125
    limit_cycles: float = 60.0
    observed_s: float = 5.0  # s   watched after clearing
    step: float | None = None
    criterion: Criterion = DEFAULT
    impedance: complex = 0j  # pu

    def __post_init__(self) -> None:
        if not 0 < self.resolution_cycles <= self.limit_cycles < np.inf:
            raise StudyError(
                f"The resolution of {self.resolution_cycles:g} cycles is not allowed; it must be more than 0 and at "
                f"most the search limit of {self.limit_cycles:g} cycles."
            )
        check_observed(self.observed_s)

    @property
    def at(self) -> float:
        """Instant of the fault, s."""
        return QUIET if isinstance(self.control, Sampled) else 0.0

    @property
    def last(self) -> int:
        """The last point of the grid."""
        return int(np.floor(self.limit_cycles / self.resolution_cycles + 1e-9))

    def cleared(self, k: int) -> float:
        """Instant (s) of clearing at the grid's point k."""
        return self.at + k * self.resolution_cycles / self.point.case.frequency_hz

    def simulate(self, k: int, record: bool = False) -> Trajectory:
        """The run cleared at the grid's point k, from the start until the observation ends."""
        clear = k * self.resolution_cycles / self.point.case.frequency_hz
        happens = Contingency(self.fault, clear, self.trip, at=self.at, impedance=self.impedance)
        until = self.at + clear + self.observed_s
        return run(self.point, happens, until, self.control, self.step, self.criterion, record)


@dataclass(frozen=True)
class Clearing:
    """A critical clearing time, and how it was found."""

    case: str
    fault: str
    trip: tuple[str, ...]
    status: Status
    cycles: float | None  # last stable clearing time on the grid
    seconds: float | None
    resolution_cycles: float
    limit_cycles: float
    observed_s: float  # s   watched after clearing
    monotone: bool  # no longer fault that was tried was survived
    machine: int | None  # goes first just beyond
    runs: tuple[Run, ...]
    wall_s: float

    def __str__(self) -> str:
        what = f"{self.case}, fault {self.fault}" + (f", trip {', '.join(self.trip)}" if self.trip else "")
        watched = f"observed {self.observed_s:g} s after clearing, {len(self.runs)} runs"
        if self.status == "unstable_at_zero":
            first = f"; machine {self.machine} goes first" if self.machine is not None else ""
            return f"{what}: unstable even when cleared at once{first} ({watched})."
        if self.status == "stable_at_limit":
            return f"{what}: stable up to the search limit of {self.limit_cycles:g} cycles ({watched})."
        first = f"; machine {self.machine} goes first beyond" if self.machine is not None else ""
        text = f"{what}: critical clearing time {self.cycles:g} cycles ({self.seconds:.4f} s){first} ({watched})."
        again = [r.cycles for r in self.runs if r.stable and r.cycles > self.cycles]
        return text if self.monotone else f"{text} Stability is not monotone: stable again at {again[0]:g} cycles."


def clearing_time(
    point: OperatingPoint,
    fault: str,
    trip: Iterable[str] = (),
    control: Law | Sampled | None = None,
    resolution_cycles: float = 0.125,
    limit_cycles: float = 60.0,
    observed_s: float = 5.0,
    step: float | None = None,
    criterion: Criterion = DEFAULT,
    impedance: complex = 0j,
    progress: Callable[[Run], None] | None = None,
) -> Clearing:
    """The critical clearing time of a fault, cleared by opening its circuit and those in `trip`.

    By doubling and bisection on multiples of the resolution; at a resolution of a cycle or more, cycle by cycle from
    zero as the paper did. A fault half a cycle shorter must be survived too, and some longer ones are tried to see
    whether stability is monotone.

    Args: operating point (its case's storage acts under `control`, a law or a sampled controller); fault and circuits
    as in `simulate.events`; grid and limit (cycles); time watched after clearing (s); step (s); when a run ends; fault
    impedance (pu); what is told every run. Raises `StudyError` for impossible places or grids.
    """
    trip = tuple(trip)
    trial = Trial(point, fault, trip, control, resolution_cycles, limit_cycles, observed_s, step, criterion, impedance)
    began, runs, last = time.perf_counter(), {}, trial.last

    def survives(k: int) -> bool:
        if k not in runs:
            end = trial.simulate(k).outcome
            runs[k] = Run(k * resolution_cycles, end.stable, end.kind, end.machine, end.time_s - trial.at)
            if progress:
                progress(runs[k])
        return runs[k].stable

    critical, status = _search(survives, last, resolution_cycles)
    if status == "found":
        for cycles in PROBES:
            survives(min(critical + max(1, round(cycles / resolution_cycles)), last))
    beyond = runs.get(0 if status == "unstable_at_zero" else critical + 1)
    return Clearing(
        point.case.name,
        str(fault),
        trip,
        status,
        critical * resolution_cycles if status == "found" else None,
        critical * resolution_cycles / point.case.frequency_hz if status == "found" else None,
        resolution_cycles,
        limit_cycles,
        observed_s,
        not any(r.stable for k, r in runs.items() if k > critical),
        beyond.machine if beyond else None,
        tuple(runs[k] for k in sorted(runs)),
        time.perf_counter() - began,
    )


def _search(survives: Callable[[int], bool], last: int, resolution: float) -> tuple[int, Status]:
    """Last grid point that is survived from zero on, and what it means."""
    if not survives(0):
        return 0, "unstable_at_zero"
    if resolution >= 1:
        first_lost = next((k for k in range(1, last + 1) if not survives(k)), None)
        return (last, "stable_at_limit") if first_lost is None else (first_lost - 1, "found")
    low, high = 0, min(last, max(1, round(4 / resolution)))
    while survives(high):
        if high == last:
            return last, "stable_at_limit"
        low, high = high, min(last, 2 * high)
    held, below = {0, low}, max(1, round(BELOW / resolution))
    while True:
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if survives(middle) else (low, middle)
            held.add(low)
        check = max(low - below, 0)
        if any(check <= k < low for k in held) or survives(check):
            return low, "found"
        low, high = max(k for k in held if k < check), check
