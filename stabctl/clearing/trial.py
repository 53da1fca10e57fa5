"""One contingency simulated at clearing times on a grid: how it is searched, and how each run is judged.

A single fault, a screen and a siting study share the record of the search. How far beyond stability an unstable run was
is its margin after the single-machine-equivalent (SIME) method.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl._util.units import cycles, seconds
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model.case import Case
from stabctl.simulation.contingency import Contingency, Disturbance
from stabctl.simulation.control import Control, acting
from stabctl.simulation.criterion import DEFAULT, Criterion, checked
from stabctl.simulation.events import Event, Fault
from stabctl.simulation.outcome import Kind
from stabctl.simulation.recording import Recorded
from stabctl.simulation.setup import Setup, setup
from stabctl.simulation.simulation import run_of
from stabctl.simulation.swings import Swings, group
from stabctl.simulation.trajectory import Trajectory

if TYPE_CHECKING:  # pydantic, which reads criteria, is imported where there are some
    from stabctl.judgment import Criteria, Judged, Violation

LONGEST_SCAN = 600.0  # cycles
AUTO = "auto"  # a scan of `BELOW`, as the swings of the answer demand, and of `ABOVE`
BELOW, ABOVE = 2.0, 4.0  # cycles
SPACING = 0.125  # cycles between the faults of a scan, and between those tried first on a finer grid
HALF = 0.5  # cycles   between an answer and the one shorter fault that is always tried
QUIET = 0.5  # s   before the fault, in which a sampled controller sees the system in steady state
SUSTAINED = 0.45  # first guess, as a share of the time an uncleared fault takes to cause loss of synchronism


class Scan(NamedTuple):
    """Other faults to be tried on one side of an answer."""

    spacing: int  # points of the grid
    number: int


NO_SCAN = Scan(1, 0)


@dataclass(frozen=True)
class Search:
    """The grid of clearing times and the criterion by which each is judged, in cycles and seconds.

    Raises `StudyError` for a grid without points or an empty observation window.
    """

    resolution_cycles: float = 0.125
    limit_cycles: float = 60.0
    observed_s: float = 5.0  # s   observed after the last event
    step: float | None = None  # s
    criterion: Criterion = DEFAULT
    scan_cycles: float | None = None  # range below the answer in which others are tried; None: as its swings demand
    above_cycles: float = 0.0  # the same above it
    longest_s: float = 0.0  # s   observed at most, while the swings have not settled; if less than `observed_s`: never
    criteria: "Criteria | None" = None  # that a run must keep to count as stable

    def __post_init__(self) -> None:
        if not 0 < self.resolution_cycles <= self.limit_cycles < math.inf:
            raise StudyError(
                f"The resolution of {self.resolution_cycles:g} cycles is not allowed; it must be more than 0 and at "
                f"most the search limit of {self.limit_cycles:g} cycles."
            )
        if not 0 < self.observed_s < math.inf:
            raise StudyError(f"The observation window of {self.observed_s:g} s is not allowed; it must be more than 0.")
        if not 0 <= self.longest_s < math.inf:
            raise StudyError(f"The longest observation of {self.longest_s:g} s is not allowed; give at least 0.")
        if not 0 <= self.range_cycles <= LONGEST_SCAN:
            raise StudyError(
                f"The scan of {self.range_cycles:g} cycles is not allowed; give 0 to {LONGEST_SCAN:g} cycles."
            )

    @classmethod
    def of(
        cls,
        case: Case,
        *,
        resolution: Any = "0.125cyc",
        limit: Any = "60cyc",
        observe: Any = "5s",
        step: Any = None,
        criterion: Criterion = DEFAULT,
        scan: Any = AUTO,
        longest: Any = 0.0,
        keeping: "Criteria | str | Path | None" = None,
    ) -> "Search":
        """The search with quantities as a user gives them: text with a unit, or seconds; criteria by name or file."""
        hz = case.frequency_hz
        grid, last = cycles(resolution, hz), cycles(limit, hz)
        h = None if step is None else seconds(step, hz)
        last = math.floor(last / grid + 1e-9) * grid if 0 < grid <= last < math.inf else last  # a point of the grid
        observed, most, rules = seconds(observe, hz), seconds(longest, hz), checked(criterion, hz)
        reach = None if scan == AUTO else cycles(scan, hz)
        found = cls(grid, last, observed, h, rules, scan_cycles=reach, longest_s=most)
        if keeping is None:
            return found
        from stabctl.judgment import criteria

        kept = criteria(keeping)
        kept.check(case)
        return replace(found, criteria=kept)

    @property
    def range_cycles(self) -> float:
        """Range below the answer in which others are tried, if they are."""
        return BELOW if self.scan_cycles is None else self.scan_cycles

    def scan(self, reach: float) -> Scan:
        """The faults tried on one side of the answer, over a range in cycles."""
        spacing = self.points(SPACING)
        return Scan(spacing, math.ceil(reach / (spacing * self.resolution_cycles) - 1e-9))

    def shorter(self) -> dict[str, Any]:
        """Which shorter faults are tried, for `last_stable`: one rule for every study of clearing times."""
        half, wide = Scan(self.points(HALF), 1), self.scan(self.range_cycles)
        if self.scan_cycles is None:
            return {"always": half, "lasting": wide, "coarse": wide.spacing}
        return {"always": wide, "coarse": wide.spacing} if wide.number else {"always": half}

    @property
    def last(self) -> int:
        """The last point of the grid; the first is 0."""
        return math.floor(self.limit_cycles / self.resolution_cycles + 1e-9)

    def points(self, length_cycles: float) -> int:
        """A length in points of the grid, at least 1."""
        return max(1, round(length_cycles / self.resolution_cycles))


class Margin(NamedTuple):
    """Energies of the single-machine equivalent of an unstable run, pu s on the system base."""

    excess: float  # left where deceleration ends: minus the margin of SIME, zero in the critical run
    given: float  # its maximum since clearing


class Run(NamedTuple):
    """One simulation of a search."""

    cycles: float  # clearing time
    stable: bool  # and the criteria kept, if there are any
    outcome: Kind
    machine: int | str | None  # that lost synchronism first
    time_s: float  # s   end of the run, from the fault on
    margin: Margin | None = None  # of an unstable run
    swings: Swings | None = None  # the last ones of a stable run
    observed_s: float = 0.0  # s   simulated after the last event
    stalled: tuple[int, ...] = ()  # buses whose motor loads have stalled at the end
    bus: int | None = None  # whose voltage collapsed
    violated: "Violation | None" = None  # the first of the criteria, its instant from the fault on; not if unstable
    undecided: str = ""  # what of the criteria it was too short for
    cut_off: str = ""  # what the switching has separated or blacked out, as a sentence


@dataclass(frozen=True)
class Trial:
    """A contingency at an operating point under a control law; its own clearing time is ignored.

    The fault begins at 0, under a sampled controller after `QUIET` s, and where the control has instants of its own
    (`Acting.timed`) at that of the contingency; other events keep their time from the fault.
    Raises `StudyError` without a fault or a rotor, and at the first run for what the case does not have.
    """

    point: OperatingPoint
    contingency: Contingency
    control: Control = None
    search: Search = field(default_factory=Search)

    def __post_init__(self) -> None:
        if self.contingency.fault is None:
            raise StudyError(f"{self.contingency} has no fault, so it has no clearing time; give one with a fault.")
        if not len(self.point.rotors.unit):
            raise StudyError(
                f"{self.point.case.name} has no machine or grid-forming converter, so loss of synchronism is not "
                "detected and there is no clearing time; add one, or use simulate."
            )

    @cached_property
    def setup(self) -> Setup:
        """The system with its control, which all runs share."""
        return setup(self.point, self.control, step=self.search.step, criterion=self.search.criterion)

    def of(self, contingency: Contingency) -> "Trial":
        """The same for another contingency, with the same set-up."""
        new = replace(self, contingency=contingency)
        vars(new)["setup"] = self.setup
        return new

    @cached_property
    def others(self) -> tuple[Event, ...]:
        """The other events, their instants (s) from the fault on."""
        case = self.point.case
        starts = self.contingency.starts(case)
        return tuple(replace(e, at=e.at - starts) for e in self.contingency.others(case))

    @cached_property
    def at(self) -> float:
        """Instant of the fault, s: late enough for events before it."""
        parts = acting(self.control)
        if parts.timed:
            return self.contingency.starts(self.point.case)
        before = -min((e.at for e in self.others), default=0.0)
        return max(before, 0.0) + (QUIET if parts.pilots else 0.0)

    def duration(self, k: int) -> float:
        """Duration (s) of the fault at the grid's point k."""
        return k * self.search.resolution_cycles / self.point.case.frequency_hz

    def cleared(self, k: int) -> float:
        """Instant (s) of clearing at the grid's point k."""
        return self.at + self.duration(k)

    def last_event(self, k: int) -> float:
        """Instant (s) of the last event at the grid's point k."""
        return max([self.cleared(k), *(e.at for e in self.events(k))])

    def simulate(self, k: int, record: Recorded = False) -> Trajectory:
        """The run cleared at the grid's point k, until the observation after the last event ends."""
        last, how = self.last_event(k), self.search
        return run_of(self.setup, self.events(k), last + how.observed_s, record=record, longest=last + how.longest_s)

    @cached_property
    def placed(self) -> Contingency:
        """The contingency with records of the case's buses and circuits."""
        return self.contingency.placed(self.point.case)

    def events(self, k: int) -> list[Event]:
        """The fault cleared at the grid's point k, and what else happens."""
        other = (replace(e, at=e.at + self.at) for e in self.others)
        return [*self.placed.lasting(self.duration(k), self.at), *other]

    def attempt(self, k: int) -> Run:
        """What the run cleared at the grid's point k shows."""
        ran, violated, undecided = self.judged(k)
        end, cycles = ran.outcome, k * self.search.resolution_cycles
        return Run(
            cycles,
            end.stable and violated is None,
            end.kind,
            end.machine,
            end.time_s - self.at,
            margin=None if end.stable else margin(ran, self.cleared(k)),
            swings=end.swings,
            observed_s=end.time_s - self.last_event(k),
            stalled=end.stalled,
            bus=end.bus,
            violated=violated,
            undecided=undecided,
            cut_off=end.cut_off,
        )

    def judged(self, k: int) -> tuple[Trajectory, "Violation | None", str]:
        """The run cleared at the grid's point k, its first violation of the criteria, and for what it is too short."""
        record: Recorded = self.search.criteria is not None or "rotors"
        ran, found = observed(self.setup, self.events(k), self.last_event(k), self.search, record)
        if found is None:
            return ran, None, ""
        first = min(found.violations, key=lambda one: one.from_s, default=None) if ran.outcome.stable else None
        first = first and first._replace(from_s=first.from_s - self.at)
        return ran, first, "".join(found.undecided[:1])

    def guess(self) -> int:
        """Point of the grid near the answer: a share of the time to loss of synchronism, fault uncleared."""
        hz, search = self.point.case.frequency_hz, self.search
        longest = min(search.limit_cycles / SUSTAINED / hz, search.observed_s)
        fault = Fault(self.placed.fault or "", self.at, self.contingency.impedance)
        end = run_of(self.setup, [fault], self.at + longest, record=False).outcome
        cycles = search.limit_cycles / SUSTAINED if end.stable else (end.time_s - self.at) * hz
        return int(SUSTAINED * cycles / search.resolution_cycles)


