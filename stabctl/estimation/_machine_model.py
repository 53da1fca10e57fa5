"""The machine model of the extended Kalman filters: state transition over a frame, and measurement equation.

The swing equation, the governors and the covariances are those of `_swing` and `_report_errors`. The q-axis rotor
circuits of machines with subtransient dynamics relate the angle of E'' to that of the rotor. The stator is w (psi''d +
j psi''q) exp(j delta) = E'' = V + (ra + j x'') I, where w is 1, or omega with the speed factor of GENROU, so that

    delta = arg E'' - asin(w psi''q / |E''|).

psi''q follows from the current alone, without field voltage (Kundur, ch. 3-4; names as in `devices.machines.genrou`):

    T'q de/dt = -e - (xq - x'q)(iq + (x'q - x'')/b^2 (e - k - b iq)) - iron,   b = x'q - xl,
    T''q dk/dt = e - k - b iq,   psi''q = a e + (1 - a) k,   a = (x'' - xl)/b,   iq = Re(I exp(-j delta)),
    iron = S(|psi''|)/|psi''| psi''q (xq - xl)/(xd - xl).

S is quadratic or exponential, as in `devices.machines.saturation`. A salient pole has x'q = xq and e = 0: its iron
is that of T''q, and only with GENSAE there is any. A classical machine has no flux, delta = arg E'.

With a P or M class filter a report is the weighted mean of the phasors in a window. The swing equation is linear: its
solution with the mean power is the mean of angle and speed in the window, from which the values in its middle differ by

    -(v/2) d2delta/dt2   and   -(v/2) d2s/dt2 = (v/2) dP/dt / 2H,   v = variance of the window (s^2).

Both are taken into account. A jump of the power reaches the end of the window in parts, all at the same unknown
instant, so that its variance is not the sum of that of the parts but 1/sum of weights^2 times as much. Voltage and
current change together in the window, and rotors turn: the mean of a product is not the product of the means. A current
that jumps and decays may pass the window with hardly a change between two reports, while its jump is still entering:
the share of the window that comes next counts for as much as it could hold of the changes before.
"""

from collections import deque
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from ._filter_bank import Seen
from ._kernels import Constants, Kept, expect, iron, keep, move, see, spread
from ._report_errors import (
    UNSURE,
    MissingReports,
    computed_angle_variance,
    computed_current_variance,
    computed_power_variance,
)
from ._swing import HIDDEN, STATES, Governors, swing
from .pmu import Frame, Pmu, window
from .rotor_units import ProcessNoise, RotorUnits

FORGOTTEN = 0.5  # s   without a report, after which a filter starts anew with the next one
UNSETTLED = 0.05  # pu   standard deviation of a flux that may not be at rest
NOTHING = 0.1  # pu   standard deviation of speed and power of a machine that has not reported yet
RUNAWAY = 5e-3  # pu   standard deviation of a speed after a long silence, at least
FLOOR = 1e-8  # rad^2   error of the model: without measurement noise the filter would be singular
ANGLE, SLIP = 2.0, 2.0  # errors in the middle of a window: of the angle, per change of its correction; of the speed
START = 200  # damped substitutions for the flux at a steady start


class Step(NamedTuple):
    """The states a frame later, with the derivative and the covariance of the process."""

    x: np.ndarray  # (seeds, machines, 5)
    F: np.ndarray  # (seeds, machines, 5, 5)
    Q: np.ndarray  # (seeds, machines, 5, 5)


class Measured(NamedTuple):
    """A frame and what follows from it, arrays (seeds, machines)."""

    frame: Frame
    V: np.ndarray  # pu
    ZI: np.ndarray  # pu
    E: np.ndarray  # pu   internal voltage V + ZI
    I: np.ndarray  # pu machine   current
    P: np.ndarray  # pu machine   air-gap power
    variance: np.ndarray  # of P
    of_current: np.ndarray  # (pu machine)^2   variance of a part of I, if it is computed, else 0


