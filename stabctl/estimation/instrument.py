"""The PMUs of all machines in operation: reports with noise and losses, the same for the same seed."""

from collections import deque
from collections.abc import Sequence
from math import pi
from typing import NamedTuple

import numpy as np

from .pmu import Pmu


class Frame(NamedTuple):
    """One report of every PMU, arrays (seeds, machines); `slip` is the truth, for the ideal estimator only."""

    V: np.ndarray  # pu   terminal voltage
    I: np.ndarray  # pu   current out of the machine, system base
    frequency: np.ndarray  # pu   deviation from nominal
    rocof: np.ndarray  # pu/s
    received: np.ndarray  # bool
    slip: np.ndarray  # pu
    parts: "Parts | None" = None
    since: np.ndarray | None = None  # (seeds, 1)   frames since the network was switched; None: never


class Parts(NamedTuple):
    """Phasors that are not reports of the machine itself, but computed from those of others."""

    computed: np.ndarray  # (seeds, machines) bool
    V: np.ndarray  # (seeds, machines, reports) pu   what each report contributes to the voltage
    I: np.ndarray  # (seeds, machines, reports) pu


class Instrument:
    """The PMUs of all machines in operation, one row per seed; the same seed always gives the same errors.

    `report` takes the true phasors (seeds, machines) of an instant. With a filter class the report belongs to the
    instant `own_frames` ago.
    """

    def __init__(
        self, pmu: Pmu, seeds: Sequence[int] | Sequence[list[int]], machines: int, frequency_hz: float
    ) -> None:
        self.pmu, self.hz, self.shape = pmu, frequency_hz, (len(seeds), machines)
        self._random = [np.random.default_rng(seed) for seed in seeds]
        offset = np.array([r.standard_normal(machines) for r in self._random])
        self._clock = np.exp(2j * pi * frequency_hz * pmu.clock * offset)
        self._lost = np.zeros(self.shape, bool)
        half = pmu.own_frames(frequency_hz)
        self._length = 2 * half + 1
        self._recent: deque[tuple[np.ndarray, np.ndarray]] = deque(maxlen=self._length)
        self._weights = window(half)
        self._angle: np.ndarray | None = None
        self._frequency: np.ndarray | None = None

    def report(self, time: float, V: np.ndarray, I: np.ndarray, slip: np.ndarray) -> Frame:
        """The frame at `time` (s) of true voltages and currents (pu)."""
        p, m = self.pmu, self.shape[1]
        V, I = self._filtered(V, I)
        frequency, rocof = self._rates(V)
        draws = np.array([r.standard_normal((6, m)) for r in self._random]).transpose(1, 0, 2)
        chance = np.array([r.random(m) for r in self._random])
        noise = p.magnitude * draws[:2] + 1j * p.angle * draws[2:4]
        ends = chance < 1 / p.burst
        begins = chance < p.loss / (p.burst * (1 - p.loss)) if p.loss else np.zeros(self.shape, bool)
        self._lost = np.where(self._lost, ~ends, begins) if p.burst > 1 else chance < p.loss
        out = p.outage is not None and float(p.outage[0]) - 1e-9 <= time < float(p.outage[1]) - 1e-9
        return Frame(
            V * (1 + noise[0].real) * np.exp(1j * noise[0].imag) * self._clock,
            I * (1 + noise[1].real) * np.exp(1j * noise[1].imag) * self._clock,
            frequency + p.frequency / self.hz * draws[4],
            rocof + p.rocof / self.hz * draws[5],
            ~self._lost & (not out),
            slip,
        )

    def _filtered(self, V: np.ndarray, I: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self._recent.append((V, I))
        while len(self._recent) < self._length:
            self._recent.append((V, I))
        if len(self._weights) == 1:
            return V, I
        voltages, currents = zip(*self._recent, strict=True)
        return np.tensordot(self._weights, voltages, 1), np.tensordot(self._weights, currents, 1)

    def _rates(self, V: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angle = np.angle(V)
        before = angle if self._angle is None else self._angle
        turn = np.angle(np.exp(1j * (angle - before)))
        frequency = turn * self.pmu.rate / (2 * pi * self.hz)
        earlier = frequency if self._frequency is None else self._frequency
        self._angle, self._frequency = angle, frequency
        return frequency, (frequency - earlier) * self.pmu.rate


def window(half: int) -> np.ndarray:
    """Triangular weights over 2 half + 1 frames."""
    weights = np.bartlett(2 * half + 3)[1:-1]
    return weights / weights.sum()
