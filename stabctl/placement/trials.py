"""Simulations of storage fleets: whether a fleet survives a contingency. Each combination is simulated only once."""

import copy
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import replace
from threading import Event, Lock
from typing import TypeVar

import numpy as np

from stabctl._util import cores
from stabctl.clearing import Search, Trial
from stabctl.controllers import BangBang, Law
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control
from stabctl.simulation.simulation import Simulation
from stabctl.simulation.trajectory import Trajectory

from .contingencies import target_cycles

DIGITS = 9  # of a size over its cap; fleets that agree to so many are the same
T = TypeVar("T")


class Trials:
    """Simulations of the fleets of one operating point, whose case has a storage device at every candidate.

    Parameters
    ----------
    point : OperatingPoint
        The system with a device at every candidate.
    contingencies : sequence of Contingency
        What must be survived.
    cap : (candidates,) array, MW
        Largest sizes; larger ones are reduced to them.
    control : control law, optional
        Control law of the devices, `BangBang()` by default.
    search : Search
        Observation window, time step and criterion of stability, as for a clearing time.
    workers : int, optional
        Threads, one per core by default.
    progress : callable, optional
        Called with the number of simulations so far.
    """

    def __init__(
        self,
        point: OperatingPoint,
        contingencies: Sequence[Contingency],
        cap: np.ndarray,
        control: Law | None = None,
        *,
        search: Search = Search(),  # noqa: B008
        workers: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> None:
        self.point, self.contingencies, self.cap = point, tuple(contingencies), cap
        self.control, self.search, self.progress = control or BangBang(), search, progress
        self._unit = np.where((cap > 0) & np.isfinite(cap), cap, 1.0)  # MW
        self._counted, self._lock = [0], Lock()
        self._pool, self._ended = ThreadPoolExecutor(cores.used(workers)), Event()
        self._known: dict[tuple[int, bytes], bool] = {}

    @property
    def simulations(self) -> int:
        """Number of simulations so far, including those of trials derived from these."""
        return self._counted[0]

    def count(self) -> None:
        """Count a simulation; raises `CancelledError` once the study has ended."""
        if self._ended.is_set():
            raise CancelledError
        with self._lock:
            self._counted[0] += 1
        if self.progress:
            self.progress(self.simulations)

    def fleet(self, mw: np.ndarray) -> np.ndarray:
        """The sizes (candidates, MW), none above its cap."""
        return np.minimum(mw, self.cap)

    def survives(self, mw: np.ndarray, k: int) -> bool:
        """Whether the fleet (candidates, MW; reduced to the caps) survives contingency k."""
        mw = self.fleet(mw)
        key = (k, np.round(mw / self._unit, DIGITS).tobytes())
        if key not in self._known:
            self._known[key] = self.simulate(mw, k, record=False).outcome.stable
        return self._known[key]

    def each(self, ask: Callable[[int], T], which: Iterable[int] | None = None) -> list[T]:
        """The results of `ask` for every contingency, or for these numbers, in parallel."""
        try:
            return list(self._pool.map(ask, range(len(self.contingencies)) if which is None else which))
        except BaseException:
            self._ended.set()  # the other threads may be in long searches, which would delay the exit
            raise

    def lost(self, mw: np.ndarray) -> list[int]:
        """The contingencies that the fleet does not survive."""
        return [k for k, survived in enumerate(self.each(lambda k: self.survives(mw, k))) if not survived]

    def fleets(self, k: int) -> int:
        """Number of fleets tried against contingency k."""
        return sum(asked == k for asked, _ in self._known)

    def only(self, kept: Sequence[int]) -> "Trials":
        """The same for some of the contingencies."""
        new = self._like([self.contingencies[k] for k in kept], self.search)
        new._known = {(kept.index(k), mw): known for (k, mw), known in self._known.items() if k in kept}
        return new

    def refined(self) -> "Trials":
        """The same with half the time step and twice the observation window."""
        step = Simulation(self.point, step=self.search.step, record=False).step / 2
        return self._like(self.contingencies, replace(self.search, observed_s=2 * self.search.observed_s, step=step))

    def _like(self, contingencies: Sequence[Contingency], search: Search) -> "Trials":
        new = copy.copy(self)
        new.contingencies, new.search, new._known = tuple(contingencies), search, {}
        return new

    def target(self, k: int) -> float:
        """Clearing time of contingency k to be survived, in cycles."""
        return target_cycles(self.contingencies[k], self.point.case)

    def trial(self, mw: np.ndarray, k: int, control: Control = None, grid: float | None = None) -> Trial:
        """Contingency k with this fleet (candidates, MW, also above the caps) at multiples of `grid`, or its target."""
        target = self.target(k)
        limit = max(self.search.limit_cycles, 2 * target)
        search = replace(self.search, resolution_cycles=grid or target, limit_cycles=limit)
        return Trial(self.point.resized(mw), self.contingencies[k], control or self.control, search)

    def simulate(self, mw: np.ndarray, k: int, record: bool = True) -> Trajectory:
        """The simulation of contingency k with this fleet (candidates, MW, also above the caps)."""
        self.count()
        return self.trial(mw, k).simulate(1, record)
