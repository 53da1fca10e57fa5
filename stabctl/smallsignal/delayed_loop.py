"""Closed loops with continuous delays, exactly: the rightmost roots of their characteristic equation.

The loop opened at the outputs of all controllers, with delays tau: x' = A x + B v, w = C x + D v, v = exp(-s tau) w,
has the roots

    det T(s) = 0,  T(s) = s - A - B G(s) C,  G = (exp(s tau) - D)^-1,

infinitely many, of which finitely many are inside any circle. Starting values: every delay as a transport equation,
discretized by Chebyshev collocation (D. Breda, S. Maset, R. Vermiglio, SIAM J. Sci. Comput. 27, 2005). Each is
corrected by inverse iteration on T. Their number is checked by the argument principle: the roots inside a circle are
the eigenvalues of A there plus the turns of det(exp(s tau) - D - C (s - A)^-1 B) around it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl

from stabctl.controllers.realization import pade
from stabctl.dynamics.named import Named

from .eigen import values
from .interconnection import Plant

FAST = 10.0  # Hz   radius of the circle, in frequency
NODES = 12  # of a delay, and
PER_RADIAN = 0.7  # nodes for each radian of phase that it turns at `FAST`
TURN = 0.5  # rad   largest turn of the determinant between two points of the circle
ITERATIONS = 20
CONVERGED = 1e-9  # last correction of a root, relative to 1 + |s|
SAME = 1e-8  # distance of a root found twice, relative to 1 + |s|


@dataclass(frozen=True, eq=False)
class Root:
    """A root with its vectors: T v = 0, w^H T = 0, w^H T' v = 1."""

    s: complex
    right: np.ndarray
    left: np.ndarray


