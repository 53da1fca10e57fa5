"""Storage control with estimated speeds: PMU frames, estimates, deviations from the COI, orders held for a frame.

Simulation -> V, I -> Instrument -> Estimator -> CoiReference -> law -> orders -> Simulation
(true)        noise, loss, delay    s, ds/dt     own - others           (one frame)
"""

import time
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import NamedTuple, get_args

import numpy as np

from stabctl.controllers import BangBang, Device, Input, Law, wanted
from stabctl.errors import StudyError, shown
from stabctl.simulation.simulation import Simulation

from .coi import CoiReference, Deviations
from .estimates import Estimates
from .estimators import Engine, Estimate, EstimatorName, Filtered, estimator
from .instrument import Instrument
from .noise import TUNING, Tuning
from .pmu import Pmu
from .rotor_units import Terminals, rotor_units

WARM_UP = 1.0  # s   of the system at rest before the first frame


@dataclass(frozen=True)
class EstimatorControl:
    """A storage law that acts on estimated speeds, at the PMU rate.

    Parameters
    ----------
    law : control law
        `BangBang()`, `Feedback(...)`.
    estimator : {"ideal", "frequency", "kinematic", "kalman"}
        How the speeds are estimated; see `estimators`.
    pmu : Pmu
        Rate, noise, latency and losses of the PMUs.
    seed : int
        Seed of noise and losses.
    engine : {"filterpy", "batched"}
        One filterpy filter per machine, or all filters at once with the same numbers.
    tuning : Tuning
        Process noise of the filters.
    inertia_factor, reactance_factor : float
        Multiply every H and x that the estimator uses, to study wrong machine data.
    """

    law: Law = field(default_factory=BangBang)
    estimator: EstimatorName = "kalman"
    pmu: Pmu = field(default_factory=Pmu)
    _: KW_ONLY
    seed: int = 1
    engine: Engine = "filterpy"
    tuning: Tuning = TUNING
    inertia_factor: float = 1.0
    reactance_factor: float = 1.0

    def __post_init__(self) -> None:
        if isinstance(self.law, type) or not callable(getattr(self.law, "par", None)):
            raise StudyError(f"law = {shown(self.law)} is not a control law; give BangBang() or Feedback(...).")
        if not isinstance(self.pmu, Pmu):
            raise StudyError(f"pmu = {shown(self.pmu)} does not describe PMUs; give Pmu(...).")
        for name, allowed in (("estimator", EstimatorName), ("engine", Engine)):
            if getattr(self, name) not in get_args(allowed):
                raise StudyError(
                    f"{name} = {getattr(self, name)!r} is not known; choose one of {', '.join(get_args(allowed))}."
                )

    @property
    def rate(self) -> int:
        """Frames per second."""
        return self.pmu.rate

    def pilot(self, simulations: Sequence[Simulation]) -> "EstimatorLoop":
        """The controller of these simulations; the first uses `seed`, the others the following numbers."""
        return EstimatorLoop(self, simulations, range(self.seed, self.seed + len(simulations)))


