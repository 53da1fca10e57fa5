"""A control with estimated signals, frame by frame: reports, estimates, what it reads, orders held for a frame.

Simulation -> V, I -> Instrument -> Estimator -> CoiReference -> law -> orders -> Simulation
(true)        noise, loss, delay    s, ds/dt     own - others           (one frame)
                                                 inputs of controllers
"""

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.controllers import Input, Law, decided
from stabctl.dynamics import storage
from stabctl.dynamics.named import Named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import OUTPUTS, Signal, chosen, machines
from stabctl.model.case import Case
from stabctl.simulation.simulation import Simulation
from stabctl.simulation.wired import storage_devices

from . import _signals
from ._filter_bank import wrapped
from ._observation import Observation, Truth
from ._signals import CoiReference, Deviations, PhasorSignals, RotorSignals
from .estimates import Estimates
from .estimator_control import EstimatorControl
from .estimators import Estimate, EstimatorName, Filtered, estimator
from .pmu import Frame, Pmu
from .rotor_units import rotor_units

Row = dict[str, Any]  # what is recorded of a frame, by the names of `Estimates`
WARM_UP = 1.0  # s   of the system at rest before the first frame
ANGLES = ("angle", "angle_deviation", "bus_angle")  # that need the angles of the rotors


def pilot(control: EstimatorControl, simulations: Sequence[Simulation]) -> "EstimatorLoop":
    """The control of several simulations.

    Parameters
    ----------
    control : EstimatorControl
        What is controlled, and with which signals.
    simulations : sequence of Simulation
        The simulations; the first uses the seed of the control, the others the following numbers.

    Returns
    -------
    EstimatorLoop
    """
    return EstimatorLoop(control, simulations, range(control.seed, control.seed + len(simulations)))


class EstimatorLoop:
    """A control of several simulations of one operating point, each with the PMU errors of its own seed."""

    def __init__(self, control: EstimatorControl, simulations: Sequence[Simulation], seeds: Sequence[int]) -> None:
        point = simulations[0].point
        case, pmu = point.case, control.pmu
        if control.estimator == "ideal":
            pmu = replace(pmu, latency=0.0, loss=0.0, outage=None, filter_class="none", missing=(), bad=())
        known = rotor_units(point, control.inertia_factor, control.reactance_factor)
        self.control, self.simulations, self.seeds = control, simulations, tuple(seeds)
        self.observation = Observation(simulations, pmu, seeds, control.check_pmus)
        self.estimator = estimator(control.estimator, known, pmu, process=control.process, engine=control.engine)
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
        self._rows: list[Row] = []
        self._frames: list[Frame] = []
        for k in range(round(WARM_UP * pmu.rate)):
            self._frame(simulations[0].time - WARM_UP + k / pmu.rate, point.V)

    def __call__(self) -> None:
        """One frame: measure, estimate, set the orders and the inputs of controllers."""
        row, deviations, island = self._frame(self.simulations[0].time, None)
        before = time.perf_counter()
        for k in range(len(self.simulations)):
            row["orders"][k] = self._orders(k, deviations, island[k])
            self.inputs.set(k, deviations, island)
        row["wall_s"] += time.perf_counter() - before
        row["on"] &= np.array([s.outcome is None for s in self.simulations])[:, None]
        self._rows.append(row)

    def estimates(self) -> Estimates:
        """The record so far."""
        columns: dict[str, Any] = {name: np.array([row[name] for row in self._rows]) for name in self._rows[0]}
        for column in columns.values():
            column.setflags(write=False)
        columns |= {"alarms": tuple(self.observation.alarms), "frames": tuple(self._frames)}
        return Estimates(self.simulations[0].point, self.control, self.seeds, **columns)

    def _orders(self, k: int, estimates: Deviations, island: np.ndarray) -> np.ndarray:
        """Orders (devices) of simulation k, set there too."""
        orders = np.zeros(len(self._machine))
        if self._law is not None:
            law, simulation = self._law, self.simulations[k]
            volts = np.abs(self._past[-1].buses[k, self._bus])
            size = volts * (1 + self.control.pmu.magnitude * self._random[k].standard_normal(len(orders)))
            signals = law.signals(k, estimates, island, simulation)
            for j, i in enumerate(self._machine):
                if estimates.usable[k, i]:
                    given = decided(law.law, law.par[j], signals[j], size[j], self._given[k][j])
                    orders[j], self._given[k][j] = min(max(given.wanted, -1.0), 1.0), given
            simulation.orders[:] = orders
        return orders

    def _frame(self, at: float, resting: np.ndarray | None) -> tuple[Row, Deviations, np.ndarray]:
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
        row: Row = {
            "time": at, "slip": true.slip, "estimated": dev.own.slip, "slip_sigma": np.sqrt(dev.own.variance),
            "deviation": self._true_coi.step(exact, true.island).speed, "deviation_estimated": dev.speed,
            "acceleration": dev.acceleration, "sigma": dev.sigma, "usable": dev.usable, "on": true.island >= 0,
            "nis": estimate.nis, "nees": nees, "orders": np.zeros((len(self.simulations), len(self._machine))),
            "wall_s": wall,
        }  # fmt: skip
        return row, dev, true.island

    def _turned(self, estimate: Estimate, true: Truth) -> Estimate:
        """The estimate with continuous angles; the ideal estimator knows the true ones, and the true accelerations."""
        if self.control.estimator == "ideal":
            return estimate._replace(acceleration=true.acceleration, angle=true.delta)
        if estimate.angle is None:
            return estimate
        self._angle = self._angle + wrapped(estimate.angle - self._angle)
        return estimate._replace(angle=self._angle)


