"""The loop opened at the deadbands, limits and relays of its controllers: what they receive against what they give.

With the plant P, a controller K(s) = D + C R B, R = (s - A)^-1, its delay E = exp(-s tau) and its anti-windup
x' = A x + B y + L (v - u), v = N u the output given for the output u wanted:

    (1 + E C R L) u = E (K P + C R L) v,   so u = G v.

Sampled, z = exp(s T) takes the place of s in R; P is the pulse transfer function of the system with v held for a frame.
A frame reads the voltages of the outputs before it: y = C x + D v / z. Delays are exact in both.
"""

from collections.abc import Sequence

import numpy as np

from stabctl.controllers.realization import anti_windup
from stabctl.dynamics.named import Named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import Signal
from stabctl.errors import StudyError

from .closed_loop import joined
from .describing import Nonlinearity, nonlinearity
from .frames import held
from .interconnection import plant_of
from .response import Response


class OpenedLoop:
    """G(s), from all that nonlinear outputs give to all that they receive, and to some signals.

    Attributes
    ----------
    parts
        What acts on each nonlinear output.
    names
        Controller and input driven of each: "pod: order:1@5".
    rate
        Frames per second; 0 if continuous.
    """

    def __init__(self, point: OperatingPoint, own: Sequence[Named], signals: Sequence[Signal]) -> None:
        acts = {id(c): nonlinearity(c) for c in own}
        bent = [c for c in own if not acts[id(c)].gentle]
        self.rate = _rate(bent, own)
        smooth = [c for c in own if self.rate and c.controller.rate is None]
        self._open = [c for c in own if c not in smooth]
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
        self._controllers = [_Part(c, acts[id(c)]) for c in self._open]
        self._bent = np.concatenate([np.full(len(c.outputs), not acts[id(c)].gentle) for c in self._open])
        self._signals = len(signals)
        self.parts: list[Nonlinearity] = [acts[id(c)] for c in bent for _ in c.outputs]
        self.names = [f"{c.controller.name}: {s.kind}:{s.place}" for c in bent for s in c.outputs]
        gentle = [c for c in own if acts[id(c)].gentle]
        loop = joined(plant_of(point, own), gentle)
        self.poles = loop.modes().eigenvalues

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


class _Part:
    """One controller in the frequency domain."""

    def __init__(self, c: Named, acts: Nonlinearity) -> None:
        what = c.controller
        self.K = c.undelayed
        self.delay, self.shape = what.delay, (len(c.outputs), len(c.inputs))
        self.L = np.zeros_like(self.K.C.T) if acts.gentle else anti_windup(what, self.K.C)

    def at(self, s: complex, point: complex) -> tuple[np.ndarray, np.ndarray]:
        """E K and E C R L."""
        K, E = self.K, np.exp(-s * self.delay)
        R = np.linalg.solve(point * np.eye(len(K.A)) - K.A, np.hstack([K.B, self.L]))
        X = E * K.C @ R
        m = K.B.shape[1]
        return E * K.D + X[:, :m], X[:, m:]


def _rate(bent: Sequence[Named], own: Sequence[Named]) -> int:
    """Frames per second of the nonlinear controllers; 0 if continuous. Raises `StudyError` if rates differ."""
    if not bent:
        raise StudyError(
            "No controller has a deadband, limits or a relay, so the loop is linear and has no limit cycles; see "
            "closed_loop."
        )
    rates = {c.controller.rate or 0 for c in bent} | {c.controller.rate for c in own if c.controller.rate}
    if len(rates) > 1:
        named = " and ".join("continuous" if not r else f"{r}/s" for r in sorted(rates))
        raise StudyError(
            f"Limit cycles are found for controllers of one rate, not for {named}; give all sampled controllers one "
            "rate, and those with deadband, limits or relay all the same."
        )
    return rates.pop()
