"""The machine model of the extended Kalman filters: state transition over a frame, and measurement equation.

The equations are those of `swing`, `q_axis` and `governor`; the covariances those of `swing` and `noise`.
"""

from typing import NamedTuple

import numpy as np

from .filter_bank import Seen
from .frame_kernels import Constants, Kept, expect, keep, move, spread
from .governor import Governors
from .instrument import Frame
from .measured import Measured, measured
from .missing_reports import UNKNOWN, UNSURE, MissingReports
from .noise import Tuning, computed_angle_variance
from .pmu import Pmu
from .pmu_window import PmuWindow
from .q_axis import QAxis, turn
from .rotor_units import RotorUnits
from .swing import STATES, swing

FORGOTTEN = 0.5  # s   without a report, after which a filter starts anew with the next one
UNSETTLED = 0.05  # pu   standard deviation of a flux that may not be at rest
NOTHING = 0.1  # pu   standard deviation of speed and power of a machine that has not reported yet
RUNAWAY = 5e-3  # pu   standard deviation of a speed after a long silence, at least
FLOOR = 1e-8  # rad^2   error of the model: without measurement noise the filter would be singular


class Step(NamedTuple):
    """The states a frame later, with the derivative and the covariance of the process."""

    x: np.ndarray  # (seeds, machines, 5)
    F: np.ndarray  # (seeds, machines, 5, 5)
    Q: np.ndarray  # (seeds, machines, 5, 5)