class LawInputs:
    """Inputs of the devices of a law: of their own machine, or of its group as late as reports of others arrive.

    Parameters
    ----------
    point : OperatingPoint
        The operating point.
    law : Law
        The law.
    inertia : (machines) array, s
        H on one base, as the estimator knows it.
    pmu : Pmu
        The PMUs.
    """

    def __init__(self, point: OperatingPoint, law: Law, inertia: np.ndarray, pmu: Pmu) -> None:
        case, hz = point.case, point.case.frequency_hz
        self.law, self.par = law, [law.par(device) for device in storage_devices(case)]
        row = {m.machine: i for i, m in enumerate(case.machines)}
        self._machine = [row[s.machine] for s in case.storage]
        self._energy = storage.places(point.system, case).energy
        groups = [next((g for g in law.numbers(case) if s.machine in g), (s.machine,)) for s in case.storage]
        read = [(chosen(case, [f"deviation:{'+'.join(map(str, g))}"], OUTPUTS)[0], len(g) == 1) for g in groups]
        ages = pmu.own_frames(hz) / pmu.rate, pmu.remote_frames(hz) / pmu.rate
        self._start = point.s[point.rotors.angle]
        wider = law.groups or law.reads("angle")
        self._rotors = RotorSignals(point, read, inertia, ages, self._machine) if wider else None

    def signals(self, k: int, estimates: Deviations, island: np.ndarray, simulation: Simulation) -> list[Input]:
        """Inputs (devices) in simulation k, with its islands (machines)."""
        energy = simulation.s[self._energy]
        deviation, rate = (of[k][self._machine] for of in (estimates.speed, estimates.acceleration))
        angle = np.zeros(len(energy))
        if self._rotors is not None:
            relative, known = self._rotors.relative(k, estimates, island, self._start)
            deviation, angle, rate = relative.T * known
        return [Input(*of, simulation.time) for of in zip(deviation, rate, angle, energy, strict=True)]


class ControlInputs:
    """Inputs of controllers in simulations of one operating point.

    Parameters
    ----------
    simulations : sequence of Simulation
        The simulations, with the same controllers.
    estimator : str
        Name of the estimator.
    inertia : (machines) array, s
        H on one base, as the estimator knows it.
    pmu : Pmu
        The PMUs.
    seeds : sequence of int
        Seeds of noise and losses.
    """

    def __init__(
        self,
        simulations: Sequence[Simulation],
        estimator: EstimatorName,
        inertia: np.ndarray,
        *,
        pmu: Pmu,
        seeds: Sequence[int],
    ) -> None:
        point, measured = simulations[0].point, simulations[0].attached.measured
        self.simulations, self._inertia = simulations, inertia
        read = [(m.named, s) for m in measured for s in m.named.inputs]
        for c, signal in read:
            _check(c, signal, estimator)
        places = np.concatenate([np.zeros(0, int), *(m.reads for m in measured)])
        rest = np.concatenate([np.zeros(0), *(m.named.rest for m in measured)])
        given = [(s, _belongs(point.case, c, s)) for c, s in read]
        kinds = np.array([s.kind for s, _ in given], str)
        ages = pmu.own_frames(point.case.frequency_hz) / pmu.rate, pmu.remote_frames(point.case.frequency_hz) / pmu.rate
        parts = []
        for of in (_signals.ROTOR_KINDS, _signals.PHASOR_KINDS):
            rows = np.flatnonzero(np.isin(kinds, of))
            parts.append(([given[i] for i in rows], places[rows], rest[rows]))
        (turning, *self._of_rotors), (electric, *self._of_phasors) = parts
        self._rotors = RotorSignals(point, turning, inertia, ages) if turning else None
        self._phasors = PhasorSignals(simulations, electric, pmu, seeds) if electric else None

    def frame(self, at: float, V: np.ndarray, frame: Frame, estimate: Estimate, island: np.ndarray) -> None:
        """Measure at an instant (s): bus voltages (seeds, buses), the frame and estimates of the machines, islands."""
        if self._phasors is not None:
            angle = np.zeros(island.shape) if estimate.angle is None else estimate.angle
            self._phasors.frame(at, V, frame, angle, self._inertia * (island >= 0))

    def set(self, k: int, estimates: Deviations, island: np.ndarray) -> None:
        """Give the controllers of simulation k their inputs."""
        s = self.simulations[k].s
        if self._rotors is not None:
            places, rest = self._of_rotors
            s[places] = self._rotors(k, estimates, island[k], rest)
        if self._phasors is not None:
            s[self._of_phasors[0]] = self._phasors(k)


def _check(c: Named, signal: Signal, estimator: EstimatorName) -> None:
    """Raise `StudyError` if no PMU measures a signal."""
    kinds = (*_signals.ROTOR_KINDS, *_signals.PHASOR_KINDS)
    if signal.kind not in kinds:
        raise StudyError(
            f"{c.controller.name} reads {signal.name}, which no PMU measures; behind an estimator a controller can "
            f"read {', '.join(kinds)}."
        )
    if signal.kind in ANGLES and estimator == "frequency":
        raise StudyError(
            f"{c.controller.name} reads {signal.name}, but the estimator 'frequency' does not estimate rotor angles; "
            "choose 'kalman'."
        )


def _belongs(case: Case, c: Named, signal: Signal) -> bool:
    """Whether a signal is measured at the machine that the controller belongs to."""
    if c.machine is None:
        return False
    if OUTPUTS[signal.kind].place in ("machine", "group"):
        return machines(signal) == (c.machine,)
    machine = case.machine(c.machine)
    return OUTPUTS[signal.kind].place == "bus" and signal.number in (machine.bus, machine.storage_bus)