class DelayedLoop:
    """The loop opened at the outputs of its continuous controllers."""

    def __init__(self, A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, delays: np.ndarray) -> None:
        self.A, self.B, self.C, self.D, self.delays = A, B, C, D, delays
        self.places = np.arange(len(A))  # of the states in the model with approximated delays
        self.channels: list[tuple[slice, slice]] = []  # places of the approximations there, and their outputs

    @classmethod
    def of(cls, plant: Plant, own: Sequence[Named]) -> "DelayedLoop":
        """The opened loop of a linear model and continuous controllers; states: those of the model, then of each."""
        m = plant.model
        parts = [c.undelayed for c in own]
        columns = plant.columns(s for c in own for s in c.outputs)
        sizes = [len(K.A) for K in parts]
        A = sl.block_diag(m.A, *(K.A for K in parts))
        C = np.zeros((len(columns), len(A)))
        B, D = np.zeros((len(A), len(columns))), np.zeros((len(columns),) * 2)
        B[: len(m.A)] = m.B[:, columns]
        at, out, place = len(m.A), 0, len(m.A)
        places, channels = [np.arange(place)], []
        for c, K, n in zip(own, parts, sizes, strict=True):
            rows, p, N = plant.rows(c.inputs), len(c.outputs), c.gains[:, None]
            y, direct = m.C[rows], m.D[np.ix_(rows, columns)]
            A[at : at + n, : len(m.A)], B[at : at + n] = K.B @ y, K.B @ direct
            C[out : out + p, : len(m.A)], C[out : out + p, at : at + n] = N * K.D @ y, N * K.C
            D[out : out + p] = N * K.D @ direct
            places.append(place + np.arange(n))
            end = place + len(c.matrices.A)
            channels.append((slice(place + n, end), slice(out, out + p)))
            at, out, place = at + n, out + p, end
        made = cls(A, B, C, D, np.concatenate([np.full(len(c.outputs), c.controller.delay) for c in own]))
        made.places, made.channels = np.concatenate(places), channels
        return made

    def vectors(self, root: Root) -> tuple[np.ndarray, np.ndarray]:
        """Right and left vector in the states of the model with approximated delays, which follow from the others."""
        s, E = root.s, np.diag(np.exp(-root.s * self.delays))
        one = np.eye(len(E))
        w = np.linalg.solve(one - self.D @ E, self.C @ root.right)
        given = np.linalg.solve((one - E @ self.D).T, self.B.T @ root.left.conj())
        size = max([len(self.places), *(place.stop for place, _ in self.channels)])
        right, left = np.zeros((2, size), complex)
        right[self.places], left[self.places] = root.right, root.left
        for place, out in self.channels:
            if place.stop > place.start:
                P = pade(float(self.delays[out][0]), out.stop - out.start)
                R = np.linalg.inv(s * np.eye(len(P.A)) - P.A)
                right[place], left[place] = R @ P.B @ w[out], (given[out] @ P.C @ R).conj()
        return right, left

    def discretized(self) -> np.ndarray:
        """A of the closed loop with every delay as a chain of Chebyshev nodes."""
        lines = [_line(tau) for tau in self.delays]
        Ad, Bd, Cd = (sl.block_diag(*(line[k] for line in lines)) for k in range(3))
        Dd = np.diag([1.0 if tau == 0 else 0.0 for tau in self.delays])
        inner = np.linalg.inv(np.eye(len(Dd)) - self.D @ Dd)
        w = inner @ np.hstack([self.C, self.D @ Cd])
        v = np.hstack([np.zeros_like(self.C), Cd]) + Dd @ w
        n = len(self.A)
        top = self.B @ v
        top[:, :n] += self.A
        bottom = Bd @ w
        bottom[:, n:] += Ad
        return np.vstack([top, bottom])

    def gain(self, s: complex) -> np.ndarray:
        """G(s), from w without v to v."""
        return np.linalg.inv(np.diag(np.exp(s * self.delays)) - self.D)

    def corrected(self, s: complex) -> Root | None:
        """The root near a starting value; None if the iteration does not converge."""
        one = np.eye(len(self.A))
        v = w = None
        for _ in range(ITERATIONS):
            G = self.gain(s)
            slope = one + self.B @ G @ ((self.delays * np.exp(s * self.delays))[:, None] * G) @ self.C
            lu = sl.lu_factor(s * one - self.A - self.B @ G @ self.C, check_finite=False)
            if v is None:
                v = w = np.ones(len(one), complex)
            v = sl.lu_solve(lu, slope @ v, check_finite=False)
            w = sl.lu_solve(lu, slope.conj().T @ w, trans=2, check_finite=False)
            v, w = v / np.linalg.norm(v), w / np.linalg.norm(w)
            size = w.conj() @ slope @ v
            if not np.isfinite(size) or size == 0:
                return None
            step = w.conj() @ ((s * one - self.A - self.B @ G @ self.C) @ v) / size
            s = s - step
            if abs(step) < CONVERGED * (1 + abs(s)):
                return Root(complex(s), v, w / np.conj(size))
        return None

    def radius(self) -> float:
        """Radius of the circle (1/s), with no eigenvalue of A and no root near it."""
        sizes = np.abs(np.r_[np.linalg.eigvals(self.A), np.linalg.eigvals(self.discretized())])
        tried = 2 * np.pi * FAST * np.linspace(1.0, 1.1, 41)
        gaps = np.abs(tried[:, None] - sizes).min(axis=1)
        return float(tried[gaps.argmax()])

    def count(self, radius: float) -> int:
        """Roots inside a circle around 0, by the argument principle."""
        poles = np.linalg.eigvals(self.A)
        T, Z = sl.schur(self.A.astype(complex), output="complex")
        B, C = Z.conj().T @ self.B, self.C @ Z

        def phase(angle: float) -> complex:
            s = radius * np.exp(1j * angle)
            inner = C @ sl.solve_triangular(s * np.eye(len(T)) - T, B, check_finite=False)
            return complex(np.linalg.slogdet(np.diag(np.exp(s * self.delays)) - self.D - inner)[0])

        turned = 0.0
        ahead = [(a, phase(a)) for a in np.linspace(np.pi, 0, 101)]
        last = ahead.pop()
        while ahead:
            angle, value = ahead[-1]
            turn = float(np.angle(value / last[1]))
            if abs(turn) < TURN or angle - last[0] < 1e-9:
                turned += turn
                last = ahead.pop()
            else:
                middle = (angle + last[0]) / 2
                ahead.append((middle, phase(middle)))
        return int((np.abs(poles) < radius).sum()) + round(turned / np.pi)

    def eigenvalues(self, rotation: np.ndarray | None = None) -> np.ndarray:
        """Roots as the discretization gives them, without that of the angle reference; `rotation` as in `eigen`."""
        A = self.discretized()
        if rotation is None:
            return np.linalg.eigvals(A)
        turned = rotation[self.places]
        return values(A, np.r_[turned, np.zeros(len(A) - len(turned))])

    def roots(self, radius: float, rotation: np.ndarray | None = None) -> list[Root]:
        """Roots inside a circle around 0 except 0 itself; of a conjugate pair the one with positive imaginary part."""
        seeds = self.eigenvalues(rotation)
        found: list[Root] = []
        for s in seeds[(seeds.imag >= -1e-9) & (np.abs(seeds) < 1.2 * radius) & (np.abs(seeds) > 1e-6)]:
            one = self.corrected(complex(s.real, max(s.imag, 0.0)))
            if one is None or not 1e-6 < abs(one.s) < radius or one.s.imag < -SAME * (1 + abs(one.s)):
                continue
            if all(abs(one.s - other.s) > SAME * (1 + abs(one.s)) for other in found):
                found.append(one)
        return found


def _line(tau: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """z' = A z + B w, v = C z of a delay (s): dz/dt = -dz/dx at Chebyshev nodes, z = w at the first, v at the last."""
    if tau == 0:
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    n = NODES + int(np.ceil(PER_RADIAN * 2 * np.pi * FAST * tau))
    x = np.cos(np.pi * np.arange(n + 1) / n)
    c = np.r_[2.0, np.ones(n - 1), 2.0] * (-1.0) ** np.arange(n + 1)
    slopes = np.outer(c, 1 / c) / (x[:, None] - x + np.eye(n + 1))
    slopes = (slopes - np.diag(slopes.sum(axis=1))) * 2 / tau
    last = np.zeros((1, n))
    last[0, -1] = 1.0
    return slopes[1:, 1:], slopes[1:, :1], last
