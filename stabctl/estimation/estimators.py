"""Estimators of the rotor speeds with a common interface: a Kalman filter of the swing equation, and simpler ones.

ideal       the true speed
frequency   the PMU's frequency at the terminal
kinematic   Kalman filter of a constant acceleration on the internal angle
kalman      Kalman filter of the swing equation on the internal angle, with the measured power as its input
"""

from collections.abc import Callable
from typing import Literal, NamedTuple, Protocol

import numpy as np

from .bank import ENGINES, Bank, wrapped
from .flux import Flux
from .instrument import Frame
from .noise import TUNING, Tuning, angle_variance, power_variance, process_covariance, swing_model
from .pmu import Pmu
from .rotor_units import RotorUnits

EstimatorName = Literal["ideal", "frequency", "kinematic", "kalman"]
Engine = Literal["filterpy", "batched"]
FORGOTTEN = 0.5  # s   time without a report after which a filter accepts the next one unconditionally


class Estimate(NamedTuple):
    """Estimates at the time of a frame, arrays (seeds, machines)."""

    slip: np.ndarray  # pu     speed deviation from nominal
    acceleration: np.ndarray  # pu/s
    variance: np.ndarray  # pu^2   of the slip
    drift: np.ndarray  # pu^2/s^2   variance of the acceleration
    received: np.ndarray  # bool   a report arrived
    nis: np.ndarray  # -      normalized innovation squared, NaN without a report


class _Measured(NamedTuple):
    """A frame and what follows from it, arrays (seeds, machines)."""

    frame: Frame
    ZI: np.ndarray  # pu
    E: np.ndarray  # pu   internal voltage V + ZI
    P: np.ndarray  # pu machine   air-gap power
    variance: np.ndarray  # of P


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
        self._variance, self._last = (pmu.frequency / hz) ** 2, None

    def step(self, frame: Frame) -> Estimate:
        """Frequency as speed, no acceleration."""
        before = np.zeros(frame.frequency.shape) if self._last is None else self._last
        self._last = np.where(frame.received, frame.frequency, before)
        none = np.zeros(self._last.shape)
        return Estimate(self._last, none, none + self._variance, none, frame.received, none * np.nan)


