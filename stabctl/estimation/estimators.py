"""Estimators of the machines' speeds behind one interface: Kalman filter on the swing equation, and its baselines.

ideal       the true speed
frequency   the PMU's frequency at the terminal, as it comes
kinematic   Kalman filter of a constant acceleration on the internal angle
kalman      Kalman filter of the swing equation on the internal angle, with the measured power as its input
"""

from collections.abc import Callable
from typing import Literal, NamedTuple, Protocol

import numpy as np

from .bank import ENGINES, Bank, wrapped
from .flux import Flux
from .machines import Machines
from .noise import TUNING, Tuning, angle_variance, model, power_variance, process
from .pmu import Frame, Pmu

Kind = Literal["ideal", "frequency", "kinematic", "kalman"]
Engine = Literal["filterpy", "batched"]
FORGOTTEN = 0.5  # s   without a report, after which a filter starts anew at the next one


class Estimate(NamedTuple):
    """What an estimator knows at the instant of a frame, arrays (seeds, machines)."""

    slip: np.ndarray  # pu     speed deviation from nominal
    acceleration: np.ndarray  # pu/s
    variance: np.ndarray  # pu^2   of the slip
    drift: np.ndarray  # pu^2/s^2   variance of the acceleration
    received: np.ndarray  # bool   a report came
    nis: np.ndarray  # -      normalized innovation squared, NaN where there was none


class Estimator(Protocol):
    """Takes a frame at a time; the first is that of a system at rest."""

    def step(self, frame: Frame) -> Estimate:
        """The estimate at the instant of the frame."""
        ...


class Ideal:
    """The true speeds."""

    def step(self, frame: Frame) -> Estimate:
        """The frame's own truth."""
        none = np.zeros(frame.slip.shape)
        return Estimate(frame.slip.copy(), none, none, none, none == 0, none * np.nan)


class Frequency:
    """The frequency at the terminals; a lost report leaves the last."""

    def __init__(self, pmu: Pmu, hz: float) -> None:
        self._variance, self._last = (1e-3 * pmu.frequency_mhz / hz) ** 2, None

    def step(self, frame: Frame) -> Estimate:
        """Frequency as speed, no acceleration."""
        before = np.zeros(frame.frequency.shape) if self._last is None else self._last
        self._last = np.where(frame.received, frame.frequency, before)
        none = np.zeros(self._last.shape)
        return Estimate(self._last, none, none + self._variance, none, frame.received, none * np.nan)


class Filtered:
    """A bank of Kalman filters on the internal angles; `swing` tells whether the measured power is their input."""

    def __init__(self, known: Machines, pmu: Pmu, swing: bool, tuning: Tuning, engine: Engine) -> None:
        self.known, self.tuning, self.swing = known, tuning, swing
        self._angle, self._magnitude, self._T = 1e-3 * pmu.angle_mrad, pmu.magnitude, 1 / pmu.rate
        # an exact phasor still carries the model's error: a filter without measurement noise would be singular
        self._floor = 1e-8
        self._engine, self._Z = ENGINES[engine], (known.ra + 1j * known.x) / known.mva
        self._H = known.H if swing else np.full(len(known.H), 0.5)
        self._D = known.D if swing else np.zeros(len(known.H))
        self.bank: Bank | None = None

    def step(self, frame: Frame) -> Estimate:
        """Predict with the mean power since the last report, gate and take the new angles."""
        ZI, E, P, var = self._measured(frame)
        if self.bank is None:
            return self._begin(frame, ZI, E, P, var)
        here, m = frame.received, self._missing + 1
        dP = np.where(here, P - self._P, 0.0)
        x, k = self.bank.x, self._flux.coupling
        u, F = np.empty(x.shape), np.empty((*x.shape, 4))
        u[..., 0], u[..., 1], u[..., 3] = self._P, m * dP, -k * x[..., 0]
        u[..., 2] = m * u[..., 1]
        F[:] = self.model.F
        F[..., 3, 0] = k
        delta = (x * self.model.F[:, 0] + u * self.model.B[:, 0]).sum(-1)
        turned = self._flux.predict(frame.I, E, delta, here, m)
        held = (self._var + np.where(here, var, self._var)) / 4
        if self.swing:
            pull = self.tuning.share * (x[..., 2] - self._P)
            held = held + pull * pull
        self.bank.predict(u, F, process(self.model, held, dP, m, turned))
        if m.max() > FORGOTTEN / self._T:
            self.bank.open(m > FORGOTTEN / self._T)
        z, R = self._turned(frame.V, ZI, E)
        nis = self.bank.update(z, R, here)
        self._flux.settle(frame.I, E, self.bank.x[..., 0], here)
        self._P, self._var = np.where(here, P, self._P), np.where(here, var, self._var)
        self._missing = np.where(here, 0, m)
        return self._estimate(here, nis)

    def error(self, delta: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Normalized squared error (NEES) of angle and speed (seeds, machines), chi-square with two degrees."""
        e = np.stack([wrapped(self.bank.x[..., 0] - delta), self.bank.x[..., 1] - slip], -1)
        return np.einsum("...i,...i", e, np.linalg.solve(self.bank.P[..., :2, :2], e[..., None])[..., 0])

    def _measured(self, frame: Frame) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Z I and internal voltage E (pu), air-gap power (pu machine) and its variance."""
        ZI = self._Z * frame.I
        E = frame.V + ZI
        E = np.where(np.abs(E) < 1e-3, 1e-3, E)
        if not self.swing:
            return ZI, E, np.zeros(E.shape), np.zeros(E.shape)
        S = E * frame.I.conj() / self.known.mva
        return ZI, E, S.real, power_variance(S, self._angle, self._magnitude)

    def _turned(self, V: np.ndarray, ZI: np.ndarray, E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The rotor's angle (rad) as measured, and its variance."""
        turn = self._flux.turn(E)
        return np.angle(E) - turn, angle_variance(V, ZI, E, turn, self._angle, self._magnitude) + self._floor

    def _begin(self, frame: Frame, ZI: np.ndarray, E: np.ndarray, P: np.ndarray, var: np.ndarray) -> Estimate:
        self._flux = Flux(self.known, self._T, frame.V, frame.I, E)
        z, R = self._turned(frame.V, ZI, E)
        none, hz = np.zeros(z.shape), self.known.frequency_hz
        walk = self.tuning.walk if self.swing else self.tuning.jerk
        self.model = model(self._H, self._D, hz, self._T, walk, self._flux.memory, self.swing)
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
    kind: Kind,
    known: Machines,
    pmu: Pmu,
    tuning: Tuning = TUNING,
    engine: Engine = "filterpy",
) -> Estimator:
    """The estimator of that kind."""
    make: dict[str, Callable[[], Estimator]] = {
        "ideal": Ideal,
        "frequency": lambda: Frequency(pmu, known.frequency_hz),
        "kinematic": lambda: Filtered(known, pmu, False, tuning, engine),
        "kalman": lambda: Filtered(known, pmu, True, tuning, engine),
    }
    return make[kind]()
