"""Observation of simulations frame by frame: the reports for the estimators, and the true values."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.dynamics.operating_point import source_admittances
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.network import Switching
from stabctl.simulation.simulation import Simulation

from ._bad_data import RETURN, Alarm, PmuCheck
from ._network_model import NetworkModel, sharp
from .pmu import BadReports, Frame, Instrument, Parts, Pmu
from .rotor_units import Terminals

LONG = 1 << 30  # frames


class Truth(NamedTuple):
    """What is true at an instant, arrays (seeds, machines) unless stated otherwise."""

    V: np.ndarray  # pu   terminal voltages
    I: np.ndarray  # pu   currents out of the machines
    slip: np.ndarray  # pu
    delta: np.ndarray  # rad
    acceleration: np.ndarray  # pu/s
    island: np.ndarray  # by number; -1 of tripped machines
    buses: np.ndarray  # (seeds, buses) pu   voltages
    others: np.ndarray  # (seeds, others) pu   currents into the network of storage devices and loads


class Observation:
    """The PMUs of simulations of one operating point, each with the errors of its seed.

    A machine without a PMU has a report where the network model computes one from those of the others. The model knows
    the branches in service and the fault; the currents of storage devices and loads are measured, with PMU noise.
    """

    def __init__(self, simulations: Sequence[Simulation], pmu: Pmu, seeds: Sequence[int], check: bool = False) -> None:
        point, shape = simulations[0].point, (len(seeds), len(simulations[0].point.case.machines))
        hz, self.names, self.seeds = point.case.frequency_hz, [m.called for m in point.case.machines], seeds
        without = np.isin(range(shape[1]), _rows(point.case, pmu.missing))
        self._spoil = BadReports(pmu, _rows(point.case, [one.machine for one in pmu.bad]), hz)
        self.simulations, self.network = simulations, NetworkModel(point)
        self.without = np.broadcast_to(without, shape).copy()  # machines whose reports are not used
        self._impedance = 1 / source_admittances(point.system)
        self._error = float(np.hypot(max(pmu.angle, pmu.magnitude), 2 * np.pi * hz * pmu.clock))
        self._check = PmuCheck(self.network, pmu, hz, shape) if check else None
        self._metered = check or bool(without.any())
        self.excluded = np.zeros(shape, bool)  # with this frame
        self._never = self.without.copy()
        self._used = ~self.without  # PMUs not known to be bad
        self._due: deque[tuple[int, np.ndarray]] = deque()  # frames at which others hear of it, and machines without
        self._frames, self._late = 0, pmu.remote_frames(hz) - pmu.own_frames(hz)
        self.alarms: list[Alarm] = []
        self._instrument = Instrument(pmu, seeds, shape[1], hz)
        always = replace(pmu, loss=0.0, outage=None)
        others = len(self.network.others)
        self._meters = Instrument(always, [[seed, 2] for seed in seeds], others, hz)
        self._terminals = [Terminals(s) for s in simulations]
        self._last: list[tuple[np.ndarray, ...] | None] = [None] * len(simulations)
        self._window = 2 * pmu.own_frames(hz)
        self._switching: list[tuple[Switching, int]] = [(s.switching, LONG) for s in simulations]

    def __call__(self, at: float, resting: np.ndarray | None = None) -> tuple[Truth, Frame]:
        """Truth and frame at an instant (s); `resting` are the bus voltages of a system at rest."""
        truth = Truth(*map(np.array, zip(*(self._true(k, resting) for k in range(len(self._last))), strict=True)))
        frame = self._spoil(at, self._instrument.report(at, truth.V, truth.I, truth.slip))
        frame = frame._replace(since=np.array([[since] for _, since in self._switching]))
        if not self._metered:
            return truth, frame
        metered = self._meters.report(at, truth.others, truth.others, truth.others.real).I
        self.excluded = self._exclude(at, frame, metered)
        if not self.without.any():
            return truth, frame
        return truth, self._completed(frame._replace(received=frame.received & ~self.without), metered)

    def _exclude(self, at: float, frame: Frame, metered: np.ndarray) -> np.ndarray:
        """Machines whose PMUs are not used from now on: those found bad as long ago as reports are late."""
        before, self._frames = self.without.copy(), self._frames + 1
        if self._check is not None:
            settled = np.array([since >= self._window for _, since in self._switching])
            checked = frame._replace(received=frame.received & settled[:, None])
            switching = [switching for switching, _ in self._switching]
            found = self._check(checked, metered, switching, self._used)
            for k, row, why in found:
                self._used[k, row] = False
                self.alarms.append(Alarm(self.seeds[k], self.names[row], at, why))
            left_out = ~self._used & ~self._never
            right = []
            if left_out.any():
                right = self._check.recovered(checked, metered, switching, used=self._used, left_out=left_out)
            for k, row in right:
                self._used[k, row] = True
                why = f"its phasors have been consistent for {RETURN:g} s"
                self.alarms.append(Alarm(self.seeds[k], self.names[row], at, why, left_out=False))
            if found or right:
                self._due.append((self._frames + self._late, ~self._used))
            while self._due and self._due[0][0] <= self._frames:
                self.without = self._due.popleft()[1]
        return self.without & ~before

    def _completed(self, frame: Frame, others: np.ndarray) -> Frame:
        """The frame with computed reports of the machines without."""
        reports = 2 * frame.V.shape[1] + others.shape[1]
        parts = Parts(np.zeros(frame.V.shape, bool), *np.zeros((2, *frame.V.shape, reports), complex))
        for k, (switching, since) in enumerate(self._switching):
            known = frame.received[k]
            given = {"switching": switching, "known": known}
            found = self.network.computed(frame.V[k], frame.I[k], others[k], **given) if since >= self._window else None
            if found is None:
                continue
            rows = np.flatnonzero(~known)
            good = sharp(found, self._impedance[rows], self._error)
            parts.computed[k, rows] = self.without[k, rows] & good
            parts.V[k, rows[good]], parts.I[k, rows[good]] = found.V_parts[good], found.I_parts[good]
        V = np.where(parts.computed, parts.V.sum(-1), np.where(self.without, 1.0, frame.V))
        I = np.where(parts.computed, parts.I.sum(-1), np.where(self.without, 0.0, frame.I))
        return frame._replace(V=V, I=I, received=frame.received | parts.computed, parts=parts)

    def _true(self, k: int, resting: np.ndarray | None) -> tuple[np.ndarray, ...]:
        """The fields of `Truth` in simulation k; the last ones once it has ended."""
        s, last = self.simulations[k], self._last[k]
        if last is None or s.outcome is None:
            before, since = self._switching[k]
            self._switching[k] = s.switching, since + 1 if s.switching == before else 0
            buses = s.V if resting is None else resting
            V, I = self._terminals[k].phasors(buses)
            others = self.network.other_currents(buses, I, s.switching) if self._metered else np.zeros(0, complex)
            rotors = s.speed - 1, s.angle.copy(), s.acceleration
            self._last[k] = last = V, I, *rotors, s.island.copy(), buses, others
        return last


def _rows(case: Case, machines: Sequence[int | str]) -> list[int]:
    """Rows of these machines, if a case has them and does not lose all."""
    row = {m.machine: i for i, m in enumerate(case.machines)}
    found = [row.get(naming.machine_number(case, one), -1) for one in machines]  # type: ignore[arg-type]
    unknown = [one for one, i in zip(machines, found, strict=True) if i < 0]
    if unknown or len(set(found)) == len(row):
        wrong = f"{case.name} has no machine {unknown[0]}" if unknown else "no machine would have a PMU"
        raise StudyError(
            f"missing or bad PMUs {tuple(machines)} are not possible: {wrong}; give the numbers of some machines."
        )
    return found
