"""Laws measured in contingencies: clearing times and use of the devices, as jobs, each once.

A job finds the clearing time of one law in one contingency. The run cleared at that time shows how the devices are
used; with a law that returns their energy, a long run shows what is left of it in the end.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from stabctl.clearing.critical_time import critical
from stabctl.clearing.result import Status
from stabctl.clearing.trial import Search, Trial
from stabctl.controllers import Law, SampledLaw, StorageLaw
from stabctl.dynamics import storage
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.jobs import Found, Kind, Runner, Task
from stabctl.jobs.task import Base, sha256, text
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import Simulation
from stabctl.simulation.trajectory import Trajectory

COARSE = 4  # points of the fine grid per point of the coarse one
FORMAT = 6
WATCHED = 10.0  # s   after clearing, in which the duty is measured
ACTING = 0.02  # ratings   smaller orders count as none
LAST = 0.5  # s   over which the final voltage is averaged
SAMPLED = 0.25  # s   between the energies of a long run
AFTER = 10.0  # s   watched beyond the time in which they shall have their energy back


class Duty(NamedTuple):
    """Energy, switching and side effects of the storage in one run.

    Attributes
    ----------
    energy_kwh
        Range of the energy of every device, summed.
    switchings
        Largest number of sign changes of an order within one swing of its machine: between two instants at which the
        speed of the machine rises above that of the others.
    coi_hz
        Largest deviation of the speed of the center of inertia.
    voltage
        Lowest bus voltage at the end, pu, of buses that were energized.
    """

    energy_kwh: float
    switchings: int
    coi_hz: float
    voltage: float


class Later(NamedTuple):
    """The system and its devices long after a contingency.

    Attributes
    ----------
    stable
        Whether the system remained stable.
    energy_kwh
        Range of the energy of every device, summed.
    left_kwh
        How far the devices are then from their initial energy, summed.
    """

    stable: bool
    energy_kwh: float
    left_kwh: float


class Measured(NamedTuple):
    """What a law reaches in one contingency."""

    reach: float  # cycles   critical clearing time; 0 if unstable at once, the longest one tried if stable there
    status: Status
    machine: int | str | None  # that loses synchronism first just beyond
    runs: int
    duty: Duty  # cleared at the critical time
    later: Later | None  # the same, if the law returns the energy

    @property
    def energy_kwh(self) -> float:
        """Energy that the devices use."""
        return max(self.duty.energy_kwh, self.later.energy_kwh if self.later else 0.0)


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
        """What laws (None: idle devices) reach in contingencies, measured once each.

        On the coarse grid, the return of the energy is not watched.
        """
        missing = [c for c in dict.fromkeys(cases) if (*c, search) not in self._known]
        within = 0.0 if search == self.coarse else self._within_s
        jobs = [Measurement(*c, search, self._near(*c), within) for c in missing]
        tasks = [measurement_task(job, self._base, self._runner.remote) for job in jobs]
        for done, row in self._runner.rows(tasks):
            self._known[done.job.law, done.job.contingency, search] = from_row(row)
            if self._progress:
                self._progress(len(self._known))
        return [self._known[*case, search] for case in cases]

    def _near(self, law: Law | None, contingency: Contingency) -> float | None:
        """A clearing time (cycles) near the answer: that of another search."""
        known = (self._known.get((law, contingency, search)) for search in (self.fine, self.coarse))
        return next((m.reach for m in known if m and m.reach), None)


class Measurement(NamedTuple):
    """What is measured: a law (None: idle devices) in a contingency, by a search that begins near a clearing time."""

    law: Law | None
    contingency: Contingency
    search: Search
    near: float | None  # cycles
    within_s: float  # s   after which the energy of the devices shall be back; 0: not watched

    def given(self) -> dict[str, Any]:
        """Column -> value."""
        study = text([self.search, self.near, self.within_s])
        return {"law": text(self.law), "contingency": text(self.contingency), "search": study}


def measurement_task(job: Measurement, base: Base, identified: bool) -> Task:
    """The task of a measurement; unless `identified`, its key says nothing about the case."""
    case = base.fingerprint if identified else ""
    return Task(sha256({"format": FORMAT, "job": job.given(), "case": case}), job, base, LAW)


def from_row(row: dict[str, Any]) -> Measured:
    """What a row of the store holds."""
    machine, use, after = json.loads(row["rest"])
    later = None if after is None else Later(*after)
    return Measured(row["reach_cycles"], row["outcome"], machine, row["runs"], Duty(*use), later)


def run_measurement(task: Task) -> Found:
    """Measure a law."""
    job, point = task.job, task.shared.point
    search = job.search
    start = None if job.near is None else (round(job.near / search.resolution_cycles) + 1, 1)
    found = critical(Trial(point, job.contingency, job.law, search), start)
    k = min(round(found.reach_cycles / search.resolution_cycles), search.last)
    watched = Trial(point, job.contingency, job.law, replace(search, observed_s=WATCHED, longest_s=0.0))
    use = duty(watched.simulate(k, record=True))
    after = later(watched, k, job.within_s) if job.within_s and _returns(job.law) else None
    runs = len(found.runs) + (start is None) + 1 + (after is not None)  # of the search, its first guess, and the duty
    values = {"reach_cycles": found.reach_cycles, "outcome": found.status, "runs": runs}
    return Found(values | {"rest": json.dumps([found.machine, use, after])})


def _returns(law: Law | None) -> bool:
    """Whether a law returns the energy of the devices."""
    inner = law.law if isinstance(law, SampledLaw) else law
    return isinstance(inner, StorageLaw) and inner.return_time > 0


def duty(run: Trajectory) -> Duty:
    """The duty of the storage devices in a recorded run; zero energy and no switchings without devices."""
    a, case = run.arrays, run.point.case
    coi = case.frequency_hz * np.abs(a.coi_speed - a.coi_speed[0]).max()
    energy = 1e3 * float(np.ptp(a.energy, axis=0).sum())
    voltage = np.abs(a.V[run.time >= run.time[-1] - LAST]).mean(axis=0)
    return Duty(energy, _switchings(run), float(coi), float(voltage[np.abs(a.V[0]) > 0].min()))


def _switchings(run: Trajectory) -> int:
    a, H, names = run.arrays, run.point.inertia, run.point.rotor_names
    most = 0
    for j, device in enumerate(run.point.case.storage):
        called = run.point.case.machine(device.machine).called
        if called not in names:
            continue
        i = names.index(called)
        w = a.speed[:, i] - (a.speed @ H - a.speed[:, i] * H[i]) / (H.sum() - H[i])
        w = w - w[0]
        rises = np.flatnonzero((w[:-1] <= 0) & (w[1:] > 0)) + 1
        sign = np.sign(np.where(np.abs(a.order[:, j]) > ACTING, a.order[:, j], 0.0))
        acts = np.flatnonzero(sign)
        changes = acts[1:][sign[acts[1:]] != sign[acts[:-1]]]
        swings = np.histogram(changes, [0, *rises.tolist(), len(w)])[0]
        most = max(most, int(swings.max(initial=0)))
    return most


def later(trial: Trial, k: int, within_s: float) -> Later:
    """What is left some time after a contingency, cleared at the grid's point k; it is watched a little longer.

    Raises
    ------
    TypeError
        If the control of the trial needs what is called from outside at frames.
    """
    if trial.setup.parts.pilots or trial.setup.parts.controllers:
        raise TypeError("only a law of the storage devices is watched for long")
    simulation = Simulation(trial.setup, trial.events(k), record=False)
    at = storage.places(trial.point.system, trial.point.case).energy
    end, kwh = trial.last_event(k) + within_s, trial.point.case.base_mva / 3.6
    found = [simulation.s[at] * kwh]
    while simulation.time < end - 1e-9 and simulation.advance(min(simulation.time + SAMPLED, end)):
        found.append(simulation.s[at] * kwh)
    simulation.advance(end + AFTER)
    left = np.abs(found[-1] - found[0]).sum()
    return Later(simulation.finish().outcome.stable, float(np.ptp(found, axis=0).sum()), float(left))


LAW = Kind(
    "law",
    {"law": str, "contingency": str, "search": str},
    {"reach_cycles": float, "outcome": str, "runs": int, "rest": str},
    run_measurement,
    FORMAT,
)
