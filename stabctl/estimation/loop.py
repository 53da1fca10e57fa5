"""The estimator in the loop: PMU frames, estimates, deviations from the COI of the rest, orders, held for a frame.

Simulation -> V, I -> Instrument -> Estimator -> Center -> law -> orders -> Simulation
(true)        noise, loss, delay    s, ds/dt     own - rest        (one frame)
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from stabctl.controllers import BangBang, Device, Law, Seen, order
from stabctl.dynamics.operating_point import Point
from stabctl.simulation.contingency import Happenings, schedule
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.sampled import carry
from stabctl.simulation.simulation import Simulation

from .coi import Center
from .estimators import Engine, Filtered, Kind, estimator
from .machines import Terminals, machines
from .noise import TUNING, Tuning
from .pmu import Instrument, Pmu
from .record import Record

WARM = 1.0  # s   of the system at rest before the first frame


@dataclass(frozen=True)
class Driven:
    """A storage law driven by an estimator at the PMU rate; a `simulate.sampled.Sampled` controller.

    `inertia` and `reactance` multiply every H and x that the estimator believes in.
    """

    law: Law = field(default_factory=BangBang)
    kind: Kind = "kalman"
    pmu: Pmu = field(default_factory=Pmu)
    seed: int = 1
    engine: Engine = "filterpy"
    tuning: Tuning = TUNING
    inertia: float = 1.0
    reactance: float = 1.0

    @property
    def rate(self) -> int:
        """Frames per second."""
        return self.pmu.rate

    def pilot(self, simulations: Sequence[Simulation]) -> "Pilot":
        """The controller at work on one simulation, with its seed."""
        return Pilot(self, simulations, range(self.seed, self.seed + len(simulations)))


class Pilot:
    """A controller at work on simulations of one operating point, each with the errors of its seed."""

    def __init__(self, driven: Driven, simulations: Sequence[Simulation], seeds: Sequence[int]) -> None:
        point = simulations[0].point
        case, pmu = point.case, driven.pmu
        if driven.kind == "ideal":
            pmu = replace(pmu, latency_ms=0.0, loss=0.0, outage_s=None, kind="none")
        known = machines(point, driven.inertia, driven.reactance)
        self.driven, self.simulations, self.seeds, self.true = driven, simulations, tuple(seeds), machines(point)
        self.instrument = Instrument(pmu, seeds, len(case.machines), case.frequency_hz)
        self.estimator = estimator(driven.kind, known, pmu, driven.tuning, driven.engine)
        self.center = Center(known.inertia, pmu.rate, pmu.own_frames, pmu.remote_frames)
        self._exact = Center(self.true.inertia, pmu.rate, 0, 0)
        self._terminals = [Terminals(s) for s in simulations]
        self._machine, self._bus = point.plant.storage_machine, point.plant.storage_bus
        devices = [Device(s.rating, case.machine(s.machine).base, case.frequency_hz) for s in case.storage]
        self._par = [driven.law.par(device) for device in devices]
        self._random = [np.random.default_rng([seed, 1]) for seed in seeds]
        self._last = [None] * len(simulations)
        self._rows: list[tuple] = []
        for k in range(round(WARM * pmu.rate)):
            self._frame(simulations[0].time - WARM + k / pmu.rate, point.V)

    def __call__(self) -> None:
        """One frame: look, estimate, order."""
        now, dev, est, wall = self._frame(self.simulations[0].time, None)
        orders = np.zeros((len(self.simulations), len(self._par)))
        before = time.perf_counter()
        for k, simulation in enumerate(self.simulations):
            if len(self._par):
                size = np.abs(now.volts[k]) * (
                    1 + self.driven.pmu.magnitude * self._random[k].standard_normal(len(self._par))
                )
                for j, (i, par) in enumerate(zip(self._machine, self._par, strict=True)):
                    if dev.usable[k, i]:
                        seen = Seen(dev.speed[k, i], dev.acceleration[k, i], size[j])
                        orders[k, j] = order(seen, par, 0.0)
                simulation.orders[:] = orders[k]
        wall += time.perf_counter() - before
        alive = np.array([s.outcome is None for s in self.simulations])
        self._rows.append(
            (
                self.simulations[0].time, now.slip, est.slip, np.sqrt(est.variance), now.deviation, dev.speed,
                dev.sigma, dev.usable, now.on & alive[:, None], est.nis, now.error, orders, wall,
            )
        )  # fmt: skip

    def record(self) -> Record:
        """What was seen and done so far."""
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        for column in columns:
            column.setflags(write=False)
        return Record(self.simulations[0].point, self.driven, self.seeds, *columns)

    def _frame(self, at: float, resting: np.ndarray | None) -> tuple:
        """Truth, deviations, estimates and the seconds that the controller took; bus voltages where still at rest."""
        truth = [self._true(k, s, resting) for k, s in enumerate(self.simulations)]
        V, I, slip, delta, island, volts = (np.array(part) for part in zip(*truth, strict=True))
        seen = self.instrument.report(at, V, I, slip)
        before = time.perf_counter()
        estimate = self.estimator.step(seen)
        deviation = self.center.step(estimate, island)
        wall = time.perf_counter() - before
        exact = self._exact.step(_truly(estimate, slip), island).speed
        error = np.full(slip.shape, np.nan)
        if isinstance(self.estimator, Filtered) and not self.driven.pmu.own_frames:
            error = self.estimator.error(delta, slip)
        return _Truth(slip, exact, error, island >= 0, volts), deviation, estimate, wall

    def _true(self, k: int, s: Simulation, resting: np.ndarray | None) -> tuple:
        """Phasors, speeds, angles, islands and device voltages of a simulation; the last ones where it has ended."""
        if self._last[k] is None or s.outcome is None:
            everywhere = s.V if resting is None else resting
            V, I = self._terminals[k].phasors(everywhere)
            self._last[k] = V, I, s.speed - 1, s.angle.copy(), s.island.copy(), everywhere[self._bus]
        return self._last[k]


@dataclass(frozen=True)
class _Truth:
    slip: np.ndarray
    deviation: np.ndarray
    error: np.ndarray
    on: np.ndarray
    volts: np.ndarray


def _truly(estimate: object, slip: np.ndarray) -> object:
    none = np.zeros(slip.shape)
    return estimate._replace(slip=slip, acceleration=none, variance=none, drift=none, received=none == 0)


def watch(
    point: Point,
    contingency: "Happenings | None",
    until: float,
    driven: Driven,
    seeds: Sequence[int] | None = None,
    step: float | None = None,
    criterion: Criterion = DEFAULT,
    record: bool = False,
) -> Record:
    """Simulate with an estimator in the loop until `until` (s), once per seed, and keep what it knew and ordered.

    Args: operating point and contingency as in `simulation.run`; the controller; seeds (its own where None), all of
    them carried along together; step (s); criterion of stability; whether the trajectories are kept. Raises
    `StudyError`.
    """
    events = schedule(point.case, contingency, until)
    seeds = (driven.seed,) if seeds is None else tuple(seeds)
    simulations = [Simulation(point, events, None, step, criterion, record) for _ in seeds]
    pilot = Pilot(driven, simulations, seeds)
    carry(simulations, pilot, driven.rate, until)
    return replace(pilot.record(), runs=tuple(s.finish() for s in simulations))
