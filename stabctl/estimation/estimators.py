"""Estimators of the rotor speeds with a common interface: a Kalman filter of the swing equation, and simpler ones.

ideal       the true speed
frequency   the PMU's frequency at the terminal
kinematic   Kalman filter of a constant acceleration on the internal angle
kalman      Kalman filter of the swing equation on the internal angle, with the measured power as its input
"""

from collections.abc import Callable
from typing import Literal, NamedTuple, Protocol

import numpy as np

from .filter_bank import ENGINES, FilterBank, wrapped
from .instrument import Frame
from .machine_model import MachineModel
from .noise import TUNING, Tuning
from .pmu import Pmu
from .rotor_units import RotorUnits

EstimatorName = Literal["ideal", "frequency", "kinematic", "kalman"]
Engine = Literal["filterpy", "batched"]


class Estimate(NamedTuple):
    """Estimates at the time of a frame, arrays (seeds, machines)."""

    slip: np.ndarray  # pu     speed deviation from nominal
    acceleration: np.ndarray  # pu/s
    variance: np.ndarray  # pu^2   of the slip
    drift: np.ndarray  # pu^2/s^2   variance of the acceleration
    received: np.ndarray  # bool   a report arrived
    nis: np.ndarray  # -      normalized innovation squared, NaN without a report
    angle: np.ndarray | None = None  # rad   of the rotor, where the estimator knows it


class Estimator(Protocol):
    """Takes one frame at a time; the first is that of a system at rest."""

    def step(self, frame: Frame) -> Estimate:
        """The estimate at the instant of the frame."""
        ...


class Ideal:
    """The true speeds."""

    def step(self, frame: Frame) -> Estimate:
        """The true speeds in the frame."""
        none = np.zeros(frame.slip.shape)
        return Estimate(frame.slip.copy(), none, none, none, none == 0, none * np.nan)


class Frequency:
    """The frequency at the terminals; if a report is lost, the last one is kept."""

    def __init__(self, pmu: Pmu, hz: float) -> None:
        self._variance = (pmu.frequency / hz) ** 2
        self._last: np.ndarray | None = None

    def step(self, frame: Frame) -> Estimate:
        """Frequency as speed, no acceleration."""
        before = np.zeros(frame.frequency.shape) if self._last is None else self._last
        self._last = last = np.where(frame.received, frame.frequency, before)
        none = np.zeros(last.shape)
        return Estimate(last, none, none + self._variance, none, frame.received, none * np.nan)


class Filtered:
    """A bank of extended Kalman filters on the internal angles; with `swing` the measured power is their input."""

    def __init__(
        self, known: RotorUnits, pmu: Pmu, *, swing: bool, tuning: Tuning = TUNING, engine: Engine = "batched"
    ) -> None:
        self.model, self._engine = MachineModel(known, pmu, power=swing, tuning=tuning), ENGINES[engine]
        self._clock = (2 * np.pi * known.frequency_hz * pmu.clock) ** 2
        self.bank: FilterBank | None = None

    def step(self, frame: Frame) -> Estimate:
        """Predict with the mean power since the last report, then use the new angles that pass the gate."""
        model, seen = self.model, self.model.measured(frame)
        if self.bank is None:
            self.bank = self._engine(*model.begin(seen), model.swing.reset)
            return self._estimate(self.bank, np.ones(seen.P.shape, bool), np.full(seen.P.shape, np.nan))
        self.bank.predict(*model.predict(self.bank.x, seen))
        forgotten = (model.kept.missing >= model.memory) & frame.received
        if forgotten.any():
            self.bank.restart(*model.restarted(self.bank.x, self.bank.P, seen, forgotten))
        nis = self.bank.update(model.observe(self.bank.x, seen))
        model.settle(self.bank.x, seen)
        return self._estimate(self.bank, frame.received, nis)

    def forget(self, where: np.ndarray) -> None:
        """Start anew with the next report of these machines (seeds, machines)."""
        self.model.kept.missing[where] = self.model.memory

    def error(self, delta: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Normalized squared error (NEES) of angle and speed (seeds, machines), chi-square with two degrees.

        The offset of a clock turns the angle and is not known to the filter: its variance is added here.
        """
        assert self.bank is not None
        x, P = self.model.angle_and_slip(self.bank.x, self.bank.P)
        e = np.stack([wrapped(x[..., 0] - delta), x[..., 1] - slip], -1)
        P = P + np.diag([self._clock, 0.0])
        return np.einsum("...i,...i", e, np.linalg.solve(P, e[..., None])[..., 0])

    def _estimate(self, bank: FilterBank, received: np.ndarray, nis: np.ndarray) -> Estimate:
        x, P = bank.x, bank.P
        acceleration, drift = self.model.acceleration(x, P)
        y, C = self.model.angle_and_slip(x, P)
        variance = C[..., 1, 1] + self.model.unreported.slip**2
        return Estimate(y[..., 1].copy(), acceleration, variance, drift, received, nis, y[..., 0].copy())


def estimator(
    name: EstimatorName, known: RotorUnits, pmu: Pmu, *, tuning: Tuning = TUNING, engine: Engine = "batched"
) -> Estimator:
    """The estimator of that name."""
    make: dict[str, Callable[[], Estimator]] = {
        "ideal": Ideal,
        "frequency": lambda: Frequency(pmu, known.frequency_hz),
        "kinematic": lambda: Filtered(known, pmu, swing=False, tuning=tuning, engine=engine),
        "kalman": lambda: Filtered(known, pmu, swing=True, tuning=tuning, engine=engine),
    }
    return make[name]()
