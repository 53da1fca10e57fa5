"""The inputs of controllers behind an estimator: which are possible, and their values at every frame."""

from collections.abc import Sequence

import numpy as np

from stabctl.dynamics.named import Named
from stabctl.dynamics.signal_kinds import OUTPUTS
from stabctl.dynamics.signals import Signal, machines
from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.simulation.simulation import Simulation

from . import phasor_signals, rotor_signals
from .coi import Deviations
from .estimators import Estimate, EstimatorName
from .instrument import Frame
from .phasor_signals import PhasorSignals
from .pmu import Pmu
from .rotor_signals import RotorSignals

ANGLES = ("angle", "angle_deviation", "bus_angle")  # that need the angles of the rotors


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
        for of in (rotor_signals.KINDS, phasor_signals.KINDS):
            rows = np.flatnonzero(np.isin(kinds, of))
            parts.append(([given[i] for i in rows], places[rows], rest[rows]))
        (turning, *self._of_rotors), (electric, *self._of_phasors) = parts
        self._rotors = RotorSignals(point, turning, inertia, ages) if turning else None
        self._phasors = PhasorSignals(simulations, electric, pmu, seeds) if electric else None

    def frame(self, at: float, V: np.ndarray, frame: Frame, estimate: Estimate, island: np.ndarray) -> None:
        """Measure at an instant (s): bus voltages (seeds, buses), the frame and estimates of the machines, islands."""
        if self._phasors is not None:
            weight = self._inertia * (island >= 0)
            angle = np.zeros(island.shape) if estimate.angle is None else estimate.angle
            coi = (weight * angle).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-300)
            self._phasors.frame(at, V, frame, coi)

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
    name = signal.kind if signal.place is None else f"{signal.kind}:{signal.place}"
    kinds = (*rotor_signals.KINDS, *phasor_signals.KINDS)
    if signal.kind not in kinds:
        raise StudyError(
            f"{c.controller.name} reads {name}, which no PMU measures; behind an estimator a controller can read "
            f"{', '.join(kinds)}."
        )
    if signal.kind in ANGLES and estimator == "frequency":
        raise StudyError(
            f"{c.controller.name} reads {name}, but the estimator 'frequency' does not estimate rotor angles; "
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
