"""A control with estimated signals, frame by frame: PMU reports, estimates, orders and inputs held for a frame.

Simulation -> V, I -> Instrument -> Estimator -> CoiReference -> law -> orders -> Simulation
(true)        noise, loss, delay    s, ds/dt     own - others           (one frame)
                                                 inputs of controllers
"""

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl.controllers import decided
from stabctl.simulation.simulation import Simulation

from .coi import CoiReference, Deviations
from .control_inputs import ControlInputs
from .estimates import Estimates
from .estimators import Estimate, Filtered, estimator
from .filter_bank import wrapped
from .instrument import Frame
from .law_inputs import LawInputs
from .observation import Observation, Truth
from .rotor_units import rotor_units

if TYPE_CHECKING:
    from .estimator_control import EstimatorControl

WARM_UP = 1.0  # s   of the system at rest before the first frame


class EstimatorLoop:
    """A control of several simulations of one operating point, each with the PMU errors of its own seed."""

    def __init__(self, control: "EstimatorControl", simulations: Sequence[Simulation], seeds: Sequence[int]) -> None:
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
        self._law = LawInputs(point, control.law, known.inertia, pmu) if control.law and case.storage else None
        self.inputs = ControlInputs(simulations, control.estimator, known.inertia, pmu=pmu, seeds=seeds)
        self._angle = np.array([s.angle for s in simulations])  # rad, continuous
        self._random = [np.random.default_rng([seed, 1]) for seed in seeds]
        self._given: list[list[Any]] = [[None] * len(self._machine) for _ in seeds]
        self._past: deque[Truth] = deque(maxlen=own + 1)
        self._rows: list[_Row] = []
        self._frames: list[Frame] = []
        for k in range(round(WARM_UP * pmu.rate)):
            self._frame(simulations[0].time - WARM_UP + k / pmu.rate, point.V)

    def __call__(self) -> None:
        """One frame: measure, estimate, set the orders and the inputs of controllers."""
        row, deviations, island = self._frame(self.simulations[0].time, None)
        before = time.perf_counter()
        for k in range(len(self.simulations)):
            row.orders[k] = self._orders(k, row, deviations, island[k])
            self.inputs.set(k, deviations, island)
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

    def _orders(self, k: int, row: "_Row", estimates: Deviations, island: np.ndarray) -> np.ndarray:
        """Orders (devices) of simulation k, set there too."""
        orders = np.zeros(len(self._machine))
        if self._law is not None:
            law, simulation = self._law, self.simulations[k]
            volts = np.abs(self._past[-1].buses[k, self._bus])
            size = volts * (1 + self.control.pmu.magnitude * self._random[k].standard_normal(len(orders)))
            signals = law.signals(k, estimates, island, simulation)
            for j, i in enumerate(self._machine):
                if row.usable[k, i]:
                    given = decided(law.law, law.par[j], signals[j], size[j], self._given[k][j])
                    orders[j], self._given[k][j] = given.wanted, given
            simulation.orders[:] = orders
        return orders

    def _frame(self, at: float, resting: np.ndarray | None) -> "tuple[_Row, Deviations, np.ndarray]":
        """Measure and estimate; `resting` are the bus voltages of a system at rest."""
        true, frame = self.observation(at, resting)
        self._frames.append(frame)
        before = time.perf_counter()
        if isinstance(self.estimator, Filtered) and self.observation.excluded.any():
            self.estimator.forget(self.observation.excluded)
        estimate = self._turned(self.estimator.step(frame), true)
        self.inputs.frame(at, true.buses, frame, estimate, true.island)
        dev = self.coi.step(estimate, true.island, self.observation.without, frame.since)
        wall = time.perf_counter() - before
        none = np.zeros(true.slip.shape)
        exact = estimate._replace(slip=true.slip, acceleration=none, variance=none, drift=none, received=none == 0)
        self._past.append(true)
        nees = none + np.nan
        if isinstance(self.estimator, Filtered):
            nees = self.estimator.error(self._past[0].delta, self._past[0].slip)
        row = _Row(
            np.array(at), true.slip, estimate.slip, np.sqrt(estimate.variance),
            self._true_coi.step(exact, true.island).speed, dev.speed, dev.acceleration, dev.sigma, dev.usable,
            true.island >= 0, estimate.nis, nees, np.zeros((len(self.simulations), len(self._machine))), np.array(wall),
        )  # fmt: skip
        return row, dev, true.island

    def _turned(self, estimate: Estimate, true: Truth) -> Estimate:
        """The estimate with continuous angles; the ideal estimator knows the true ones."""
        angle = true.delta if self.control.estimator == "ideal" else estimate.angle
        if angle is None:
            return estimate
        self._angle = self._angle + wrapped(angle - self._angle)
        return estimate._replace(angle=self._angle)


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
