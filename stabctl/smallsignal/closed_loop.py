"""The linear model of a system with controllers: exact, whether they are continuous, sampled or both.

Continuous controllers close the loop x' = A x + B y, u = C x + D y directly. With sampled ones the closed loop is the
map over the common period of all rates, from [x | outputs held, states and delay lines of the controllers]: the plant
moves exactly with its inputs held, x(t + T) = exp(A T) x + (integral of exp(A t)) B u, and at a frame a controller
reads the system with the outputs held before. Eigenvalues z of the map over the period T are the modes s = log(z) / T,
unique below half of the slowest rate.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import gcd

import numpy as np
from scipy.linalg import expm

from stabctl.controllers.controller import Controller
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.layout import StatePlace, unique
from stabctl.dynamics.named import Named, named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import INPUTS, OUTPUTS, Signal, chosen
from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from .descriptor import descriptor
from .eigen import Eigen, eigen
from .model import Linear, eliminated
from .modes import Modes

EMPTY = 0.2  # |z| per frame below which a mode is that of an emptying delay line
LARGEST = 500  # frames in a common period


@dataclass(frozen=True, repr=False)
class ClosedLoop(Linear):
    """The linear model of a system with controllers.

    Without sampled controllers, A, B, C, D are those of x' = A x + B u. With them, A = (M - 1) / period for the map M
    over the common period of the frames, B and D are those of inputs held over the period.
    """

    controllers: tuple[Controller, ...] = ()
    period: float = 0.0  # s   of the frames; 0: all controllers are continuous
    frames: int = 0  # in a period, of the fastest controller

    def modes(self) -> Modes:
        """The modes of the closed loop; those of emptying delay lines are left out."""
        found = eigen(self.A, self.rotation())
        if not self.period:
            return Modes(self, *found)
        z = 1 + self.period * found.values
        with np.errstate(divide="ignore"):
            values = np.where(found.values == 0, 0, np.log(np.where(z == 0, 1e-300, z)) / self.period)
        kept = np.abs(z) > EMPTY**self.frames
        order = np.flatnonzero(kept)[np.lexsort((-values[kept].imag, values[kept].real, np.abs(values[kept].imag)))]
        order = np.r_[0, order[order != 0]]
        parts = Eigen(values[order], found.right[:, order], found.left[:, order])
        for part in parts:
            part.setflags(write=False)
        return Modes(self, *parts)


def closed_loop(
    base: Case | OperatingPoint,
    *controllers: Controller,
    inputs: str | Iterable[str | Signal] = (),
    outputs: str | Iterable[str | Signal] = (),
    storage: "Fleet | None" = None,
) -> ClosedLoop:
    """Linearize a system with controllers.

    Deadbands and relays have no derivative: linearly, such a controller gives nothing. Limits and gates do not act on
    small deviations, and gates are taken as open.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    *controllers : Controller
        The controllers.
    inputs, outputs : str or iterable
        Signals of the model, as in `linearize`.
    storage : str, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.

    Returns
    -------
    ClosedLoop

    Raises
    ------
    LinearizationError, StudyError
        As `linearize`; also if a controller reads or drives what the case does not have.
    """
    point = operating_point(base, storage)
    for c in controllers:
        if not isinstance(c, Controller):
            raise StudyError(
                f"{c!r} is not a Controller, so it has no linear model; give Controller.from_control(...)."
            )
    own = [named(point, c) for c in controllers]
    wanted = chosen(point.case, inputs, INPUTS), chosen(point.case, outputs, OUTPUTS)
    drives = list(dict.fromkeys([s for c in own for s in c.outputs] + list(wanted[0])))
    reads = list(dict.fromkeys([s for c in own for s in c.inputs] + list(wanted[1])))
    plant = _Plant(eliminated(descriptor(point, drives, reads)), drives, reads)
    for one in own:
        if one.controller.rate is None:
            plant = plant.with_continuous(one)
    return _sampled(plant, [one for one in own if one.controller.rate], tuple(controllers), wanted)


@dataclass(frozen=True)
class _Plant:
    """A linear model with its inputs and outputs as signals."""

    model: Linear
    drives: Sequence[Signal]
    reads: Sequence[Signal]

    def columns(self, signals: Iterable[Signal]) -> list[int]:
        return [self.drives.index(s) for s in signals]

    def rows(self, signals: Iterable[Signal]) -> list[int]:
        return [self.reads.index(s) for s in signals]

    def with_continuous(self, c: Named) -> "_Plant":
        """The loop closed with u = K y added to the inputs it drives."""
        m, K = self.model, c.matrices
        gain = 1.0 if c.controller.linear else 0.0
        inputs, outs = (
            np.eye(len(self.drives))[:, self.columns(c.outputs)],
            np.eye(len(self.reads))[self.rows(c.inputs)],
        )
        B, D = m.B @ inputs, m.D @ inputs  # of what the controller gives
        L = outs @ D  # direct path from its outputs to its inputs
        Dk, Ck = gain * K.D, gain * K.C
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
        return _Plant(model, self.drives, self.reads)


def _sampled(
    plant: _Plant, own: Sequence[Named], controllers: tuple[Controller, ...], wanted: tuple[Sequence[Signal], ...]
) -> ClosedLoop:
    """The closed loop with the sampled controllers, or without any."""
    m, (ins, outs) = plant.model, wanted
    rates = [c.controller.rate or 1 for c in own]
    labels = tuple(s.label for s in ins), tuple(s.label for s in outs)
    columns, rows = plant.columns(ins), plant.rows(outs)
    if not own:
        parts = m.A, m.B[:, columns], m.C[rows], m.D[np.ix_(rows, columns)]
        return ClosedLoop(m.name, *parts, m.states, *labels, m.point, m.places, controllers)
    period = common_period(rates)
    M, G, H, J, names = over_a_period(plant, own, period, columns, rows)
    places = [StatePlace("controller", 0, -1, name, name) for name in names]
    T = float(period)
    states = unique((*m.states, *names))
    A = (M - np.eye(len(M))) / T
    frames = round(max(rates) * T)
    return ClosedLoop(
        m.name, A, G / T, H, J, states, *labels, m.point, (*m.places, *places), controllers, T, frames
    )  # fmt: skip


def common_period(rates: Sequence[int]) -> Fraction:
    """Shortest time (s) that is a whole number of frames of every rate. Raises `StudyError` if it is very long."""
    period = Fraction(1, gcd(*rates))
    if period * max(rates) > LARGEST:
        raise StudyError(
            f"The frame rates {', '.join(map(str, rates))} have a common period of {float(period):g} s; choose rates "
            "that divide each other, such as 60 and 30."
        )
    return period


def over_a_period(
    plant: _Plant, own: Sequence[Named], period: Fraction, columns: list[int], rows: list[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """The map of [x | outputs held, states and delay line of every controller], and what inputs and outputs add to it.

    A frame sees the voltages of the outputs held before: y = C x + D held, then the outputs change.
    """
    m = plant.model
    parts = [_Sampled(c, plant) for c in own]
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


class _Sampled:
    """A sampled controller as rows of linear functions of the values at the start of a period."""

    def __init__(self, c: Named, plant: _Plant) -> None:
        what, self.K = c.controller, c.matrices
        self.rate, self.gain = what.rate or 1, 1.0 if what.linear else 0.0
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
        self.held, self._line = self.gain * self._line[: self._p], self._line[self._p :]
        self._x = K.A @ self._x + K.B @ own

    def end(self) -> np.ndarray:
        """The rows at the end."""
        return np.vstack([self.held, self._x, self._line])


def held(A: np.ndarray, B: np.ndarray, T: float) -> tuple[np.ndarray, np.ndarray]:
    """Exact transition over T (s) with the inputs held, exp([A B; 0 0] T)."""
    n, m = B.shape
    M = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * T)
    return M[:n, :n], M[:n, n:]
