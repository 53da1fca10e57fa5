"""Simulations of storage fleets: whether a fleet survives a scenario. Each combination is simulated only once."""

import copy
import json
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from dataclasses import replace
from threading import Event, Lock
from typing import Any, NamedTuple, TypeVar

import numpy as np

from stabctl.clearing import Search
from stabctl.controllers import BangBang
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.jobs import Runner
from stabctl.jobs.task import Base
from stabctl.model import naming
from stabctl.simulation.attached import attached
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control, acting
from stabctl.simulation.setup import setup
from stabctl.simulation.trajectory import Trajectory

from ._simulated import FLEET, CriticalTime, Outcome, Peaks, Shared, Simulated, What, simulate, task, trial
from .contingencies import Scenario, target_cycles, without_fault

FEW = 2  # scenarios simulated before all others
DIGITS = 9  # of a size over its cap; fleets that agree to so many are the same
T = TypeVar("T")


class Question(NamedTuple):
    """What has been simulated: a contingency, the number of the operating point, rounded ratings, in which system."""

    contingency: Contingency
    point: int
    ratings: bytes
    built: bool


class Trials:
    """Simulations of the fleets of a system, whose cases have a storage device at every candidate.

    Parameters
    ----------
    points : OperatingPoint or sequence of OperatingPoint
        The system with its existing storage devices, and after them a device at every candidate.
    scenarios : sequence of Scenario or Contingency
        What must be survived; a contingency stands for itself at the first operating point.
    cap : (candidates,) array, MW
        Largest sizes; larger ones are reduced to them.
    names : sequence of str
        Names of several operating points.
    control : control law, Controller, or list of them, optional
        What acts in every simulation, `BangBang()` by default.
    search : Search
        Observation window, time step and criterion of stability, as for a clearing time.
    workers : int, optional
        Threads, one per core by default.
    runner : Runner, optional
        Where the simulations run and their rows are kept, in place of `workers`; by default in threads.
    progress : callable, optional
        Called with the number of simulations so far.
    """

    def __init__(
        self,
        points: OperatingPoint | Sequence[OperatingPoint],
        scenarios: Sequence[Scenario | Contingency],
        cap: np.ndarray,
        control: Control = None,
        *,
        names: Sequence[str] = (),
        search: Search = Search(),  # noqa: B008
        workers: int | None = None,
        runner: Runner | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> None:
        self.names = tuple(names)
        self.points = (points,) if isinstance(points, OperatingPoint) else tuple(points)
        self.scenarios = tuple(s if isinstance(s, Scenario) else Scenario(s) for s in scenarios)
        self.cap = cap
        existing = self.point.case.storage[: len(self.point.case.storage) - len(cap)]
        self.existing = np.array([s.rating for s in existing])  # MW
        self.control: Control = control or BangBang()
        self.search, self.progress, self.built = search, progress, False
        for point in self.points:
            attached(point, acting(self.control).controllers)  # once, for all fleets
        self._unit = np.where((cap > 0) & np.isfinite(cap), cap, 1.0)  # MW
        self._counted, self._lock = [0], Lock()
        self.runner = runner or Runner(FLEET, workers=workers)
        self._pool, self._ended = ThreadPoolExecutor(self.runner.threads), Event()
        self._bases = tuple(map(Base, self.points))
        self._known: dict[Question, Future[bool]] = {}
        self._losses: Counter[Scenario] = Counter()

    @property
    def point(self) -> OperatingPoint:
        """The first operating point."""
        return self.points[0]

    @property
    def contingencies(self) -> tuple[Contingency, ...]:
        """The contingency of every scenario."""
        return tuple(s.contingency for s in self.scenarios)

    def at(self, k: int) -> OperatingPoint:
        """The operating point of scenario k."""
        return self.points[self.scenarios[k].point]

    def named(self, k: int) -> tuple[str, str]:
        """The operating point of scenario k, if there are several, and the device that is out of service, if any."""
        one = self.scenarios[k]
        return self.names[one.point] if len(self.points) > 1 else "", "" if one.out is None else self._device(one.out)

    def site(self, i: int) -> str:
        """Candidate i as machine@bus."""
        return self._device(len(self.existing) + i)

    def _device(self, row: int) -> str:
        s = self.point.case.storage[row]
        return f"{'existing ' * (row < len(self.existing))}{naming.device(self.point.case, s.machine, s.bus)}"

    @property
    def simulations(self) -> int:
        """Number of simulations so far, including those of trials derived from these."""
        return self._counted[0]

    def ask(
        self, what: What, mw: np.ndarray, k: int, control: Control = None, *, until: float | None = None
    ) -> dict[str, Any]:
        """The row on a fleet (candidates, MW, also above the caps) in scenario k, observed for `until` (s) at most.

        Raises `CancelledError` once the study has ended.
        """
        if self._ended.is_set():
            raise CancelledError
        row = self.runner.ask(task(self._question(what, mw, k, until), self._shared(k, control), self.runner.remote))
        self._count(row["simulations"])
        return row

    def _question(self, what: What, mw: np.ndarray, k: int, until: float | None = None) -> Simulated:
        ratings = tuple(map(float, self.ratings(mw, k)))
        search = self.search
        if until is not None and until < search.observed_s:
            search = replace(search, observed_s=until, longest_s=0.0)
        return Simulated(what, self.scenarios[k].contingency, ratings, self.built and 0.0 in ratings, search, "")

    def _shared(self, k: int, control: Control = None) -> Shared:
        return Shared(self._bases[self.scenarios[k].point], control or self.control)

    def _count(self, simulations: int) -> None:
        with self._lock:
            self._counted[0] += simulations
        if self.progress:
            self.progress(self.simulations)

    def fleet(self, mw: np.ndarray) -> np.ndarray:
        """The sizes (candidates, MW), none above its cap."""
        return np.minimum(mw, self.cap)

    def ratings(self, mw: np.ndarray, k: int) -> np.ndarray:
        """The ratings (devices, MW) of the existing devices and the fleet in scenario k."""
        return np.concatenate([self.existing, mw]) * self._multiples(k)

    def multiple(self, i: int, k: int) -> float:
        """The multiple of its size with which candidate i acts in scenario k: 0 out of service, usually 1."""
        return float(self._multiples(k)[len(self.existing) + i])

    def _multiples(self, k: int) -> np.ndarray:
        one = self.scenarios[k]
        multiples = np.ones(len(self.existing) + len(self.cap))
        if one.scaled is not None:
            row, scale = one.scaled
            multiples[row] = scale
        if one.out is not None:
            multiples[one.out] = 0.0
        return multiples

    def survives(self, mw: np.ndarray, k: int) -> bool:
        """Whether the fleet (candidates, MW; reduced to the caps) survives scenario k."""
        mw = self.fleet(mw)
        scale = np.concatenate([np.ones(len(self.existing)), self._unit])
        one = self.scenarios[k]
        ratings = np.round(self.ratings(mw, k) / scale, DIGITS)
        key = Question(one.contingency, one.point, ratings.tobytes(), self.built and 0.0 in ratings)
        with self._lock:
            new = key not in self._known
            answer = self._known.setdefault(key, Future())
        if new:
            try:
                answer.set_result(bool(self.ask("outcome", mw, k)["stable"]))
            except BaseException as error:
                answer.set_exception(error)
            with self._lock:
                self._losses[one] += answer.exception() is None and not answer.result()
        return answer.result()

    def outcome(self, mw: np.ndarray, k: int, until: float | None = None) -> Outcome:
        """The simulation of scenario k with this fleet (candidates, MW, also above the caps), for `until` s at most."""
        row = self.ask("outcome", mw, k, until=until)
        return Outcome(bool(row["stable"]), json.loads(row["machine"]), np.array(json.loads(row["values"])))

    def peaks(self, mw: np.ndarray, k: int) -> Peaks:
        """The largest angles in scenario k with this fleet (candidates, MW, also above the caps), and when."""
        row = self.ask("peak", mw, k)
        return Peaks(bool(row["stable"]), *np.array(json.loads(row["values"])))

    def energy(self, mw: np.ndarray, k: int) -> np.ndarray:
        """The range of the charge (candidates, MWh) in scenario k with this fleet (candidates, MW)."""
        return np.array(json.loads(self.ask("energy", mw, k)["values"]))[len(self.existing) :]

    def currents(self, mw: np.ndarray, k: int) -> np.ndarray:
        """The largest currents, and the lowest voltages with them (2, candidates; pu), in scenario k with a fleet."""
        return np.array(json.loads(self.ask("currents", mw, k)["values"]))[:, len(self.existing) :]

    def critical_time(self, mw: np.ndarray, k: int, control: Control = None) -> CriticalTime:
        """The critical clearing time of scenario k with a fleet (candidates, MW), also under another control."""
        row = self.ask("critical time", self.fleet(mw), k, control)
        stable, machine, growing = bool(row["stable"]), json.loads(row["machine"]), bool(row["growing"])
        return CriticalTime(row.get("cycles"), stable, machine, growing, row.get("longest"))

    def each(self, ask: Callable[[int], T], which: Iterable[int] | None = None) -> list[T]:
        """The results of `ask` for every scenario, or for these numbers, in parallel."""
        try:
            return list(self._pool.map(ask, range(len(self.scenarios)) if which is None else which))
        except BaseException:
            self._ended.set()  # the other threads may be in long searches, which would delay the exit
            raise

    def lost(self, mw: np.ndarray) -> list[int]:
        """The scenarios that the fleet does not survive."""
        return [k for k, survived in enumerate(self.each(lambda k: self.survives(mw, k))) if not survived]

    def all_survived(self, mw: np.ndarray) -> bool:
        """Whether the fleet survives every scenario; the few that were lost most often are simulated first."""
        often = sorted(range(len(self.scenarios)), key=lambda k: -self._losses[self.scenarios[k]])
        return all(all(self.each(lambda k: self.survives(mw, k), some)) for some in (often[:FEW], often[FEW:]))

    def fleets(self, k: int) -> int:
        """Number of fleets tried against scenario k."""
        one = self.scenarios[k]
        return sum((asked.contingency, asked.point) == (one.contingency, one.point) for asked in self._known)

    def only(self, kept: Sequence[int]) -> "Trials":
        """The same for some of the scenarios."""
        return self.among(self.scenarios[k] for k in kept)

    def among(self, scenarios: Iterable[Scenario]) -> "Trials":
        """The same for other scenarios."""
        new = copy.copy(self)
        new.scenarios = tuple(scenarios)
        return new

    def of(self, mw: np.ndarray) -> "Trials":
        """The same without the outages of devices that a fleet (candidates, MW) does not have."""
        empty = {len(self.existing) + i for i in np.flatnonzero(mw == 0)}
        return self.only([k for k, one in enumerate(self.scenarios) if one.out not in empty])

    def alone(self) -> "Trials":
        """The same in the system that is built, without the devices of 0 MW."""
        new = copy.copy(self)
        new.built = True
        return new

    def longer(self) -> "Trials":
        """The same with twice the observation window."""
        new = copy.copy(self)
        new.search, new._known = replace(self.search, observed_s=2 * self.search.observed_s), {}
        new._losses = Counter(self._losses)
        return new

    def refined(self) -> "Trials":
        """The same with half the time step and twice the observation window."""
        new = self.longer()
        new.search = replace(new.search, step=setup(self.point, step=self.search.step).step / 2)
        return new

    def target(self, k: int) -> float | None:
        """Clearing time of scenario k to be survived, in cycles; None without a fault."""
        return target_cycles(self.scenarios[k].contingency, self.point.case)

    def simulate(self, mw: np.ndarray, k: int) -> Trajectory:
        """The recorded simulation of scenario k with this fleet (candidates, MW, also above the caps)."""
        self._count(1)
        return simulate(self._question("outcome", mw, k), self._shared(k), record=True)[0]

    def disturbed(self, k: int) -> float:
        """Instant (s) in `simulate` of the clearing of the fault, or of the last event without one."""
        one = self.scenarios[k].contingency
        if one.fault is None:
            return without_fault(one, self.at(k).case, self._shared(k).control)[1]
        return trial(self._question("outcome", self.cap, k), self._shared(k)).cleared(1)
