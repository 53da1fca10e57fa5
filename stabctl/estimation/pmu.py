"""Phasor measurement units: what they report of a machine's terminals, with noise, latency and losses.

Errors follow IEEE/IEC 60255-118-1: a total vector error (TVE) of 1 % is allowed. A reported phasor is

    V (1 + m) exp(j (a + c)),   m, a white and normal, c a constant offset of the PMU's clock,

and its frequency and ROCOF are those of the voltage angle between two frames, with white errors.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from math import ceil, pi
from typing import Literal, NamedTuple

import numpy as np

from stabctl.errors import StudyError

RATES = (10, 12, 15, 20, 24, 25, 30, 40, 50, 60, 100, 120, 200, 240)  # 1/s
LARGEST = 1e4  # of every noise level and latency, in its own unit
HALF_WINDOW = {"none": 0.0, "P": 1 / 60, "M": 3 / 60}  # s   half the length of the class's filter


class Frame(NamedTuple):
    """One report of every PMU, arrays (seeds, machines); `slip` is the truth, for the ideal estimator only."""

    V: np.ndarray  # pu   terminal voltage
    I: np.ndarray  # pu   current out of the machine, system base
    frequency: np.ndarray  # pu   deviation from nominal
    rocof: np.ndarray  # pu/s
    received: np.ndarray  # bool
    slip: np.ndarray  # pu


@dataclass(frozen=True)
class Pmu:
    """A PMU at every machine.

    Parameters
    ----------
    rate : int, 1/s
        Reports per second, one of `RATES`.
    angle_mrad, magnitude : float
        Standard deviations of a phasor's angle (mrad) and magnitude (relative).
    frequency_mhz, rocof_hz_s : float
        Standard deviations of the frequency and of its rate of change.
    clock_us : float
        Standard deviation of the constant offset of a PMU's clock.
    latency_ms : float
        Latency of remote reports; a machine's own report has none.
    loss, burst : float
        Share of the reports that never arrive, and mean length (frames) of a run of lost reports.
    outage_s : (float, float), optional
        From, to: every report is lost.
    kind : {"none", "P", "M"}
        Class of the filter: none, or centered windows of 2 and 6 cycles.

    Raises
    ------
    StudyError
        For a rate that is not in the standard, and for values out of range.
    """

    rate: int = 60
    _: KW_ONLY
    angle_mrad: float = 2.0
    magnitude: float = 0.002
    frequency_mhz: float = 5.0
    rocof_hz_s: float = 0.1
    clock_us: float = 1.0
    latency_ms: float = 50.0
    loss: float = 0.02
    burst: float = 1.0
    outage_s: tuple[float, float] | None = None
    kind: Literal["none", "P", "M"] = "none"

    @classmethod
    def noisy(cls, rate: int, noise: float, latency_ms: float, loss: float) -> "Pmu":
        """PMUs with one noise level for phasors: angles in mrad, and magnitudes with the same number in per mille."""
        return cls(rate, angle_mrad=noise, magnitude=1e-3 * noise, latency_ms=latency_ms, loss=loss)

    @classmethod
    def exact(cls, rate: int = 60, **options: float) -> "Pmu":
        """PMUs without noise, latency or losses."""
        none = dict.fromkeys(("angle_mrad", "magnitude", "frequency_mhz", "rocof_hz_s", "clock_us"), 0.0)
        return cls(rate, **(none | {"latency_ms": 0.0, "loss": 0.0} | options))

    def __post_init__(self) -> None:
        if self.rate not in RATES:
            raise StudyError(f"The PMU rate {self.rate} per second is not one of {', '.join(map(str, RATES))}.")
        for name in ("angle_mrad", "magnitude", "frequency_mhz", "rocof_hz_s", "clock_us", "latency_ms"):
            if not 0 <= getattr(self, name) <= LARGEST:
                raise StudyError(
                    f"The PMU's {name} = {getattr(self, name):g} is not allowed; it must be from 0 to {LARGEST:g}."
                )
        if not 0 <= self.loss < 1 or not self.burst >= 1 or self.loss > self.burst / (1 + self.burst):
            raise StudyError(
                f"The loss {self.loss:g} in bursts of {self.burst:g} frames is not allowed; the loss must be at least "
                "0 and at most burst/(1 + burst), the burst at least 1 frame."
            )

    @property
    def own_frames(self) -> int:
        """Age (frames) of a machine's own report: the group delay of its filter."""
        return round(HALF_WINDOW[self.kind] * self.rate)

    @property
    def remote_frames(self) -> int:
        """Age (frames) of the newest report of another machine."""
        return self.own_frames + ceil(self.latency_ms / 1e3 * self.rate - 1e-9)

    @property
    def tve(self) -> float:
        """Root mean square of the total vector error |V' - V|/|V|."""
        return float(np.hypot(self.angle_mrad / 1e3, self.magnitude))


