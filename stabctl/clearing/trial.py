"""One contingency simulated at clearing times on a grid: how every study of clearing times judges them."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control, acting
from stabctl.simulation.events import Event, Fault
from stabctl.simulation.outcome import Kind
from stabctl.simulation.recording import Recorded
from stabctl.simulation.simulation import run
from stabctl.simulation.swings import Swings
from stabctl.simulation.trajectory import Trajectory

from .margin import Margin, margin
from .search import Search

QUIET = 0.5  # s   before the fault, in which a sampled controller sees the system in steady state
SUSTAINED = 0.45  # first guess, as a share of the time an uncleared fault takes to cause loss of synchronism


class Run(NamedTuple):
    """One simulation of a search."""

    cycles: float  # clearing time
    stable: bool
    outcome: Kind
    machine: int | str | None  # that lost synchronism first
    time_s: float  # s   end of the run, from the fault on
    margin: Margin | None = None  # of an unstable run
    swings: Swings | None = None  # the last ones of a stable run
    observed_s: float = 0.0  # s   simulated after the last event
    stalled: tuple[int, ...] = ()  # buses whose motor loads have stalled at the end


@dataclass(frozen=True)
class Trial:
    """A contingency at an operating point under a control law; its own clearing time is ignored.

    The fault begins at 0, under a sampled controller after `quiet` s; other events keep their time from the fault.
    Raises `StudyError` without a fault or a rotor, and at the first run for what the case does not have.
    """

    point: OperatingPoint
    contingency: Contingency
    control: Control = None
    search: Search = field(default_factory=Search)
    quiet: float = QUIET  # s

    def __post_init__(self) -> None:
        if self.contingency.fault is None:
            raise StudyError(f"{self.contingency} has no fault, so it has no clearing time; give one with a fault.")
        if not len(self.point.rotors.unit):
            raise StudyError(
                f"{self.point.case.name} has no machine or grid-forming converter, so loss of synchronism is not "
                "detected and there is no clearing time; add one, or use simulate."
            )

    @cached_property
    def others(self) -> tuple[Event, ...]:
        """The other events, their instants (s) from the fault on."""
        case = self.point.case
        starts = self.contingency.starts(case)
        return tuple(replace(e, at=e.at - starts) for e in self.contingency.others(case))

    @cached_property
    def at(self) -> float:
        """Instant of the fault, s: late enough for events before it."""
        before = -min((e.at for e in self.others), default=0.0)
        return max(before, 0.0) + (self.quiet if acting(self.control).pilots else 0.0)

    def duration(self, k: int) -> float:
        """Duration (s) of the fault at the grid's point k."""
        return k * self.search.resolution_cycles / self.point.case.frequency_hz

    def cleared(self, k: int) -> float:
        """Instant (s) of clearing at the grid's point k."""
        return self.at + self.duration(k)

    def last_event(self, k: int) -> float:
        """Instant (s) of the last event at the grid's point k."""
        return max([self.cleared(k), *(e.at + self.at for e in self.others)])

    def simulate(self, k: int, record: Recorded = False) -> Trajectory:
        """The run cleared at the grid's point k, until the observation after the last event ends."""
        last = self.last_event(k)
        return self._run(self.events(k), last + self.search.observed_s, record, last + self.search.longest_s)

    def events(self, k: int) -> list[Contingency | Event]:
        """The contingency cleared at the grid's point k, and what else happens."""
        fault = replace(self.contingency, clear=self.duration(k), at=self.at, events=())
        return [fault, *(replace(e, at=e.at + self.at) for e in self.others)]

    def attempt(self, k: int) -> Run:
        """What the run cleared at the grid's point k shows."""
        ran = self.simulate(k, record="rotors")
        end, cycles = ran.outcome, k * self.search.resolution_cycles
        beyond, observed = None if end.stable else margin(ran, self.cleared(k)), end.time_s - self.last_event(k)
        start = Run(cycles, end.stable, end.kind, end.machine, end.time_s - self.at)
        return start._replace(margin=beyond, swings=end.swings, observed_s=observed, stalled=end.stalled)

    def guess(self) -> int:
        """Point of the grid near the answer: a share of the time to loss of synchronism, fault uncleared."""
        hz, search = self.point.case.frequency_hz, self.search
        longest = min(search.limit_cycles / SUSTAINED / hz, search.observed_s)
        fault = Fault(self.contingency.fault or "", self.at, self.contingency.impedance)
        end = self._run([fault], self.at + longest, record=False).outcome
        cycles = search.limit_cycles / SUSTAINED if end.stable else (end.time_s - self.at) * hz
        return int(SUSTAINED * cycles / search.resolution_cycles)

    def _run(
        self, events: list[Contingency | Event], until: float, record: Recorded, longest: float = 0.0
    ) -> Trajectory:
        options: Any = {"step": self.search.step, "criterion": self.search.criterion, "record": record}
        return run(self.point, events, until, self.control, longest=longest, **options)
