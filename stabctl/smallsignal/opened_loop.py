"""The loop opened at outputs of its controllers, and describing functions of deadbands, limits and relays there.

With the plant P, a controller K(s) = D + C R B, R = (s - A)^-1, its delay E = exp(-s tau) and its anti-windup
x' = A x + B y + L (v - u), v = N u the output given for the output u wanted:

    (1 + E C R L) u = E (K P + C R L) v,   so u = G v.

Sampled, z = exp(s T) takes the place of s in R; P is the pulse transfer function of the system with v held for a frame.
A frame reads the voltages of the outputs before it: y = C x + D v / z. Delays are exact in both. Of linear outputs,
N = 1 and L = 0.

For the input A sin(wt), the describing function N(A) is the fundamental of the output over A. With the limiter of
slope 1 and limit d,

    S(d, A) = 2/pi (asin(d/A) + d/A sqrt(1 - (d/A)^2)) for A > d, 1 below,

N = S(d + M, A) - S(d, A) for a deadband d with limits +-M, and N = 4 M/(pi A) sqrt(1 - (d/A)^2) for a relay with the
levels -M, 0, M that switches at +-d.

Source: A. Gelb, W. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968, chapter 2.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from stabctl._util.errors import StudyError
from stabctl.controllers.realization import anti_windup
from stabctl.dynamics.named import Named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import Signal

from .closed_loop import joined
from .interconnection import held, plant_of
from .model import Response

DEEP = 1e-10  # least distance of an amplitude above the deadband, relative to it
REACH = 1e5  # largest amplitude, relative to the deadband and limit together
POINTS = 1500


@dataclass(frozen=True)
class Nonlinearity:
    """Deadband and limits, or a relay, in the unit of the output."""

    deadband: float
    limit: float  # inf: none
    relay: bool

    @property
    def gentle(self) -> bool:
        """Whether it acts linearly whatever the amplitude."""
        return not self.relay and not self.deadband and np.isinf(self.limit)

    def gain(self, A: np.ndarray | float) -> np.ndarray:
        """N(A) for amplitudes A of its input."""
        A, d, M = np.asarray(A, float), self.deadband, self.limit
        if self.relay:
            return 4 * M / (np.pi * A) * np.sqrt(np.maximum(1 - (d / A) ** 2, 0.0))
        whole = np.ones_like(A) if np.isinf(M) else _limiter(d + M, A)
        return whole - _limiter(d, A)

    def slope(self, A: float) -> float:
        """Sign of dN/dA at an amplitude."""
        d, M = self.deadband, self.limit
        if self.relay:
            return float(np.sign(2 * d**2 - A**2))
        fall = 0.0 if np.isinf(M) or d + M >= A else (d + M) * np.sqrt(1 - ((d + M) / A) ** 2)
        rise = 0.0 if d >= A else d * np.sqrt(1 - (d / A) ** 2)
        return float(np.sign(rise - fall))

    def output(self, u: np.ndarray) -> np.ndarray:
        """What it gives for an input."""
        d, M = self.deadband, self.limit
        if self.relay:
            return M * np.sign(u) * (np.abs(u) > d)
        return np.clip(u - np.clip(u, -d, d), -M, M)

    def third(self, A: float) -> float:
        """Third harmonic of the output over its fundamental, for the amplitude A of the input."""
        harmonics = np.abs(np.fft.rfft(self.output(A * np.sin(2 * np.pi * (np.arange(4096) + 0.5) / 4096))))
        return float(harmonics[3] / harmonics[1]) if harmonics[1] else 1.0  # pulses narrower than a sample

    def grid(self) -> np.ndarray:
        """Amplitudes from the smallest with an effect to far beyond the limits, dense above the deadband."""
        d, M = self.deadband, self.limit
        size = d + (M if np.isfinite(M) else 0.0)
        if not d:
            return size * np.geomspace(1e-8 if self.relay else 1.0, REACH, POINTS)
        return d * (1 + np.geomspace(DEEP, REACH * size / d, POINTS))

    def amplitudes(self, gain: float) -> list[float]:
        """Amplitudes at which N(A) is a gain: none, one, or two if N rises and falls."""
        A = self.grid()
        over = self.gain(A) - gain
        return [
            float(brentq(lambda a: float(self.gain(a)) - gain, A[k], A[k + 1], xtol=1e-300, rtol=1e-12))
            for k in np.flatnonzero(over[:-1] * over[1:] < 0)
        ]


def _limiter(d: float, A: np.ndarray) -> np.ndarray:
    """S(d, A) above."""
    r = np.minimum(d / A, 1.0)
    return 2 / np.pi * (np.arcsin(r) + r * np.sqrt(1 - r**2))


LINEAR = Nonlinearity(0.0, np.inf, relay=False)


def nonlinearity(c: Named) -> Nonlinearity:
    """What acts on the outputs of a controller. Raises `StudyError` if it has no describing function of one input."""
    what, (low, high) = c.controller, c.limits
    if what.law:
        raise StudyError(
            f"{what.name} is a Python function, whose describing function is not known; give a controller with "
            "matrices, and deadband, limits or relay as its fields, or simulate it."
        )
    if what.ramp:
        raise StudyError(
            f"{what.name} has a ramp limit, for which there is no describing function here; simulate it, or set ramp "
            "to 0."
        )
    if -low != high and not (np.isinf(low) and np.isinf(high)):
        raise StudyError(
            f"{what.name} has the limits {low:g} and {high:g}; limit cycles are found for limits that are equal in "
            "both directions, such as 0.1."
        )
    return Nonlinearity(what.deadband, high, what.relay)


class OpenedLoop:
    """G(s), from all that the opened outputs give to all that they receive, and to some signals.

    Parameters
    ----------
    point, own
        The system and all its controllers.
    acts
        What acts on the outputs of each controller (controllers), `LINEAR` for nothing; None: its loop stays closed.
    signals
        Signals of the system that are also wanted.

    Attributes
    ----------
    parts
        What acts on each opened output.
    names
        Controller and input driven of each: "pod: order:1@5".
    rate
        Frames per second; 0 if continuous.
    """

    def __init__(
        self,
        point: OperatingPoint,
        own: Sequence[Named],
        acts: Sequence[Nonlinearity | None],
        signals: Sequence[Signal] = (),
    ) -> None:
        opened = [(c, a) for c, a in zip(own, acts, strict=True) if a]
        self.rate = _rate([c for c, _ in opened], own)
        smooth = [c for c in own if self.rate and c.controller.rate is None]
        parts = [(c, a) for c, a in zip(own, acts, strict=True) if not self.rate or c.controller.rate]
        self._open = [c for c, _ in parts]
        plant = plant_of(point, own, (), signals)
        for c in smooth:
            plant = plant.with_continuous(c)
        model = plant.model
        columns = plant.columns(s for c in self._open for s in c.outputs)
        rows = plant.rows([s for c in self._open for s in c.inputs] + list(signals))
        A, B, C, D = model.A, model.B[:, columns], model.C[rows], model.D[np.ix_(rows, columns)]
        self._step, self._direct = (1 / self.rate, D) if self.rate else (0.0, np.zeros_like(D))
        if self.rate:
            A, B = held(A, B, self._step)
            D = np.zeros_like(D)
        self._plant = Response(A, B, C, D)
        self._controllers = [_Part(c, a) for c, a in parts]
        self._bent = np.concatenate([np.full(len(c.outputs), a is not None) for c, a in parts])
        self._signals = len(signals)
        self.parts: list[Nonlinearity] = [a for c, a in opened for _ in c.outputs]
        self.names = [f"{c.controller.name}: {s.name}" for c, _ in opened for s in c.outputs]
        closed = [c for c, a in zip(own, acts, strict=True) if a is None]
        self.poles = joined(plant_of(point, own), closed).modes().eigenvalues

    def __call__(self, s: complex) -> tuple[np.ndarray, np.ndarray]:
        """G (outputs, outputs), and the signals for what is given (signals, outputs), at s (1/s)."""
        point = np.exp(s * self._step) if self.rate else s
        P = self._plant(np.array([point]))[0] + self._direct / point
        total, G, row, column = len(self._bent), np.zeros((len(self._bent),) * 2, complex), 0, 0
        for part in self._controllers:
            p, m = part.shape
            K, H = part.at(s, point)
            own = K @ P[row : row + m]
            own[:, column : column + p] += H
            G[column : column + p] = np.linalg.solve(np.eye(p) + H, own)
            row, column = row + m, column + p
        Y, a = P[row : row + self._signals], self._bent
        if a.all():
            return G, Y
        one = np.eye(total - a.sum())
        through = np.linalg.solve(one - G[np.ix_(~a, ~a)], G[np.ix_(~a, a)])
        return G[np.ix_(a, a)] + G[np.ix_(a, ~a)] @ through, Y[:, a] + Y[:, ~a] @ through


def _rate(opened: Sequence[Named], own: Sequence[Named]) -> int:
    """Frames per second of the opened controllers; 0 if continuous. Raises `StudyError` if rates differ."""
    rates = {c.controller.rate or 0 for c in opened} | {c.controller.rate for c in own if c.controller.rate}
    if len(rates) > 1:
        named = " and ".join("continuous" if not r else f"{r}/s" for r in sorted(rates))
        raise StudyError(
            f"Limit cycles are found for controllers of one rate, not for {named}; give all sampled controllers one "
            "rate, and those with deadband, limits or relay all the same."
        )
    return rates.pop()


class _Part:
    """One controller in the frequency domain."""

    def __init__(self, c: Named, acts: Nonlinearity | None) -> None:
        what = c.controller
        self.K = c.undelayed
        self.delay, self.shape = what.delay, (len(c.outputs), len(c.inputs))
        self.L = np.zeros_like(self.K.C.T) if acts is None or acts.gentle else anti_windup(what, len(self.K.A))

    def at(self, s: complex, point: complex) -> tuple[np.ndarray, np.ndarray]:
        """E K and E C R L."""
        K, E = self.K, np.exp(-s * self.delay)
        if not len(K.A):
            return E * K.D, np.zeros((len(K.D),) * 2)
        R = np.linalg.solve(point * np.eye(len(K.A)) - K.A, np.hstack([K.B, self.L]))
        X = E * K.C @ R
        m = K.B.shape[1]
        return E * K.D + X[:, :m], X[:, m:]


def linear_loop(point: OperatingPoint, own: Sequence[Named]) -> OpenedLoop | None:
    """The loop opened at all outputs, all linear; None if there are several rates.

    Next to sampled controllers, continuous ones stay closed: the loop seen from them is not time-invariant.
    """
    rates = {c.controller.rate for c in own if c.controller.rate}
    if len(rates) > 1 or not own:
        return None
    return OpenedLoop(point, own, [LINEAR if c.controller.rate or not rates else None for c in own])


def alone(G: np.ndarray, gains: np.ndarray, r: int) -> np.ndarray:
    """What output r receives for what it gives (points), with the others closed by gains; G (points, outputs, outputs).

    G_rr + G_ro N (1 - G_oo N)^-1 G_or, o the others.
    """
    rest = np.delete(np.arange(len(gains)), r)
    N = gains[rest]
    inner = np.eye(len(rest)) - G[:, rest][:, :, rest] * N
    through = np.linalg.solve(inner, G[:, rest, r][:, :, None])[:, :, 0]
    found: np.ndarray = G[:, r, r] + np.einsum("ki,ki->k", G[:, r][:, rest] * N, through)
    return found