class Filtered:
    """A bank of Kalman filters on the internal angles; with `swing` the measured power is their input."""

    def __init__(
        self, known: RotorUnits, pmu: Pmu, *, swing: bool, tuning: Tuning = TUNING, engine: Engine = "filterpy"
    ) -> None:
        self.known, self.tuning, self.swing = known, tuning, swing
        self._noise, self._T = {"angle": pmu.angle, "magnitude": pmu.magnitude}, 1 / pmu.rate
        self._floor = 1e-8  # rad^2   error of the model: without measurement noise the filter would be singular
        self._engine, self._Z = ENGINES[engine], (known.ra + 1j * known.x) / known.mva
        self._H = known.H if swing else np.full(len(known.H), 0.5)
        self._D = known.D if swing else np.zeros(len(known.H))
        self.bank: Bank | None = None

    def step(self, frame: Frame) -> Estimate:
        """Predict with the mean power since the last report, then use the new angles that pass the gate."""
        seen = self._measured(frame)
        if self.bank is None:
            return self._begin(seen)
        E, P, var = seen.E, seen.P, seen.variance
        here, m = frame.received, self._missing + 1
        dP = np.where(here, P - self._P, 0.0)
        x, k = self.bank.x, self._flux.coupling
        u, F = np.empty(x.shape), np.empty((*x.shape, 4))
        u[..., 0], u[..., 1], u[..., 3] = self._P, m * dP, -k * x[..., 0]
        u[..., 2] = m * u[..., 1]
        F[:] = self.model.F
        F[..., 3, 0] = k
        delta = (x * self.model.F[:, 0] + u * self.model.B[:, 0]).sum(-1)
        flux = self._flux.predict(frame.I, E, delta, received=here, frames=m)
        held = (self._var + np.where(here, var, self._var)) / 4
        if self.swing:
            error = self.tuning.share * (x[..., 2] - self._P)
            held = held + error * error
        self.bank.predict(u, F, process_covariance(self.model, power=held, jump=dP, frames=m, flux=flux))
        if m.max() > FORGOTTEN / self._T:
            self.bank.accept_next(m > FORGOTTEN / self._T)
        z, R = self._angle(seen)
        nis = self.bank.update(z, R, here)
        self._flux.settle(frame.I, E, self.bank.x[..., 0], here)
        self._P, self._var = np.where(here, P, self._P), np.where(here, var, self._var)
        self._missing = np.where(here, 0, m)
        return self._estimate(here, nis)

    def error(self, delta: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Normalized squared error (NEES) of angle and speed (seeds, machines), chi-square with two degrees."""
        e = np.stack([wrapped(self.bank.x[..., 0] - delta), self.bank.x[..., 1] - slip], -1)
        return np.einsum("...i,...i", e, np.linalg.solve(self.bank.P[..., :2, :2], e[..., None])[..., 0])

    def _measured(self, frame: Frame) -> "_Measured":
        ZI = self._Z * frame.I
        E = frame.V + ZI
        E = np.where(np.abs(E) < 1e-3, 1e-3, E)
        if not self.swing:
            return _Measured(frame, ZI, E, np.zeros(E.shape), np.zeros(E.shape))
        S = E * frame.I.conj() / self.known.mva
        return _Measured(frame, ZI, E, S.real, power_variance(S, **self._noise))

    def _angle(self, seen: "_Measured") -> tuple[np.ndarray, np.ndarray]:
        """The measured rotor angle (rad) and its variance."""
        turn = self._flux.turn(seen.E)
        variance = angle_variance(seen.frame.V, seen.ZI, seen.E, turn, **self._noise)
        return np.angle(seen.E) - turn, variance + self._floor

    def _begin(self, seen: "_Measured") -> Estimate:
        self._flux = Flux(self.known, self._T, I=seen.frame.I, E=seen.E)
        z, R = self._angle(seen)
        P, var = seen.P, seen.variance
        none = np.zeros(z.shape)
        walk = self.tuning.walk if self.swing else self.tuning.jerk
        options = {"hz": self.known.frequency_hz, "T": self._T, "walk": walk, "with_power": self.swing}
        self.model = swing_model(self._H, self._D, self._flux.memory, **options)
        x0, P0 = np.stack([z, none, P, none], -1), np.zeros((*z.shape, 4, 4))
        P0[..., 0, 0], P0[..., 1, 1], P0[..., 2, 2] = R, 1e-4**2, var + (0 if self.swing else 1e-3**2)
        self.bank = self._engine(self.model, x0, P0)
        self._P, self._var, self._missing = P, var, np.zeros(z.shape, int)
        return self._estimate(np.ones(z.shape, bool), none * np.nan)

    def _estimate(self, received: np.ndarray, nis: np.ndarray) -> Estimate:
        x, P, rate = self.bank.x, self.bank.P, 1 / (2 * self._H)
        acceleration = (x[..., 2] - self._P - self._D * x[..., 1]) * rate
        drift = (P[..., 2, 2] + self._var) * rate**2
        return Estimate(x[..., 1].copy(), acceleration, P[..., 1, 1].copy(), drift, received, nis)


def estimator(
    name: EstimatorName, known: RotorUnits, pmu: Pmu, *, tuning: Tuning = TUNING, engine: Engine = "filterpy"
) -> Estimator:
    """The estimator of that name."""
    make: dict[str, Callable[[], Estimator]] = {
        "ideal": Ideal,
        "frequency": lambda: Frequency(pmu, known.frequency_hz),
        "kinematic": lambda: Filtered(known, pmu, swing=False, tuning=tuning, engine=engine),
        "kalman": lambda: Filtered(known, pmu, swing=True, tuning=tuning, engine=engine),
    }
    return make[name]()
