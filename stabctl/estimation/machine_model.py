"""What the extended Kalman filters know of the machines: how their states move over a frame, and what a report says.

The equations are those of `swing`, `q_axis` and `governor`; the covariances those of `swing` and `noise`.
"""

from typing import NamedTuple

import numpy as np

from .bank import Seen, wrapped
from .governor import Governors
from .instrument import Frame
from .measured import Measured, measured
from .noise import Tuning, angle_variance, computed_angle_variance, current_variance
from .pmu import Pmu
from .pmu_window import PmuWindow
from .q_axis import QAxis, turn, within
from .rotor_units import RotorUnits
from .silence import Silence
from .swing import STATES, process_covariance, swing

FORGOTTEN = 0.5  # s   without a report, after which a filter starts anew with the next one
UNSETTLED = 0.05  # pu   standard deviation of a flux that may not be at rest
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
        self._omega = self._has_flux * power  # is there a speed in the swing equation?
        walk = tuning.walk if power else tuning.jerk
        hz, flux = known.frequency_hz, self._has_flux
        self.swing = swing(self.H, self.D, hz=hz, T=self.T, walk=walk, flux=flux, with_power=power)
        self.q_axis = QAxis(known, self.T, self.memory)
        self.governors = Governors(known.governor, self.T)
        self._window = PmuWindow(pmu.own_frames(hz), self.T, hz)
        self._row, self._F = np.arange(n), np.zeros((n, STATES, STATES))
        self._F[:, :3, :3], self._F[:, 3:, 3:] = self.swing.F, self.q_axis.A

    def measured(self, frame: Frame) -> Measured:
        """The internal voltages and powers of a frame."""
        return measured(frame, self.known, self._noise, self.power)

    def begin(self, seen: Measured) -> tuple[np.ndarray, np.ndarray]:
        """States and covariances at rest."""
        x, P = np.zeros((*seen.E.shape, STATES)), np.zeros((*seen.E.shape, STATES, STATES))
        x[..., 3:] = self.q_axis.rest(seen.I, seen.E)
        x[..., 0], x[..., 2] = np.angle(seen.E) - turn(self.q_axis.psi(x[..., 3:]), np.abs(seen.E)), seen.P
        self.P, self.variance, self.size, self.g = seen.P, seen.variance, np.abs(seen.E), np.zeros(seen.P.shape)
        start = self.observe(x, seen)
        P[..., 0, 0], P[..., 1, 1], P[..., 2, 2] = start.variance, 1e-4**2, seen.variance
        P[..., 2, 2] += 0 if self.power else 1e-3**2
        P[..., 3, 3] = P[..., 4, 4] = (1e-3**2 + seen.of_current) * self._has_flux
        self.silence = Silence(seen.P, self.T / (2 * self.H))
        self.missing, self._rate = np.zeros(seen.P.shape, int), np.zeros(seen.P.shape)
        self.rotor_current = seen.I * np.exp(-1j * x[..., 0])
        self.rotor_voltage = seen.E * np.exp(-1j * x[..., 0])
        return x, P

    def restarted(
        self, x: np.ndarray, P: np.ndarray, seen: Measured, where: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """States and covariances after a long silence: angle and fluxes as at rest, speed and power as they were."""
        fresh, size = x.copy(), np.abs(seen.E)
        fresh[..., 3:] = self.q_axis.rest(seen.I, seen.E)
        fresh[..., 0] = np.angle(seen.E) - turn(self.q_axis.psi(fresh[..., 3:]), size)
        flux = UNSETTLED**2 * self._has_flux + np.zeros(size.shape)
        known = P[..., 1, 1] + np.maximum(self.silence.slip, RUNAWAY) ** 2
        variances = np.stack([flux + 1e-3**2, known, P[..., 2, 2] + 1e-2**2, flux, flux], -1)
        fresh_P = variances[..., None] * np.eye(STATES)
        return np.where(where[..., None], fresh, x), np.where(where[..., None, None], fresh_P, P)

    def predict(self, x: np.ndarray, seen: Measured) -> Step:
        """A frame later: the power moves to that of the new report, or stays where there is none."""
        here, m = seen.frame.received, self.missing + 1
        dP = np.where(here, seen.P - self.P, 0.0)
        g = self._governed(x)
        u = np.empty((*dP.shape, 3))
        u[..., 0], u[..., 1] = self.P - self.g, m * dP
        u[..., 2] = m * u[..., 1]
        u[..., 1:] -= (g - self.g)[..., None]
        u[..., 0] += self._omega * x[..., 1] * (x[..., 2] - u[..., 0] - u[..., 1] / 2)
        after = np.empty(x.shape)
        after[..., :3] = (self.swing.F @ x[..., :3, None] + self.swing.B @ u[..., None])[..., 0]
        before, now = self.rotor_current, seen.I * np.exp(-1j * after[..., 0])
        change = np.where(here, now - before, 0.0)
        lost, B = m.max() > 1, self.q_axis.B
        frames = (np.minimum(m, self.memory), self._row) if lost else 1
        ramp, step = self.q_axis.ramp[frames], self.q_axis.step[frames]
        flux = (self.q_axis.A @ x[..., 3:, None])[..., 0] + B[..., 0] * before.real[..., None]
        after[..., 3:] = flux + ramp * change.real[..., None]
        F = np.empty((*x.shape, STATES))
        F[:] = self._F
        F[..., 3:, 0] = B[..., 0] * before.imag[..., None] + ramp * change.imag[..., None]
        if self.q_axis.saturated:
            iron = self.q_axis.saturation(self.size)[..., None]
            after[..., 3:] += B[..., 1] * iron * self.q_axis.psi(x[..., 3:])[..., None]
            F[..., 3:, 3:] += (B[..., 1] * iron)[..., :, None] * self.q_axis.out[:, None, :]
        power = (self.variance + np.where(here, seen.variance, self.variance)) / 2
        if self.power:
            power = power + (self.tuning.share * (x[..., 2] + self.g - self.P)) ** 2
        of_current = current_variance(before, **self._noise)
        if seen.frame.parts is not None:
            of_current = np.where(seen.frame.parts.computed, seen.of_current, of_current)
        noise = B[..., 0] * np.sqrt(of_current)[..., None]
        if lost:  # the current may have moved further in between
            noise = noise + step * ((m > 1) * np.abs(change))[..., None]
        if self._window.wide:
            noise = noise + step * self._window.flux_noise(x[..., 1], change)[..., None]
            moved = seen.E * np.exp(-1j * after[..., 0]) - self.rotor_voltage
            power = power + self._window.power_noise(moved, change) * here
        parts = np.sqrt(self._window.together)
        jumped = self._window.entering(change.real) if self._window.wide else change.real
        jump = {"jump": parts * dP, "frames": m, "flux": parts * step * jumped[..., None]}
        self._g = g
        self.silence.step(here, self.missing, before=self.P, now=seen.P, variance=self.variance)
        self._rate = dP / (m * self.T)
        return Step(after, F, process_covariance(self.swing, power=power, noise=noise, **jump))

    def observe(self, x: np.ndarray, seen: Measured) -> Seen:
        """What the report says of these states: arg E = delta + theta, its slope that of a chord of the arc sine."""
        size, angle = np.abs(seen.E), np.angle(seen.E)
        theta = turn((1 + self.q_axis.speed * x[..., 1]) * self.q_axis.psi(x[..., 3:]), size)
        apart = within(wrapped(angle - x[..., 0]) - theta, 1.0) / 2
        middle, square = within(theta + apart, 1.4), apart * apart
        chord = 1 / (size * np.cos(middle) * (1 - square / 6 * (1 - square / 20)))  # sin(apart)/apart to 1e-5
        slope = np.zeros(x.shape)
        slope[..., 0], slope[..., 3:] = 1, self.q_axis.out * chord[..., None]
        variance = angle_variance(seen.frame.V, seen.ZI, seen.E, middle, **self._noise) + FLOOR
        parts = seen.frame.parts
        if parts is not None:
            tilt = (1 + 1j * np.tan(middle)) / seen.E
            of_parts = computed_angle_variance(parts.V, parts.I, self.known.impedance, tilt, **self._noise) + FLOOR
            variance = np.where(parts.computed, of_parts, variance)
        if self._window.wide:
            variance = variance + (self._window.turned(x[..., 1]) * (1 - self.size / size)) ** 2
        return Seen(angle, x[..., 0] + theta, slope, variance, seen.frame.received)

    def settle(self, x: np.ndarray, seen: Measured) -> None:
        """Keep what the next prediction begins with."""
        here = seen.frame.received
        self.P, self.variance = np.where(here, seen.P, self.P), np.where(here, seen.variance, self.variance)
        self.rotor_current = np.where(here, seen.I * np.exp(-1j * x[..., 0]), self.rotor_current)
        self.rotor_voltage = np.where(here, seen.E * np.exp(-1j * x[..., 0]), self.rotor_voltage)
        self.size = np.abs(self.rotor_voltage)
        self.missing, self.g = np.where(here, 0, self.missing + 1), self._g

    def angle_and_slip(self, x: np.ndarray, P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angle and speed (seeds, machines, 2) at the time stamp, and their covariance."""
        if not self._window.wide:
            return x[..., :2], P[..., :2, :2]
        a, _ = self.acceleration(x, P)
        jerk = -self._rate / (2 * self.H)
        return self._window.middle(x[..., :2], P[..., :2, :2], acceleration=a, jerk=jerk)

    def acceleration(self, x: np.ndarray, P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The acceleration (pu/s) at these states, and its variance from their covariances P."""
        rate = 1 / (2 * self.H)
        variance = P[..., 2, 2] + self.variance + self.silence.power**2
        return (x[..., 2] + self.g - self.P - self.D * x[..., 1]) * rate, variance * rate**2

    def _governed(self, x: np.ndarray) -> np.ndarray:
        """g at the end of the frame, from the speed in its middle."""
        if not self.power or not len(self.governors.at):
            return self.g
        middle = x[..., 1] + (x[..., 2] + self.g - self.P) * self.T / (4 * self.H)
        return self.governors.step(middle, x[..., 2])