class MachineModel:
    """The machines between reports; with `power` the measured power drives the swing equation.

    Begun with the first report, of a system at rest. Then `predict`, `observe` and `settle` take the same report.
    """

    def __init__(self, known: RotorUnits, pmu: Pmu, *, power: bool, tuning: Tuning) -> None:
        self.known, self.tuning, self.power, self.T = known, tuning, power, 1 / pmu.rate
        n, self.memory = len(known.H), max(1, round(FORGOTTEN * pmu.rate))
        self._noise = {"angle": pmu.angle, "magnitude": pmu.magnitude}
        self._has_flux = (known.flux["xq"] > 0).astype(float)
        self.H: np.ndarray = known.H if power else np.full(n, 0.5)
        self.D: np.ndarray = known.D if power else np.zeros(n)
        walk = tuning.walk if power else tuning.jerk
        hz, flux = known.frequency_hz, self._has_flux
        self.swing = swing(self.H, self.D, hz=hz, T=self.T, walk=walk, flux=flux, with_power=power)
        self.q_axis = QAxis(known, self.T, self.memory)
        self.governors = Governors(known.governor, self.T)
        self._window, self._length = PmuWindow(pmu.own_frames(hz), self.T, hz), 2 * pmu.own_frames(hz) + 1
        s, q = self.swing, self.q_axis
        self.constants = Constants(
            known.impedance, known.mva, self._has_flux * power, s.F, s.B, s.walk, s.c, s.d,
            q.A, q.B, q.out, q.speed, q.slope, q.knee, q.step, q.ramp,
        )  # fmt: skip
        self._settings = pmu.angle, pmu.magnitude, tuning.share * power, float(np.sqrt(self._window.together))

    def measured(self, frame: Frame) -> Measured:
        """The internal voltages and powers of a frame."""
        return measured(frame, self.constants, self._noise, self.power)

    def begin(self, seen: Measured) -> tuple[np.ndarray, np.ndarray]:
        """States and covariances at rest, with the first report."""
        shape = seen.P.shape
        flux = self.q_axis.rest(seen.I, seen.E)
        turned = np.exp(-1j * (np.angle(seen.E) - turn(self.q_axis.psi(flux), np.abs(seen.E))))
        self.kept = Kept(
            seen.P.copy(), seen.variance.copy(), np.abs(seen.E), np.zeros(shape), np.zeros(shape, int),
            seen.I * turned, seen.E * turned, np.zeros(shape),
        )  # fmt: skip
        self._F, self._unchanged = np.zeros((*shape, STATES, STATES)), np.zeros((3, *shape))
        wb = 2 * np.pi * self.known.frequency_hz
        self.unreported = MissingReports(seen.P, self.swing.c, self.swing.d, wb=wb, T=self.T)
        self._rate = np.zeros(shape)
        return self.at_rest(seen)

    def at_rest(self, seen: Measured) -> tuple[np.ndarray, np.ndarray]:
        """States and covariances at rest; those of machines without a report are unknown."""
        x, P = np.zeros((*seen.E.shape, STATES)), np.zeros((*seen.E.shape, STATES, STATES))
        x[..., 3:] = self.q_axis.rest(seen.I, seen.E)
        x[..., 0], x[..., 2] = np.angle(seen.E) - turn(self.q_axis.psi(x[..., 3:]), np.abs(seen.E)), seen.P
        start = self.observe(x, seen)
        P[..., 0, 0], P[..., 1, 1], P[..., 2, 2] = start.variance, 1e-4**2, seen.variance
        P[..., 2, 2] += 0 if self.power else 1e-3**2
        P[..., 3, 3] = P[..., 4, 4] = (1e-3**2 + seen.of_current) * self._has_flux
        nothing = np.diag([np.pi, *[NOTHING] * 4]) ** 2 * np.array([1, 1, 1, 0, 0])
        return x, np.where(seen.frame.received[..., None, None], P, nothing)

    def restarted(
        self, x: np.ndarray, P: np.ndarray, seen: Measured, where: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """States and covariances after a long silence: angle and fluxes as at rest, speed and power as they were."""
        fresh, size = x.copy(), np.abs(seen.E)
        fresh[..., 3:] = self.q_axis.rest(seen.I, seen.E)
        fresh[..., 0] = np.angle(seen.E) - turn(self.q_axis.psi(fresh[..., 3:]), size)
        flux = UNSETTLED**2 * self._has_flux + np.zeros(size.shape)
        known = P[..., 1, 1] + np.maximum(self.unreported.moved[..., 1], RUNAWAY) ** 2
        variances = np.stack([flux + 1e-3**2, known, P[..., 2, 2] + 1e-2**2, flux, flux], -1)
        fresh_P = variances[..., None] * np.eye(STATES)
        return np.where(where[..., None], fresh, x), np.where(where[..., None, None], fresh_P, P)

    def predict(self, x: np.ndarray, seen: Measured) -> Step:
        """A frame later: the power moves to that of the new report, or stays where there is none."""
        kept, here, g = self.kept, seen.frame.received, self._governed(x)
        after, change, window = np.empty(x.shape), np.empty(seen.P.shape, complex), self._unchanged
        move(x, seen.P, seen.I, here, self.constants, kept, g, after, self._F, change)
        window[2] = change.real
        if self._window.wide:
            moved = seen.E * np.exp(-1j * after[..., 0]) - kept.voltage
            window[0] = self._window.flux_noise(x[..., 1], change)
            window[1] = self._window.power_noise(moved, change) * here
            window[2] = self._window.entering(change.real)
        Q, since = np.empty((*x.shape, STATES)), seen.frame.since
        switched = np.zeros((len(here), 1), bool) if since is None else since < self._length
        powers = {"whole": self.whole(x), "before": kept.P, "now": seen.P, "variance": kept.variance}
        parts = seen.frame.parts
        computed = np.zeros(here.shape, bool) if parts is None else parts.computed
        self.unreported.step(here, kept.missing, switched, computed, **powers)
        given = self.constants, kept, change, window, self._settings, self.unreported.hidden
        spread(x, seen.P, seen.variance, seen.of_current, here, *given, Q)
        self._g = g
        if self._window.wide:
            self._rate = np.where(here, seen.P - kept.P, 0.0) / ((kept.missing + 1) * self.T)
        return Step(after, self._F, Q)

    def observe(self, x: np.ndarray, seen: Measured) -> Seen:
        """What the report says of these states: arg E = delta + theta, its slope that of a chord of the arc sine."""
        angle, expected, middle, variance = np.empty((4, *seen.P.shape))
        slope = np.empty(x.shape)
        given = self.constants, self._settings[0], self._settings[1], FLOOR
        expect(x, seen.V, seen.ZI, seen.E, *given, angle, expected, middle, variance, slope)
        parts = seen.frame.parts
        if parts is not None:
            tilt = (1 + 1j * np.tan(middle)) / seen.E
            of_parts = computed_angle_variance(parts.V, parts.I, self.known.impedance, tilt, **self._noise) + FLOOR
            variance = np.where(parts.computed, of_parts, variance)
        if self._window.wide:
            size = np.abs(seen.E)
            variance = variance + (self._window.turned(x[..., 1]) * (1 - self.kept.size / size)) ** 2
        self.turn = middle
        return Seen(angle, expected, slope, variance, seen.frame.received)

    def settle(self, x: np.ndarray, seen: Measured) -> None:
        """Keep what the next prediction begins with."""
        keep(x, seen.P, seen.variance, seen.I, seen.E, seen.frame.received, self._g, self.kept)

    def angle_and_slip(self, x: np.ndarray, P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angle and speed (seeds, machines, 2) at the time stamp, and their covariance."""
        r, lost, both = self.unreported.moved, self.unreported.lost, P[..., :2, :2]
        if r.any() or lost.any():
            both = both + r[..., :, None] * r[..., None, :] * UNKNOWN[:2, :2] + (lost > 0)[..., None, None] * UNSURE
        if not self._window.wide:
            return x[..., :2], both
        a, _ = self.acceleration(x, P)
        jerk = -self._rate / (2 * self.H)
        return self._window.middle(x[..., :2], both, acceleration=a, jerk=jerk)

    def acceleration(self, x: np.ndarray, P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The acceleration (pu/s) at these states, and its variance from their covariances P."""
        rate = 1 / (2 * self.H)
        variance = P[..., 2, 2] + self.kept.variance + self.unreported.power**2
        return (x[..., 2] + self.kept.g - self.kept.P - self.D * x[..., 1]) * rate, variance * rate**2

    def whole(self, x: np.ndarray) -> np.ndarray:
        """The larger of electrical and mechanical power, pu machine: a switching may change the former by as much."""
        return np.maximum(np.abs(self.kept.P), np.abs(x[..., 2] + self.kept.g)) if self.power else self.kept.P

    def _governed(self, x: np.ndarray) -> np.ndarray:
        """g at the end of the frame, from the speed in its middle."""
        if not self.power or not len(self.governors.at):
            return self.kept.g
        middle = x[..., 1] + (x[..., 2] + self.kept.g - self.kept.P) * self.T / (4 * self.H)
        return self.governors.step(middle, x[..., 2])