class MachineModel:
    """The machines between reports; with `power` the measured power drives the swing equation.

    Begun with the first report, of a system at rest. Then `predict`, `observe` and `settle` take the same report.
    """

    def __init__(self, known: RotorUnits, pmu: Pmu, *, power: bool, process: ProcessNoise) -> None:
        self.known, self.process, self.power, self.T = known, process, power, 1 / pmu.rate
        n, self.memory = len(known.H), max(1, round(FORGOTTEN * pmu.rate))
        self._noise = {"angle": pmu.angle, "magnitude": pmu.magnitude}
        self._has_flux = (known.flux["xq"] > 0).astype(float)
        self.H: np.ndarray = known.H if power else np.full(n, 0.5)
        self.D: np.ndarray = known.D if power else np.zeros(n)
        walk = process.walk if power else process.jerk
        hz, flux = known.frequency_hz, self._has_flux
        self.swing = swing(self.H, self.D, hz=hz, T=self.T, walk=walk, flux=flux, with_power=power)
        self.q_axis = QAxis(known, self.T, self.memory)
        self.governors = Governors(known.governor, self.T)
        self._window, self._length = PmuWindow(pmu.own_frames(hz), self.T, hz), 2 * pmu.own_frames(hz) + 1
        s, q = self.swing, self.q_axis
        self.constants = Constants(
            known.impedance, known.mva, self._has_flux * power, s.F, s.B, s.walk, s.c, s.d,
            q.A, q.B, q.out, q.speed, q.slope, q.knee, q.exponential, q.step, q.ramp,
        )  # fmt: skip
        self._settings = pmu.angle, pmu.magnitude, process.share * power, float(np.sqrt(self._window.together))

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
        nothing = np.diag([np.pi, NOTHING, NOTHING, 0, 0]) ** 2
        return x, np.where(seen.frame.received[..., None, None], P, nothing)

    def restarted(
        self, x: np.ndarray, P: np.ndarray, seen: Measured, where: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """States and covariances after a long silence: angle and fluxes as at rest, speed and power as they were."""
        fresh, E = x.copy(), seen.E / (1 + self.q_axis.speed * x[..., 1])
        fresh[..., 3:] = self.q_axis.rest(seen.I, E)
        fresh[..., 0] = np.angle(E) - turn(self.q_axis.psi(fresh[..., 3:]), np.abs(E))
        flux = UNSETTLED**2 * self._has_flux + np.zeros(E.shape)
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
            both = both + r[..., :, None] * r[..., None, :] * HIDDEN[:2, :2] + (lost > 0)[..., None, None] * UNSURE
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


def measured(frame: Frame, known: Constants, noise: dict[str, float], power: bool) -> Measured:
    """The internal voltages of a frame, and with `power` the powers; `noise` as in `computed_power_variance`."""
    ZI, E, I = np.empty((3, *frame.V.shape), complex)
    P, variance, none = np.zeros((3, *frame.V.shape))
    V, current = np.ascontiguousarray(frame.V), np.ascontiguousarray(frame.I)
    see(V, current, known, noise["angle"], noise["magnitude"], ZI, E, I, P, variance)
    if not power:
        return Measured(frame, V, ZI, E, I, none, none, none)
    parts = frame.parts
    if parts is None:
        return Measured(frame, V, ZI, E, I, P, variance, none)
    of_power = computed_power_variance(parts.V, parts.I, (frame.V, frame.I), **noise) / known.mva**2
    of_current = computed_current_variance(parts.I, **noise) / known.mva**2
    variance = np.where(parts.computed, of_power, variance)
    return Measured(frame, V, ZI, E, I, P, variance, of_current * parts.computed)


class QAxis:
    """The q-axis circuits of all machines over whole frames of the length T.

    Attributes
    ----------
    out : (machines, 2) array
        psi''q = out . (e, k), pu; 0 for classical machines.
    A : (machines, 2, 2) array
        Transition of (e, k) over a frame.
    B : (machines, 2, 2) array
        Response after a frame to constant inputs (iq, iron).
    slope, knee, exponential : (machines,) array
        Constants of `iron`, with the air gap in the slope.
    speed : (machines,) array
        Speed factor, 0 or 1: w = 1 + speed (omega - 1).
    step, ramp : (frames, machines, 2) array
        Response after 0, 1, ... frames to an iq of 1 pu, constant or rising from 0 to 1 over these frames.
    """

    def __init__(self, known: RotorUnits, T: float, frames: int) -> None:
        f, n = known.flux, len(known.H)
        has = f["xq"] > 0
        b = np.where(has, f["x1q"] - f["xl"], 1.0)
        a, k, wide = (f["x2"] - f["xl"]) / b, (f["x1q"] - f["x2"]) / (b * b), f["xq"] - f["x1q"]
        self.speed = f["speed_factor"]
        self.out = np.stack([a, 1 - a], -1) * has[:, None]
        A, B = np.zeros((n, 2, 2)), np.zeros((n, 2, 2))
        A[:, 0, 0], A[:, 0, 1], B[:, 0, 0] = -1 - wide * k, wide * k, -wide * (1 - k * b)
        A[:, 1, 0], A[:, 1, 1], B[:, 1, 0] = 1, -1, -b
        salient = f["salient"] > 0  # its iron acts on k, from which psi''q = (1 - a) k
        B[:, 0, 1], B[:, 1, 1] = salient - 1.0, -np.divide(1, 1 - a, out=np.zeros(n), where=salient & (a != 1))
        self._rest = -np.linalg.solve(A, B) * has[:, None, None]
        T_circuit = np.stack([f["T1q"], f["T2q"]], -1)
        rate = np.divide(1.0, T_circuit, out=np.zeros((n, 2)), where=T_circuit > 0)[..., None]
        whole = np.zeros((n, 6, 6))
        whole[:, :2, :2], whole[:, :2, 2:4], whole[:, 2:4, 4:] = rate * A * T, rate * B * T, np.eye(2)
        whole = expm(whole)
        self.A, self.B = whole[:, :2, :2].copy(), whole[:, :2, 2:4].copy()
        self.step, self.ramp = np.zeros((frames + 1, n, 2)), np.zeros((frames + 1, n, 2))
        rise = np.zeros((n, 2))  # response to an iq that rises by 1 pu in every frame
        for m in range(1, frames + 1):
            rise = (self.A @ rise[..., None])[..., 0] + (m - 1) * self.B[..., 0] + whole[:, :2, 4]
            self.step[m] = (self.A @ self.step[m - 1][..., None])[..., 0] + self.B[..., 0]
            self.ramp[m] = rise / m
        gap = np.divide(f["xq"] - f["xl"], f["xd"] - f["xl"], out=np.zeros(n), where=has)
        self.knee, self.slope, self.exponential = f["SA"], f["SB"] * gap, f["exponential"]

    def psi(self, flux: np.ndarray) -> np.ndarray:
        """psi''q (seeds, machines), pu, of the fluxes e and k (seeds, machines, 2)."""
        return self.out[:, 0] * flux[..., 0] + self.out[:, 1] * flux[..., 1]

    def rest(self, I: np.ndarray, E: np.ndarray) -> np.ndarray:
        """The steady fluxes (seeds, machines, 2) at a current and a flux E''/w (pu machine)."""
        size, flux = np.abs(E), np.zeros((*E.shape, 2))
        ratio = iron(size, self.slope, self.knee, self.exponential)
        for _ in range(START):
            psi = self.psi(flux)
            iq = np.real(I * np.exp(-1j * (np.angle(E) - turn(psi, size))))
            flux = 0.8 * flux + 0.2 * (self._rest @ np.stack([iq, ratio * psi], -1)[..., None])[..., 0]
        return flux


def turn(psi: np.ndarray, size: np.ndarray) -> np.ndarray:
    """asin(psi''q / |psi''|), rad."""
    return np.arcsin(within(psi / size, 0.99))


def within(x: np.ndarray, limit: float) -> np.ndarray:
    """x between -limit and limit."""
    return np.minimum(np.maximum(x, -limit), limit)


class PmuWindow:
    """The window of the PMUs: `half` frames of length T to each side."""

    def __init__(self, half: int, T: float, hz: float) -> None:
        weights = window(half)
        self.wide, self._half, self.T, self.wb = half > 0, half, T, 2 * np.pi * hz
        self._width = max(half / 3, 1) * T
        self._variance = float(weights @ np.arange(-half, half + 1) ** 2) * T**2
        self._moved: deque[np.ndarray] = deque(maxlen=2 * half + 1)  # pu   change of the current
        self._changes: deque[np.ndarray] = deque(maxlen=half + 1)
        self.together = 1 / float(weights @ weights)

    def turned(self, slip: np.ndarray) -> np.ndarray:
        """Root mean square of the turn (rad) of a rotor within the window."""
        return self.wb * np.sqrt(self._variance) * np.abs(slip)

    def flux_noise(self, slip: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Standard deviation (pu) of the current that drives the fluxes, from the turn of the rotor in the window."""
        self._moved.append(np.abs(change))
        return self.turned(slip) * np.max(self._moved, 0)

    def entering(self, change: np.ndarray) -> np.ndarray:
        """Change (pu) of a part of the current, at least as much as may be entering with the last jump.

        Weights fall as half + 1, half, ... 1 from the middle of the window: with the largest one k frames ago, the
        share that enters now is 1/(k + 1) of it.
        """
        self._changes.appendleft(np.abs(change))
        most = np.max([size / (k + 1) for k, size in enumerate(self._changes)], 0)
        return np.where(change < 0, -most, most)

    def power_noise(self, voltage: np.ndarray, current: np.ndarray) -> np.ndarray:
        """Variance of the mean power where voltage and current change by so much over a frame.

        If a share a of a jump is within the window, the product of the means lacks a (1 - a), 1/6 on average.
        """
        return self.together**3 / 6 * np.abs(voltage * current) ** 2

    def middle(
        self, y: np.ndarray, P: np.ndarray, *, acceleration: np.ndarray, jerk: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Angle and speed (seeds, machines, 2) in the middle of the window, and their covariance.

        Parameters
        ----------
        y, P : (seeds, machines, 2) and (seeds, machines, 2, 2) array
            Mean angle and speed, and their covariance.
        acceleration, jerk : (seeds, machines) array, pu/s and pu/s^2
            Of the mean speed.
        """
        half, y, P = self._variance / 2, y.copy(), P.copy()
        y[..., 0] -= half * self.wb * acceleration
        y[..., 1] -= half * jerk
        P[..., 0, 0] += (ANGLE * half * self.wb * self._width * jerk) ** 2
        P[..., 1, 1] += (SLIP * half * jerk) ** 2
        return y, P
