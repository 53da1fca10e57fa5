"""Evaluation of storage laws on all cores: clearing times, and the use of the devices."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from stabctl.clearing.search import Search
from stabctl.controllers import Law
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.jobs import Runner
from stabctl.jobs.base import Base
from stabctl.simulation.contingency import Contingency

from . import law_jobs
from .law_jobs import Measured, Measurement

COARSE = 4  # points of the fine grid per point of the coarse one


class Bench:
    """Measures laws at one operating point; what was measured is remembered.

    Parameters
    ----------
    point : OperatingPoint
        The system with its storage.
    search : Search
        How clearing times are searched.
    runner : Runner
        Where this is done.
    within_s : float, s
        Time after which the energy of the devices shall be back; 0: not watched.
    progress : callable, optional
        Called after every measurement with the number so far.
    """

    def __init__(
        self,
        point: OperatingPoint,
        search: Search,
        runner: Runner,
        *,
        within_s: float,
        progress: Callable[[int], None] | None = None,
    ) -> None:
        self.point, self.search = point, search
        self._runner, self._progress, self._base, self._within_s = runner, progress, Base(point), within_s
        self._known: dict[tuple[Law | None, Contingency, Search], Measured] = {}

    @property
    def simulations(self) -> int:
        """Simulations so far."""
        return sum(m.runs for m in self._known.values())

    @property
    def coarse(self) -> Search:
        """The search on a coarse grid, without a scan."""
        return replace(self.search, resolution_cycles=COARSE * self.search.resolution_cycles, scan_cycles=0.0)

    @property
    def fine(self) -> Search:
        """The search without a scan."""
        return replace(self.search, scan_cycles=0.0)

    def measured(self, cases: Sequence[tuple[Law | None, Contingency]], search: Search) -> list[Measured]:
        """What laws (None: idle devices) reach in contingencies, measured once each; coarsely without the return."""
        missing = [c for c in dict.fromkeys(cases) if (*c, search) not in self._known]
        within = 0.0 if search == self.coarse else self._within_s
        jobs = [Measurement(*c, search, self._near(*c), within) for c in missing]
        tasks = [law_jobs.task(job, self._base, self._runner.remote) for job in jobs]
        for done, row in self._runner.rows(tasks):
            self._known[done.job.law, done.job.contingency, search] = law_jobs.measured(row)
            if self._progress:
                self._progress(len(self._known))
        return [self._known[*case, search] for case in cases]

    def _near(self, law: Law | None, contingency: Contingency) -> float | None:
        """A clearing time (cycles) near the answer: that of a coarser search."""
        known = (self._known.get((law, contingency, search)) for search in (self.fine, self.coarse))
        return next((m.reach for m in known if m and m.reach), None)
