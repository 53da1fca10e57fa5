"""Fleets put to the test: does a fleet of these sizes survive a contingency? Every question is simulated once."""

import copy
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from threading import Event, Lock
from typing import TypeVar

import numpy as np

from stabctl._util import cores
from stabctl.clearing import Search as ClearingSearch
from stabctl.controllers import BangBang, Law
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.simulation import contingency as simulated
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.simulation import Simulation, run
from stabctl.simulation.trajectory import Trajectory

from .contingency import Contingency

DIGITS = 6  # of a size in MW, by which two fleets are the same
T = TypeVar("T")


class Trials:
    """Simulations of the fleets of one operating point, whose case has a device at every candidate.

    Args: the point; what is to be survived; largest sizes (candidates, MW), to which every fleet is cut; the storage
    law; time watched after clearing (s); step (s); when a run ends; threads (one per core); what is told the number of
    runs so far. Raises `StudyError` for fewer than one thread.
    """

    def __init__(
        self,
        point: OperatingPoint,
        contingencies: Sequence[Contingency],
        cap: np.ndarray,
        law: Law | None = None,
        observed_s: float = 5.0,
        step: float | None = None,
        criterion: Criterion = DEFAULT,
        workers: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> None:
        ClearingSearch(observed_s=observed_s)
        self.point, self.contingencies, self.cap, self.law = point, tuple(contingencies), cap, law or BangBang()
        self.observed_s, self.step, self.criterion, self.progress = observed_s, step, criterion, progress
        self._counted, self._lock = [0], Lock()
        self._pool, self._ended = ThreadPoolExecutor(cores.used(workers)), Event()
        self._known: dict[tuple[int, bytes], bool] = {}

    @property
    def simulations(self) -> int:
        """Runs so far, those of trials derived from these included."""
        return self._counted[0]

    def count(self) -> None:
        """One more run; `CancelledError` once the study has ended."""
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
        """Does the fleet (candidates, MW; cut to the caps) survive contingency k?"""
        mw = self.fleet(mw)
        key = (k, np.round(mw, DIGITS).tobytes())
        if key not in self._known:
            self._known[key] = self.run(mw, k, record=False).outcome.stable
        return self._known[key]

    def each(self, ask: Callable[[int], T], which: Iterable[int] | None = None) -> list[T]:
        """What `ask` answers for every contingency, or for these numbers, side by side."""
        try:
            return list(self._pool.map(ask, range(len(self.contingencies)) if which is None else which))
        except BaseException:
            self._ended.set()  # the other threads are in the middle of long searches, for which an exit would wait
            raise

    def lost(self, mw: np.ndarray) -> list[int]:
        """The contingencies that the fleet does not survive."""
        return [k for k, survived in enumerate(self.each(lambda k: self.survives(mw, k))) if not survived]

    def fleets(self, k: int) -> int:
        """Number of fleets that contingency k has been asked about."""
        return sum(asked == k for asked, _ in self._known)

    def only(self, kept: Sequence[int]) -> "Trials":
        """The same for some of the contingencies."""
        chosen = [self.contingencies[k] for k in kept]
        new = self._like(chosen, self.observed_s, self.step)
        new._known = {(kept.index(k), mw): known for (k, mw), known in self._known.items() if k in kept}
        return new

    def refined(self) -> "Trials":
        """The same at half the step, watched twice as long."""
        step = Simulation(self.point, step=self.step, record=False).step / 2
        return self._like(self.contingencies, 2 * self.observed_s, step)

    def _like(self, contingencies: Sequence[Contingency], observed_s: float, step: float | None) -> "Trials":
        new = copy.copy(self)
        new.contingencies, new.observed_s, new.step, new._known = tuple(contingencies), observed_s, step, {}
        return new

    def run(self, mw: np.ndarray, k: int, record: bool = True) -> Trajectory:
        """The run of contingency k with this fleet (candidates, MW)."""
        one = self.contingencies[k]
        events = simulated.Contingency(one.fault, one.clear, one.trip, at=0.0)
        self.count()
        until = one.clear + self.observed_s
        return run(self.point.resized(mw), events, until, self.law, self.step, self.criterion, record)
