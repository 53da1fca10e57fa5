"""Estimators of the rotor speeds with a common interface: a Kalman filter that knows clock errors, and simpler ones.

ideal       the true speed
frequency   the PMU's frequency at the terminal
kinematic   Kalman filter of a constant acceleration on the internal angle
kalman      Kalman filter of the swing equation on the internal angle, with the measured power as its input

The clocks of the PMUs behind computed phasors have constant errors, which are not noise (Schmidt's consider states).
The phasors of a machine without PMU are sums of reports with parts V_r, I_r. Clock errors b, constant and of known
variance, turn each part by j b_r, and so the measured angle, power and current by

    a b,  a_r = Re((V_r + Z I_r)(1 + j t)/E),   p b,  p_r = -Im(V_r I* + V* I_r),   i b,  i_r = -Im(I_r e^(-j delta)).

The errors b are not estimated, but their covariance C = E[e b'] with the error e of the states is kept. Over a frame
C' = F C + G, where G follows from p and i as the states do from P and iq. An innovation y = a b + v - h e has

    S = h P h' - 2 h C a' + a B a' + R,   K = (P h' - C a')/S,   P' = P - K S K',   C' = C + K (a B - h C),

B the variance of b. This is the usual update with h - a C' P^-1 in place of h and R + a B a' - a C' P^-1 C a' in place
of R (S. F. Schmidt, Application of state-space methods to navigation problems, 1966).
"""

from collections.abc import Callable
from typing import Literal, NamedTuple, Protocol

import numpy as np

from ._filter_bank import ENGINES, FilterBank, Seen, wrapped
from ._kernels import Constants, Kept
from ._machine_model import MachineModel, Measured
from ._swing import rejections
from .pmu import Frame, Parts, Pmu
from .rotor_units import USUAL_NOISE, ProcessNoise, RotorUnits

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
    whole: np.ndarray | float = 0.0  # pu/s   acceleration without its electrical power


class Estimator(Protocol):
    """Takes one frame at a time; the first is that of a system at rest."""

    def step(self, frame: Frame) -> Estimate:
        """The estimate at the instant of the frame."""
        ...


def estimator(
    name: EstimatorName,
    known: RotorUnits,
    pmu: Pmu,
    *,
    process: ProcessNoise = USUAL_NOISE,
    engine: Engine = "batched",
) -> Estimator:
    """The estimator of that name."""
    make: dict[str, Callable[[], Estimator]] = {
        "ideal": Ideal,
        "frequency": lambda: Frequency(pmu, known.frequency_hz),
        "kinematic": lambda: Filtered(known, pmu, swing=False, process=process, engine=engine),
        "kalman": lambda: Filtered(known, pmu, swing=True, process=process, engine=engine),
    }
    return make[name]()


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


