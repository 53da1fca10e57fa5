"""A plant with its controllers: continuous loops closed, sampled ones mapped over the common period of their frames.

The map is exact: the inputs are held between two frames.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import gcd

import numpy as np
from scipy.linalg import expm

from stabctl._util.errors import StudyError
from stabctl.dynamics.layout import StatePlace, unique
from stabctl.dynamics.named import Named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import Signal

from .descriptor import descriptor
from .model import Linear, eliminated

LONGEST = Fraction(1, 6)  # s   common period: half of its inverse is 3 Hz


@dataclass(frozen=True)
class Plant:
    """A linear model with its inputs and outputs as signals."""

    model: Linear
    drives: Sequence[Signal]
    reads: Sequence[Signal]

    def columns(self, signals: Iterable[Signal]) -> list[int]:
        """Columns of B of some inputs."""
        return [self.drives.index(s) for s in signals]

    def rows(self, signals: Iterable[Signal]) -> list[int]:
        """Rows of C of some outputs."""
        return [self.reads.index(s) for s in signals]

    def with_continuous(self, c: Named) -> "Plant":
        """The loop closed with u = K y added to the inputs it drives."""
        m, K = self.model, c.matrices
        inputs, outs = (
            np.eye(len(self.drives))[:, self.columns(c.outputs)],
            np.eye(len(self.reads))[self.rows(c.inputs)],
        )
        B, D = m.B @ inputs, m.D @ inputs  # of what the controller gives
        L = outs @ D  # direct path from its outputs to its inputs
        Dk, Ck = c.gains[:, None] * K.D, c.gains[:, None] * K.C
        try:
            Q = np.linalg.inv(np.eye(len(Dk)) - Dk @ L)
        except np.linalg.LinAlgError:
            raise StudyError(
                f"{c.controller.name} forms an algebraic loop of gain 1 with the network; add a lag to it."
            ) from None
        # u = Q (Ck xk + Dk (outs C x + outs D w)), w the other inputs
        F = [Q @ Dk @ outs @ m.C, Q @ Ck, Q @ Dk @ outs @ m.D]
        y = [outs @ m.C + L @ F[0], L @ F[1], outs @ m.D + L @ F[2]]
        A = np.block([[m.A + B @ F[0], B @ F[1]], [K.B @ y[0], K.A + K.B @ y[1]]])
        Bn = np.vstack([m.B + B @ F[2], K.B @ y[2]])
        Cn, Dn = np.hstack([m.C + D @ F[0], D @ F[1]]), m.D + D @ F[2]
        places = [
            StatePlace("controller", 0, -1, f"x{i + 1}", f"x{i + 1} {c.controller.name}") for i in range(len(K.A))
        ]
        states = unique((*m.states, *(p.label for p in places)))
        model = replace(m, A=A, B=Bn, C=Cn, D=Dn, states=states, places=(*m.places, *places))
        return replace(self, model=model)


def plant_of(
    point: OperatingPoint, own: Sequence[Named], inputs: Iterable[Signal] = (), outputs: Iterable[Signal] = ()
) -> Plant:
    """The system with all that controllers drive and read as inputs and outputs, and more of them."""
    drives = list(dict.fromkeys([s for c in own for s in c.outputs] + list(inputs)))
    reads = list(dict.fromkeys([s for c in own for s in c.inputs] + list(outputs)))
    return Plant(eliminated(descriptor(point, drives, reads)), drives, reads)


def common_period(rates: Sequence[int]) -> Fraction:
    """Shortest time (s) that is a whole number of frames of every rate.

    Raises `StudyError` if it is too long to tell the modes below 3 Hz from those that are faster by a multiple of 1/T.
    """
    period = Fraction(1, gcd(*rates))
    if period > LONGEST:
        raise StudyError(
            f"Frames at {', '.join(f'{rate}/s' for rate in dict.fromkeys(rates))} repeat every {float(period):g} s, so "
            f"that modes above {float(1 / (2 * period)):g} Hz are not known; choose rates of at least 6/s that divide "
            "each other, such as 60 and 30."
        )
    return period


def over_a_period(
    plant: Plant, own: Sequence[Named], period: Fraction, columns: list[int], rows: list[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """The map of [x | outputs held, states and delay line of every controller], and what inputs and outputs add to it.

    A frame sees the voltages of the outputs held before: y = C x + D held, then the outputs change.
    """
    m = plant.model
    parts = [_Frames(c, plant) for c in own]
    n, total = len(m.A), len(m.A) + sum(part.size for part in parts)
    width = total + len(columns)
    now = np.eye(total, width)
    at = n
    for part in parts:
        part.start(now[at : at + part.size])
        at += part.size
    x, w = now[:n], np.eye(width)[total:]
    H, J = np.zeros((len(rows), total)), np.zeros((len(rows), len(columns)))
    instants = sorted({Fraction(k, part.rate) for part in parts for k in range(int(period * part.rate))})
    transitions: dict[Fraction, tuple[np.ndarray, np.ndarray]] = {}
    for k, instant in enumerate(instants):
        u = np.zeros((m.B.shape[1], width))
        for part in parts:
            u[part.columns] += part.held
        u[columns] += w
        y = m.C @ x + m.D @ u
        if k == 0:
            H, J = y[rows][:, :total], y[rows][:, total:]
        for part in parts:
            if (instant * part.rate).denominator == 1:
                part.frame(y)
        gap = (instants[k + 1] if k + 1 < len(instants) else period) - instant
        if gap not in transitions:
            transitions[gap] = held(m.A, m.B, float(gap))
        u = np.zeros((m.B.shape[1], width))
        for part in parts:
            u[part.columns] += part.held
        u[columns] += w
        P, G = transitions[gap]
        x = P @ x + G @ u
    end = np.vstack([x, *(part.end() for part in parts)])
    return end[:, :total], end[:, total:], H, J, [name for part in parts for name in part.names]


class _Frames:
    """A sampled controller as rows of linear functions of the values at the start of a period."""

    def __init__(self, c: Named, plant: Plant) -> None:
        what, self.K = c.controller, c.matrices
        self.rate, self.gains = what.rate or 1, c.gains[:, None]
        self.columns, self.rows = plant.columns(c.outputs), plant.rows(c.inputs)
        n, p, d = len(self.K.A), len(c.outputs), what.frames
        self._n, self._p, self._d, self.size = n, p, d, n + p + d * p
        self.names = [f"held {s.label} {what.name}" for s in c.outputs]
        self.names += [f"x{i + 1} {what.name}" for i in range(n)]
        self.names += [f"delay {k + 1} {s.label} {what.name}" for k in range(d) for s in c.outputs]

    def start(self, rows: np.ndarray) -> None:
        """Begin with these rows."""
        p, n = self._p, self._n
        self.held, self._x, self._line = rows[:p], rows[p : p + n], rows[p + n :]

    def frame(self, y: np.ndarray) -> None:
        """One frame, which reads all outputs y of the plant."""
        own, K = y[self.rows], self.K
        self._line = np.vstack([self._line, K.C @ self._x + K.D @ own])
        self.held, self._line = self.gains * self._line[: self._p], self._line[self._p :]
        self._x = K.A @ self._x + K.B @ own

    def end(self) -> np.ndarray:
        """The rows at the end."""
        return np.vstack([self.held, self._x, self._line])


def held(A: np.ndarray, B: np.ndarray, T: float) -> tuple[np.ndarray, np.ndarray]:
    """Exact transition over T (s) with the inputs held, exp([A B; 0 0] T)."""
    n, m = B.shape
    M = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * T)
    return M[:n, :n], M[:n, n:]