class EstimatorLoop:
    """A controller for several simulations of one operating point, each with the PMU errors of its own seed."""

    def __init__(self, control: EstimatorControl, simulations: Sequence[Simulation], seeds: Sequence[int]) -> None:
        point = simulations[0].point
        case, pmu = point.case, control.pmu
        if control.estimator == "ideal":
            pmu = replace(pmu, latency=0.0, loss=0.0, outage=None, filter_class="none")
        known = rotor_units(point, control.inertia_factor, control.reactance_factor)
        self.control, self.simulations, self.seeds = control, simulations, tuple(seeds)
        self.instrument = Instrument(pmu, seeds, len(case.machines), case.frequency_hz)
        self.estimator = estimator(control.estimator, known, pmu, tuning=control.tuning, engine=control.engine)
        self.coi = CoiReference(known.inertia, pmu.rate, pmu.own_frames, pmu.remote_frames)
        self._true_coi = CoiReference(rotor_units(point).inertia, pmu.rate, 0, 0)
        self._terminals = [Terminals(s) for s in simulations]
        row = {m.machine: i for i, m in enumerate(case.machines)}
        self._machine = [row[s.machine] for s in case.storage]
        self._bus = [point.net.place[s.bus] for s in case.storage]
        devices = [Device(s.rating, case.machine(s.machine).base, case.frequency_hz) for s in case.storage]
        self._par = [control.law.par(device) for device in devices]
        self._random = [np.random.default_rng([seed, 1]) for seed in seeds]
        self._last = [None] * len(simulations)
        self._rows: list[tuple] = []
        for k in range(round(WARM_UP * pmu.rate)):
            self._frame(simulations[0].time - WARM_UP + k / pmu.rate, point.V)

    def __call__(self) -> None:
        """One frame: measure, estimate, set the orders."""
        true, est, dev, wall = self._frame(self.simulations[0].time, None)
        before = time.perf_counter()
        orders = np.array([self._orders(k, dev, true.volts[k]) for k in range(len(self.simulations))])
        wall += time.perf_counter() - before
        running = np.array([s.outcome is None for s in self.simulations])
        self._rows.append(
            (
                self.simulations[0].time, true.slip, est.slip, np.sqrt(est.variance), true.deviation, dev.speed,
                dev.sigma, dev.usable, true.on & running[:, None], est.nis, true.nees, orders, wall,
            )
        )  # fmt: skip

    def estimates(self) -> Estimates:
        """The record so far."""
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        for column in columns:
            column.setflags(write=False)
        return Estimates(self.simulations[0].point, self.control, self.seeds, *columns)

    def _orders(self, k: int, dev: Deviations, volts: np.ndarray) -> np.ndarray:
        """Orders (devices) of simulation k, set there too."""
        n = len(self._par)
        orders = np.zeros(n)
        if n:
            size = np.abs(volts) * (1 + self.control.pmu.magnitude * self._random[k].standard_normal(n))
            for j, (i, par) in enumerate(zip(self._machine, self._par, strict=True)):
                if dev.usable[k, i]:
                    signals = Input(dev.speed[k, i], dev.acceleration[k, i])
                    orders[j] = wanted(self.control.law, par, signals, size[j])
            self.simulations[k].orders[:] = orders
        return orders

    def _frame(self, at: float, resting: np.ndarray | None) -> "tuple[_Truth, Estimate, Deviations, float]":
        """Truth, estimates, deviations and computing time (s); `resting` are the bus voltages of a system at rest."""
        truth = [self._true(k, s, resting) for k, s in enumerate(self.simulations)]
        V, I, slip, delta, island, volts = (np.array(part) for part in zip(*truth, strict=True))
        frame = self.instrument.report(at, V, I, slip)
        before = time.perf_counter()
        estimate = self.estimator.step(frame)
        deviations = self.coi.step(estimate, island)
        wall = time.perf_counter() - before
        none = np.zeros(slip.shape)
        exact = estimate._replace(slip=slip, acceleration=none, variance=none, drift=none, received=none == 0)
        nees = np.full(slip.shape, np.nan)
        if isinstance(self.estimator, Filtered) and not self.control.pmu.own_frames:
            nees = self.estimator.error(delta, slip)
        deviation = self._true_coi.step(exact, island).speed
        return _Truth(slip, deviation, nees, island >= 0, volts), estimate, deviations, wall

    def _true(self, k: int, s: Simulation, resting: np.ndarray | None) -> tuple:
        """Phasors, speeds, angles, islands and device voltages of a simulation; the last ones once it has ended."""
        if self._last[k] is None or s.outcome is None:
            buses = s.V if resting is None else resting
            V, I = self._terminals[k].phasors(buses)
            self._last[k] = V, I, s.speed - 1, s.angle.copy(), s.island.copy(), buses[self._bus]
        return self._last[k]


class _Truth(NamedTuple):
    slip: np.ndarray
    deviation: np.ndarray
    nees: np.ndarray
    on: np.ndarray
    volts: np.ndarray