def observed(
    system: Setup, what: Disturbance, last: float, search: Search, record: Recorded = True, late: bool = False
) -> "tuple[Trajectory, Judged | None]":
    """A run as a search observes it after its last event (s), and how it keeps the criteria, if there are any.

    It goes on while the swings have not settled. A run that keeps the criteria but is too short for some of them is
    repeated with the longest observation; with `late` every run that keeps them is.
    """
    longest = last + search.longest_s
    ran = run_of(system, what, last + search.observed_s, record=record, longest=longest)
    if search.criteria is None:
        return ran, None
    from stabctl.judgment import judge

    found = judge(ran, search.criteria)
    if found.kept and (found.undecided or late) and search.longest_s > search.observed_s:
        ran = run_of(system, what, longest, record=record)
        found = judge(ran, search.criteria)
    return ran, found


def margin(trajectory: Trajectory, cleared_s: float) -> Margin | None:
    """The margin of a recorded unstable run that was cleared at an instant (s).

    The machines fall into two groups at the widest gap between their angles at the end; each group is one machine in
    its center of inertia, and the two are one of M = M_S M_N / (M_S + M_N) with the difference w of their speeds. The
    excess is M w_u^2 / 2 at the last minimum of w, where the accelerating power turns positive again, or at the end
    where voltages collapse before that (Pavella, Ernst, Ruiz-Vega, "Transient Stability of Power Systems: A Unified
    Approach to Assessment and Control", 2000). A run that returned and was lost in a later swing has none. `None` of a
    run without deceleration, of one that left the frequency range, and of one in which a phase-locked loop or storage
    lost synchronism: they say nothing about the distance.
    """
    after = trajectory.time > cleared_s - 1e-9
    if trajectory.outcome.machine not in (None, *trajectory.point.rotor_names):  # a phase-locked loop, or storage
        return None
    if trajectory.outcome.kind is Kind.FREQUENCY_INSTABILITY or after.sum() < 3 or trajectory.arrays.angle.shape[1] < 2:
        return None
    w, M = _equivalent(trajectory)
    if not M:
        return None
    w = w[after]
    falling = np.flatnonzero(np.diff(w) <= 0)
    if not len(falling):
        return None
    at = falling[-1] + 1
    if at == len(w) - 1 and trajectory.outcome.kind is not Kind.VOLTAGE_COLLAPSE:
        return None
    if w[at] < 0:
        return None
    return Margin(M * w[at] ** 2 / 2, M * w[:at].max() ** 2 / 2)


def _equivalent(trajectory: Trajectory) -> tuple[np.ndarray, float]:
    """Speed (rows, pu) of the machines that are lost against the others of their island, and inertia (s) of the two.

    The inertia is 0 if there are no others.
    """
    point, end = trajectory.point, trajectory.arrays.swing[-1]
    numbers, machine = point.rotor_names, trajectory.outcome.machine
    lost = numbers.index(machine) if machine in numbers else int(end.argmax())
    mine = point.rotor_island == point.rotor_island[lost]
    side = group(end, lost, mine)
    S, N = (np.where(of, point.inertia, 0.0) for of in (side, mine & ~side))
    w = trajectory.arrays.speed @ (S / S.sum() - N / (N.sum() or 1.0))
    return w, float(2 * S.sum() * N.sum() / (S + N).sum())
