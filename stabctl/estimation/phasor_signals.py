"""Signals of controllers from PMUs at buses, lines and terminals: magnitudes, angles, frequencies and powers.

A lost report leaves the last one. Reports arrive at once where the controller belongs to the machine at that place, and
with the latency of the PMUs otherwise.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stabctl.dynamics import outputs
from stabctl.dynamics.signals import Signal
from stabctl.model.location import circuit
from stabctl.model.network import INTACT, Switching
from stabctl.simulation.simulation import Simulation

from .instrument import Frame, Instrument
from .pmu import Pmu

OF_MACHINE = ("pe", "qe", "vt")
KINDS = ("voltage", "bus_angle", "bus_frequency", "flow", "flow_q", *OF_MACHINE)
STREAM = 3  # of the random numbers of a seed


class _Report(NamedTuple):
    """The last phasors and frequencies (seeds, signals), and the angle of the COI that was estimated then."""

    V: np.ndarray
    I: np.ndarray
    frequency: np.ndarray
    coi: np.ndarray


class PhasorSignals:
    """Signals from PMUs in simulations of one operating point, each with the errors of its seed.

    Parameters
    ----------
    simulations : sequence of Simulation
        The simulations.
    signals : sequence of (Signal, bool)
        The signals, and whether the controller that reads each belongs to the machine there.
    pmu : Pmu
        The PMUs.
    seeds : sequence of int
        Seeds of noise and losses.
    """

    def __init__(
        self, simulations: Sequence[Simulation], signals: Sequence[tuple[Signal, bool]], pmu: Pmu, seeds: Sequence[int]
    ) -> None:
        point = simulations[0].point
        hz, numbers = point.case.frequency_hz, [m.machine for m in point.case.machines]
        self.simulations, self._point = simulations, point
        self._signals = [s for s, _ in signals]
        self._kinds = np.array([s.kind for s in self._signals])
        self._late = np.array([not own for _, own in signals], bool)
        self._row = np.array([numbers.index(s.number) if s.kind in OF_MACHINE else -1 for s in self._signals], int)
        self._share = np.array([1.0 if i < 0 else point.case.base_mva / point.case.machines[i].base for i in self._row])
        self._instrument = Instrument(pmu, [[seed, STREAM] for seed in seeds], len(signals), hz)
        self._past: deque[_Report] = deque(maxlen=pmu.remote_frames(hz) - pmu.own_frames(hz) + 1)
        self._ends: dict[Switching, tuple[np.ndarray, np.ndarray]] = {}

    def frame(self, at: float, V: np.ndarray, machines: Frame, coi: np.ndarray) -> None:
        """Reports at an instant (s) with bus voltages (seeds, buses), those of the machines, and COI angles (seeds)."""
        true = [self._true(v, s.switching) for v, s in zip(V, self.simulations, strict=True)]
        volts, currents = (np.array(columns) for columns in zip(*true, strict=True))
        seen = self._instrument.report(at, volts, currents, np.zeros(volts.shape))
        here = self._row >= 0
        U, I, received = (
            np.where(here, own[:, self._row], other)
            for own, other in ((machines.V, seen.V), (machines.I, seen.I), (machines.received, seen.received))
        )
        new = _Report(U, I, seen.frequency, np.broadcast_to(coi[:, None], U.shape))
        if self._past:
            last = self._past[-1]
            new = _Report(*(np.where(received, now, old) for now, old in zip(new, last, strict=True)))
        self._past.append(new)

    def __call__(self, k: int) -> np.ndarray:
        """Values (signals) in simulation k."""
        now, late = self._past[-1], self._past[0]
        V, I, frequency, coi = (np.where(self._late, b[k], a[k]) for a, b in zip(now, late, strict=True))
        power = V * I.conjugate() * self._share
        turned = np.angle(V * np.exp(-1j * coi))
        values = {
            "voltage": np.abs(V), "vt": np.abs(V), "bus_angle": turned, "bus_frequency": 1 + frequency,
            "flow": power.real, "pe": power.real, "flow_q": power.imag, "qe": power.imag,
        }  # fmt: skip
        return np.array([values[kind][i] for i, kind in enumerate(self._kinds)])

    def _true(self, V: np.ndarray, switching: Switching) -> tuple[np.ndarray, np.ndarray]:
        """Voltages and currents (signals) where the PMUs are."""
        if switching not in self._ends:
            self._ends[switching] = self._wiring(dict(switching.branches))
        buses, Y = self._ends[switching]
        ends = V[buses]
        return ends[:, 0], (Y * ends).sum(axis=1)

    def _wiring(self, states: dict) -> tuple[np.ndarray, np.ndarray]:
        """Buses (signals, 2) whose voltages matter, and admittances (signals, 2) from these to the current."""
        buses, Y = np.zeros((len(self._signals), 2), int), np.zeros((len(self._signals), 2), complex)
        place = self._point.net.place
        for i, signal in enumerate(self._signals):
            if signal.kind in ("flow", "flow_q"):
                row, _ = circuit(self._point.case, str(signal.place))
                at, p = outputs.line(self._point, str(signal.place), states.get(row, INTACT))
                buses[i], Y[i] = at[::2] // 2, (complex(p.g, p.b), complex(p.gm, p.bm))
            elif signal.kind not in OF_MACHINE:
                buses[i] = place[signal.number]
        return buses, Y