class Instrument:
    """The PMUs of all machines in operation, one row per seed; the same seed always gives the same errors.

    `report` takes the true phasors (seeds, machines) of an instant. With a filter class the report belongs to the
    instant `own_frames` ago.
    """

    def __init__(self, pmu: Pmu, seeds: Sequence[int], machines: int, frequency_hz: float) -> None:
        self.pmu, self.hz, self.shape = pmu, frequency_hz, (len(seeds), machines)
        self._random = [np.random.default_rng(seed) for seed in seeds]
        offset = np.array([r.standard_normal(machines) for r in self._random])
        self._clock = np.exp(2j * pi * frequency_hz * pmu.clock_us * 1e-6 * offset)
        self._lost = np.zeros(self.shape, bool)
        self._recent: deque[tuple[np.ndarray, ...]] = deque(maxlen=2 * pmu.own_frames + 1)
        self._weights = _window(pmu.own_frames)
        self._angle = self._frequency = None

    def report(self, time: float, V: np.ndarray, I: np.ndarray, slip: np.ndarray) -> Frame:
        """The frame at `time` (s) of true voltages and currents (pu)."""
        p, m = self.pmu, self.shape[1]
        V, I = self._filtered(V, I)
        frequency, rocof = self._rates(V)
        draws = np.array([r.standard_normal((6, m)) for r in self._random]).transpose(1, 0, 2)
        chance = np.array([r.random(m) for r in self._random])
        noise = p.magnitude * draws[:2] + 1e-3j * p.angle_mrad * draws[2:4]
        ends = chance < 1 / p.burst
        begins = chance < p.loss / (p.burst * (1 - p.loss)) if p.loss else np.zeros(self.shape, bool)
        self._lost = np.where(self._lost, ~ends, begins) if p.burst > 1 else chance < p.loss
        out = p.outage_s is not None and p.outage_s[0] - 1e-9 <= time < p.outage_s[1] - 1e-9
        return Frame(
            V * (1 + noise[0].real) * np.exp(1j * noise[0].imag) * self._clock,
            I * (1 + noise[1].real) * np.exp(1j * noise[1].imag) * self._clock,
            frequency + 1e-3 * p.frequency_mhz / self.hz * draws[4],
            rocof + p.rocof_hz_s / self.hz * draws[5],
            ~self._lost & (not out),
            slip,
        )

    def _filtered(self, V: np.ndarray, I: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self._recent.append((V, I))
        while len(self._recent) < self._recent.maxlen:
            self._recent.append((V, I))
        if len(self._weights) == 1:
            return V, I
        return tuple(np.tensordot(self._weights, [pair[k] for pair in self._recent], 1) for k in (0, 1))

    def _rates(self, V: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angle = np.angle(V)
        before = angle if self._angle is None else self._angle
        turn = np.angle(np.exp(1j * (angle - before)))
        frequency = turn * self.pmu.rate / (2 * pi * self.hz)
        earlier = frequency if self._frequency is None else self._frequency
        self._angle, self._frequency = angle, frequency
        return frequency, (frequency - earlier) * self.pmu.rate


def _window(half: int) -> np.ndarray:
    """Triangular weights over 2 half + 1 frames."""
    weights = np.bartlett(2 * half + 3)[1:-1]
    return weights / weights.sum()