class Clocks:
    """Covariance C (seeds, machines, 5, clocks) of the states with the clocks; 0 without computed phasors.

    Parameters
    ----------
    known : Constants
        Constants of the machines.
    variance : float, rad^2
        Variance of the angle by which a clock turns the phasors of its PMU.
    """

    def __init__(self, known: Constants, variance: float) -> None:
        self._known, self.variance = known, variance
        self.C: np.ndarray | None = None

    def begin(self, seen: Measured, angle: np.ndarray, turn: np.ndarray, where: np.ndarray) -> np.ndarray:
        """Start with these reports, their power as that of the turbine; the covariance that the clocks add."""
        a, (p, i) = self._of_angle(seen, turn), self._of_input(seen, angle)
        start = np.zeros((*p.shape[:2], 5, p.shape[-1]))
        start[..., 0, :], start[..., 2, :] = a, p
        if self.C is None:
            self.C, self._p, self._i = np.zeros(start.shape), p, i
        self.C[where], self._p[where], self._i[where] = self.variance * start[where], p[where], i[where]
        return self.variance * start @ start.swapaxes(-1, -2) * where[..., None, None]

    def predict(self, F: np.ndarray, seen: Measured, angle: np.ndarray, kept: Kept) -> np.ndarray:
        """Advance a frame, to the predicted angles; what the clocks add to the process covariance."""
        assert self.C is not None
        k, B, here = self._known, self._known.B, seen.frame.received[..., None]
        p, i = (np.where(here, *both) for both in zip(self._of_input(seen, angle), (self._p, self._i), strict=True))
        m = (kept.missing + 1)[..., None, None]
        frames = np.minimum(m[..., 0, 0], len(k.ramp) - 1)
        moved = m * (p - self._p)[..., None, :]
        swing = B[:, :, :1] * self._p[..., None, :] + B[:, :, 1:2] * moved + B[:, :, 2:] * m * moved
        ramp = k.ramp[frames, np.arange(frames.shape[1])][..., None]
        flux = k.drive[..., :1] * self._i[..., None, :] + ramp * (i - self._i)[..., None, :]
        G, carried = np.concatenate([swing, flux], -2), F @ self.C
        both = carried @ G.swapaxes(-1, -2)
        self.C, self._p = carried + self.variance * G, p
        return both + both.swapaxes(-1, -2) + self.variance * G @ G.swapaxes(-1, -2)

    def observe(self, seen: Seen, report: Measured, turn: np.ndarray, P: np.ndarray) -> Seen:
        """What the report says, E ahead of the rotor by `turn`: slope and variance that consider the clocks."""
        assert self.C is not None
        self._a = a = self._of_angle(report, turn)
        self._slope = seen.slope
        shared = (self.C @ a[..., None])[..., 0]
        at, turned = shared.any(-1), np.zeros(shared.shape)
        scale = np.sqrt(np.maximum(np.einsum("...ii->...i", P[at]), 1e-30))
        inverse = np.linalg.pinv(P[at] / scale[..., None] / scale[..., None, :], rcond=1e-12, hermitian=True)
        turned[at] = (inverse @ (shared[at] / scale)[..., None])[..., 0] / scale
        variance = self.variance * (a * a).sum(-1) - (shared * turned).sum(-1)
        return seen._replace(slope=seen.slope - turned, variance=seen.variance + np.maximum(variance, 0.0))

    def settle(self, gain: np.ndarray, seen: Measured, angle: np.ndarray) -> None:
        """Take the update with these gains, to these angles."""
        assert self.C is not None
        left = self.variance * self._a - (self._slope[..., None, :] @ self.C)[..., 0, :]
        self.C = self.C + gain[..., None] * left[..., None, :]
        self.C[seen.frame.received & ~_parts(seen).computed] = 0.0  # a PMU of its own again
        self._i = np.where(seen.frame.received[..., None], self._of_input(seen, angle)[1], self._i)

    def _of(self, parts: np.ndarray) -> np.ndarray:
        """Reports (..., reports) of one PMU added up: voltage and current of a machine have one clock."""
        n = parts.shape[1]
        return np.concatenate([parts[..., :n] + parts[..., n : 2 * n], parts[..., 2 * n :]], -1)

    def _of_angle(self, seen: Measured, turn: np.ndarray) -> np.ndarray:
        """a, where the angle of E is `turn` (rad) ahead of the rotor."""
        parts = _parts(seen)
        tilt = (1 + 1j * np.tan(turn)) / seen.E
        return self._of((parts.V + self._known.impedance[:, None] * parts.I) * tilt[..., None]).real

    def _of_input(self, seen: Measured, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """p and i with the rotors at these angles (rad), pu of the machines."""
        parts, mva = _parts(seen), self._known.mva[:, None]
        S = parts.V * (seen.I.conj())[..., None] + seen.V.conj()[..., None] * parts.I / mva
        return -self._of(S).imag, -self._of(parts.I / mva * np.exp(-1j * angle)[..., None]).imag


def _parts(seen: Measured) -> Parts:
    """The parts of the phasors, of a frame that has computed ones."""
    assert seen.frame.parts is not None
    return seen.frame.parts


class Filtered:
    """A bank of extended Kalman filters on the internal angles; with `swing` the measured power is their input."""

    def __init__(
        self,
        known: RotorUnits,
        pmu: Pmu,
        *,
        swing: bool,
        process: ProcessNoise = USUAL_NOISE,
        engine: Engine = "batched",
    ) -> None:
        self.model, self._engine = MachineModel(known, pmu, power=swing, process=process), ENGINES[engine]
        self._clock = (2 * np.pi * known.frequency_hz * pmu.clock) ** 2
        self.clocks = Clocks(self.model.constants, self._clock)
        self.bank: FilterBank | None = None
        self._begun: np.ndarray = np.zeros(0)
        self._own: np.ndarray = np.array(True)  # machines with a PMU of their own

    def step(self, frame: Frame) -> Estimate:
        """Predict with the mean power since the last report, then use the new angles that pass the gate."""
        model, seen, here = self.model, self.model.measured(frame), frame.received
        if self.bank is None:
            self.bank, self._begun = self._engine(*model.begin(seen), model.swing.reset, rejections(model.T)), here
            self._consider(seen, here)
            return self._estimate(self.bank, here, np.full(seen.P.shape, np.nan))
        bank, clocks = self.bank, self._consider(seen, ~(here | True))
        step = model.predict(bank.x, seen)
        added = clocks.predict(step.F, seen, step.x[..., 0], model.kept) if clocks else 0.0
        bank.predict(step.x, step.F, step.Q + added)
        first = here & ~self._begun
        forgotten = here & self._begun & (model.unreported.blind | (model.kept.missing >= model.memory))
        if first.any() or forgotten.any():
            self._begun = self._begun | first
            x, P = model.restarted(bank.x, bank.P, seen, forgotten)
            rest = model.at_rest(seen)
            bank.restart(np.where(first[..., None], rest[0], x), np.where(first[..., None, None], rest[1], P))
            self._consider(seen, first | forgotten)
        report = model.observe(bank.x, seen)
        report = report._replace(received=here & ~first)
        nis = bank.update(clocks.observe(report, seen, model.turn, bank.P) if clocks else report)
        if clocks:
            clocks.settle(bank.gain, seen, bank.x[..., 0])
        model.settle(bank.x, seen)
        return self._estimate(bank, here, nis)

    def _consider(self, seen: Measured, begun: np.ndarray) -> Clocks | None:
        """The clocks behind computed phasors, if there are any; with these reports machines (seeds, machines) begin."""
        parts, bank = seen.frame.parts, self.bank
        if parts is None or not self._clock or bank is None:
            return None
        self._own = np.where(seen.frame.received, ~parts.computed, self._own)
        if begun.any() or self.clocks.C is None:
            added = self.clocks.begin(seen, bank.x[..., 0], self.model.turn, begun & parts.computed)
            bank.restart(bank.x, bank.P + added)
        return self.clocks

    def forget(self, where: np.ndarray) -> None:
        """Start anew with the next report of these machines (seeds, machines)."""
        self.model.kept.missing[where] = self.model.memory

    def error(self, delta: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Normalized squared error (NEES) of angle and speed (seeds, machines), chi-square with two degrees.

        The clock of a machine's own PMU turns its angle alone, and is not known to the filter: its variance is added.
        """
        assert self.bank is not None
        x, P = self._known(self.bank)
        e = np.stack([wrapped(x[..., 0] - delta), x[..., 1] - slip], -1)
        P = P + np.diag([self._clock, 0.0]) * self._own[..., None, None]
        return np.einsum("...i,...i", e, np.linalg.solve(P, e[..., None])[..., 0])

    def _known(self, bank: FilterBank) -> tuple[np.ndarray, np.ndarray]:
        """Angle and speed, and their covariance; a rejected report casts doubt on both."""
        y, C = self.model.angle_and_slip(bank.x, bank.P)
        if bank.doubt.any():
            C = C + bank.doubt[..., None, None] * np.eye(2) * self.model.swing.reset[:, None, :2]
        return y, C

    def _estimate(self, bank: FilterBank, received: np.ndarray, nis: np.ndarray) -> Estimate:
        x, P = bank.x, bank.P
        acceleration, drift = self.model.acceleration(x, P)
        y, C = self._known(bank)
        variance, whole = C[..., 1, 1].copy(), self.model.whole(x) / (2 * self.model.H)
        return Estimate(y[..., 1].copy(), acceleration, variance, drift, received, nis, y[..., 0].copy(), whole)
