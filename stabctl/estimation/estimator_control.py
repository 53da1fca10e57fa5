"""Storage control with estimated speeds: PMU frames, estimates, deviations from the COI, orders held for a frame.

Simulation -> V, I -> Instrument -> Estimator -> CoiReference -> law -> orders -> Simulation
(true)        noise, loss, delay    s, ds/dt     own - others           (one frame)
"""

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import NamedTuple, get_args

import numpy as np

from stabctl.controllers import BangBang, Device, Input, Law, wanted
from stabctl.errors import StudyError, shown
from stabctl.simulation.simulation import Simulation

from .coi import CoiReference
from .estimates import Estimates
from .estimators import Engine, EstimatorName, Filtered, estimator
from .instrument import Frame
from .noise import TUNING, Tuning
from .observation import Observation, Truth
from .pmu import Pmu
from .rotor_units import rotor_units

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
    inertia_factor, reactance_factor : float, or tuple with one per machine
        Multiply every H and x that the estimator uses, to study wrong machine data or to mend them (`Estimates.fit`).
    check_pmus : bool
        Find bad PMUs with the network model, and use them no longer.
    """

    law: Law = field(default_factory=BangBang)
    estimator: EstimatorName = "kalman"
    pmu: Pmu = field(default_factory=Pmu)
    _: KW_ONLY
    seed: int = 1
    engine: Engine = "filterpy"
    tuning: Tuning = TUNING
    inertia_factor: float | tuple[float, ...] = 1.0
    reactance_factor: float | tuple[float, ...] = 1.0
    check_pmus: bool = False

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
            pmu = replace(pmu, latency=0.0, loss=0.0, outage=None, filter_class="none", missing=(), bad=())
        known = rotor_units(point, control.inertia_factor, control.reactance_factor)
        self.control, self.simulations, self.seeds = control, simulations, tuple(seeds)
        self.observation = Observation(simulations, pmu, seeds, control.check_pmus)
        self.estimator = estimator(control.estimator, known, pmu, tuning=control.tuning, engine=control.engine)
        own = pmu.own_frames(case.frequency_hz)
        self.coi = CoiReference(known.inertia, pmu.rate, own, pmu.remote_frames(case.frequency_hz))
        self._true_coi = CoiReference(rotor_units(point).inertia, pmu.rate, 0, 0)
        row = {m.machine: i for i, m in enumerate(case.machines)}
        self._machine = [row[s.machine] for s in case.storage]
        self._bus = [point.net.place[s.bus] for s in case.storage]
        devices = [Device(s.rating, case.machine(s.machine).base, case.frequency_hz) for s in case.storage]
        self._par = [control.law.par(device) for device in devices]
        self._random = [np.random.default_rng([seed, 1]) for seed in seeds]
        self._past: deque[Truth] = deque(maxlen=own + 1)
        self._rows: list[_Row] = []
        self._frames: list[Frame] = []
        for k in range(round(WARM_UP * pmu.rate)):
            self._frame(simulations[0].time - WARM_UP + k / pmu.rate, point.V)

    def __call__(self) -> None:
        """One frame: measure, estimate, set the orders."""
        row = self._frame(self.simulations[0].time, None)
        before = time.perf_counter()
        for k in range(len(self.simulations)):
            row.orders[k] = self._orders(k, row)
        wall = row.wall_s + time.perf_counter() - before
        running = np.array([s.outcome is None for s in self.simulations])
        self._rows.append(row._replace(on=row.on & running[:, None], wall_s=wall))

    def estimates(self) -> Estimates:
        """The record so far."""
        columns = _Row(*(np.array(column) for column in zip(*self._rows, strict=True)))
        for column in columns:
            column.setflags(write=False)
        alarms = tuple(self.observation.alarms)
        frames = tuple(self._frames)
        return Estimates(self.simulations[0].point, self.control, self.seeds, *columns, alarms=alarms, frames=frames)

    def _orders(self, k: int, row: "_Row") -> np.ndarray:
        """Orders (devices) of simulation k, set there too."""
        n = len(self._par)
        orders = np.zeros(n)
        if n:
            volts = np.abs(self._past[-1].buses[k, self._bus])
            size = volts * (1 + self.control.pmu.magnitude * self._random[k].standard_normal(n))
            for j, (i, par) in enumerate(zip(self._machine, self._par, strict=True)):
                if row.usable[k, i]:
                    signals = Input(row.deviation_estimated[k, i], row.acceleration[k, i])
                    orders[j] = wanted(self.control.law, par, signals, size[j])
            self.simulations[k].orders[:] = orders
        return orders

    def _frame(self, at: float, resting: np.ndarray | None) -> "_Row":
        """Measure and estimate; `resting` are the bus voltages of a system at rest."""
        true, frame = self.observation(at, resting)
        self._frames.append(frame)
        before = time.perf_counter()
        if isinstance(self.estimator, Filtered) and self.observation.excluded.any():
            self.estimator.forget(self.observation.excluded)
        estimate = self.estimator.step(frame)
        dev = self.coi.step(estimate, true.island, self.observation.without)
        wall = time.perf_counter() - before
        none = np.zeros(true.slip.shape)
        exact = estimate._replace(slip=true.slip, acceleration=none, variance=none, drift=none, received=none == 0)
        self._past.append(true)
        nees = none + np.nan
        if isinstance(self.estimator, Filtered):
            nees = self.estimator.error(self._past[0].delta, self._past[0].slip)
        return _Row(
            np.array(at), true.slip, estimate.slip, np.sqrt(estimate.variance),
            self._true_coi.step(exact, true.island).speed, dev.speed, dev.acceleration, dev.sigma, dev.usable,
            true.island >= 0, estimate.nis, nees, np.zeros((len(self.simulations), len(self._par))), np.array(wall),
        )  # fmt: skip


class _Row(NamedTuple):
    """What is recorded of a frame, in the order of `Estimates`."""

    time: np.ndarray
    slip: np.ndarray
    estimated: np.ndarray
    slip_sigma: np.ndarray
    deviation: np.ndarray
    deviation_estimated: np.ndarray
    acceleration: np.ndarray
    sigma: np.ndarray
    usable: np.ndarray
    on: np.ndarray
    nis: np.ndarray
    nees: np.ndarray
    orders: np.ndarray
    wall_s: np.ndarray
