"""Closed loops with continuous delays, exactly: the rightmost roots of their characteristic equation, as modes.

The loop opened at the outputs of all controllers, with delays tau: x' = A x + B v, w = C x + D v, v = exp(-s tau) w,
has the roots

    det M(s) = 0,  M(s) = [s - A, -B; -E C, 1 - E D],  E = exp(-s tau),

infinitely many, of which finitely many are inside a circle around 0 or right of the imaginary axis, if the direct path
D is small enough. Starting values: every delay as a transport equation, discretized by Chebyshev collocation (D. Breda,
S. Maset, R. Vermiglio, SIAM J. Sci. Comput. 27, 2005). All roots are counted and found as in `root_search`, and their
vectors by inverse iteration on M. The vectors of the modes are in the states of the linear model.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as sl
from scipy.linalg.lapack import zgetrf, zgetrs

from stabctl._util import process
from stabctl._util.wording import counted
from stabctl.controllers.realization import pade
from stabctl.dynamics.named import Named

from ._argument_principle import OnBoundaryError
from ._characteristic import Characteristic, growing, independent
from ._root_search import Region, both, count, find
from .eigen import GROWING, ZERO, eigen, values, without
from .interconnection import Plant
from .model import Linear
from .modes import Modes

FAST = 10.0  # Hz   radius of the circle, in frequency
NODES = 12  # of a delay, and
PER_RADIAN = 0.7  # nodes for each radian of phase that it turns at `FAST`
NODES_AT_MOST = 1500
EDGES = (0.0, -1e-3, -3e-3, -1e-2)  # 1/s   left edges of the region beyond the circle: the first without roots on it
# exp(-size) in a delay: decay of the fastest roots counted, if rounding hides others
DECAYED = (36.0, 30.0, 24.0, 18.0, 12.0)
ITERATIONS = 20
EPS = float(np.finfo(float).eps)  # smallest pivot, relative to the largest element
CONVERGED = 1e-9  # last correction of a root, relative to 1 + |s|
SAME = 1e-5  # distance of roots that count as one with several vectors, relative to 1 + |s|


@dataclass(frozen=True, eq=False)
class Root:
    """A root with its vectors: T v = 0, w^H T = 0, w^H T' v = 1, T = s - A - B (1 - E D)^-1 E C."""

    s: complex
    right: np.ndarray
    left: np.ndarray


class Roots(NamedTuple):
    """The roots of a region, of each pair that with positive imaginary part."""

    found: list[Root]
    region: Region
    counted: int | None  # by the argument principle, both of each pair; None if they cannot be counted
    growing: int | None  # of these and all others


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

    def discretized(self, fast: float = FAST) -> np.ndarray:
        """A of the closed loop with every delay as a chain of Chebyshev nodes, for frequencies to `fast` (Hz)."""
        lines = [_line(tau, fast) for tau in self.delays]
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

    def characteristic(self, rotation: np.ndarray | None = None, later: float = 0.0) -> Characteristic:
        """The characteristic function with delays that are longer (s); `rotation` as in `eigen`.

        The roots of the angle references are left out.
        """
        A, B, C = self.A, self.B, self.C
        if rotation is not None:
            A, B, C = without(rotation[self.places], A, B, C)
        return Characteristic.of(A, B, C, self.D, self.delays + later)

    @cached_property
    def seeds(self) -> np.ndarray:
        """Roots as the discretization gives them."""
        return np.linalg.eigvals(self.discretized())

    def eigenvalues(self, rotation: np.ndarray) -> np.ndarray:
        """Roots below `FAST`, and all that grow, without those of the angle references; `rotation` as in `eigen`.

        Those of the discretization, if as many of them grow as are counted.
        """
        A, f = self.discretized(), self.characteristic(rotation)
        turned = rotation[self.places]
        s = values(A, np.vstack([turned, np.zeros((len(A) - len(turned), turned.shape[1]))]))
        s = s[np.abs(s) < 2 * np.pi * FAST]
        unstable = growing(f)
        if unstable == (s.real > GROWING).sum():
            return s
        if unstable is None:
            return np.r_[s, np.inf]
        region, counted = self.counted(f)
        exact = find(f, region, counted or 0, self.starts(region))
        exact = both(exact)
        return exact if unstable == (exact.real > GROWING).sum() else np.r_[exact, np.inf]

    def radius(self) -> float:
        """Radius of the circle (1/s), with no eigenvalue of A and no root near it."""
        sizes = np.abs(np.r_[np.linalg.eigvals(self.A), self.seeds])
        tried = 2 * np.pi * FAST * np.linspace(1.0, 1.1, 41)
        gaps = np.abs(tried[:, None] - sizes).min(axis=1)
        return float(tried[gaps.argmax()])

    def counted(self, f: Characteristic) -> tuple[Region, int | None]:
        """The region whose roots are counted, and their number; None if they cannot be counted.

        Beyond the `radius` it reaches to a frequency above which nothing grows, and to the left, unless rounding hides
        the roots there.
        """
        radius, slow = self.radius(), float(self.delays.max())
        for edge in EDGES:
            far = f.shifted(edge).bound()
            for left in (np.inf, *(size / slow for size in DECAYED)):
                region = Region(radius, left, edge, far)
                try:
                    return region, count(f, region)
                except OnBoundaryError:
                    continue
        return Region(radius, np.inf, 0.0, 0.0), None

    def starts(self, region: Region) -> np.ndarray:
        """Starting values of the roots in a region (1/s)."""
        seeds, top = self.seeds, region.far / (2 * np.pi)
        if top > FAST and sum(_nodes(tau, top) for tau in self.delays) < NODES_AT_MOST:
            fast = np.linalg.eigvals(self.discretized(top))
            seeds = np.r_[seeds[np.abs(seeds) < region.radius], fast[np.abs(fast) >= region.radius]]
        return seeds[(np.abs(seeds) < 1.2 * region.radius) | (seeds.real > region.edge - 1)]

    def roots(self, rotation: np.ndarray | None = None) -> Roots:
        """All roots of the region that can be counted, except 0 itself and the angle references; as in `eigen`."""
        f = self.characteristic(rotation)
        region, counted = self.counted(f)
        left = both(find(f, region, counted or 0, self.starts(region)))
        found: list[Root] = []
        while len(left):
            s, near = left[0], SAME * (1 + np.abs(left[0]))
            # pairs close to the real axis are one cluster with their real neighbors
            same = np.abs(left - (s if abs(s.imag) > near else s.real)) <= near
            if abs(s) > ZERO and s.imag >= 0:
                found += self.corrected(left[same])
            left = left[~same]
        return Roots(found, region, counted, growing(f))

    def corrected(self, given: np.ndarray) -> list[Root]:
        """The vectors of a root, and its value improved; of one that counts several times all its values are given.

        Inverse iteration on the whole matrix M(s), with as many vectors as the root counts. Values close to the real
        axis are given with their conjugates: the small eigenvalue problem of their corrections is then real, so real
        roots and pairs may turn into each other, but none is lost. Of pairs that with positive imaginary part is
        returned.
        """
        n, s, times = len(self.A), complex(given.mean()), len(given)
        real = bool((given.imag <= 0).any())
        s = complex(s.real) if real else s
        loop, steps = self._independent, np.full(times, np.inf)
        far = np.exp(-s.real * loop.delays) > 1  # rows multiplied by exp(s tau)
        v = w = np.random.default_rng(0).normal(size=(n + len(far), times)) + 0j
        for k in range(ITERATIONS):
            M, slope = loop._whole(s, far)
            lu, swapped, _ = zgetrf(M)
            np.fill_diagonal(lu, np.where(np.diag(lu) == 0, EPS * np.abs(M).max(), np.diag(lu)))
            v = np.linalg.qr(zgetrs(lu, swapped, slope @ v)[0])[0]
            w = np.linalg.qr(zgetrs(lu, swapped, slope.conj().T @ w, trans=2)[0])[0]
            # small eigenvalue problem of the corrections of all its values
            small = np.linalg.pinv(w.conj().T @ slope @ v) @ (w.conj().T @ M @ v)
            before, (steps, Q) = steps, np.linalg.eig(small.real if real else small)
            change = steps if times == 1 else np.sort_complex(steps) - np.sort_complex(before)
            s = s - complex(steps[0]) if times == 1 else s
            if k and not np.abs(change).max() >= CONVERGED * (1 + abs(s)):
                break
        v = v @ Q
        w = w @ np.linalg.pinv(w.conj().T @ slope @ v).conj().T
        every = np.array([s]) if times == 1 else s - steps
        if not np.abs(every - given.mean()).max() < 2 * SAME * (1 + abs(s)):
            every = given
        return [Root(complex(one), v[:n, k], w[:n, k]) for k, one in enumerate(every) if not real or one.imag >= 0]

    @cached_property
    def _independent(self) -> "DelayedLoop":
        """With the same roots and states, without combinations of outputs or inputs of one delay that are always zero.

        Where roots decay fast, exp(s tau) in their rows is below rounding, and M(s) is singular whether s is a root or
        not: the deviations of all machines add up to zero, for example.
        """
        U, delays, _ = independent(np.hstack([self.C, self.D]), self.delays)
        B, C, D = self.B @ U, U.T @ self.C, U.T @ self.D @ U
        U, delays, _ = independent(np.hstack([B.T, D.T]), delays)
        return DelayedLoop(self.A, B @ U, U.T @ C, U.T @ D @ U, delays)

    def _whole(self, s: complex, far: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """[s - A, -B; -E C, 1 - E D] and its derivative; the rows chosen are multiplied by exp(s tau)."""
        n, R, tau = len(self.A), len(self.delays), self.delays
        own, shift = np.where(far, np.exp(s * tau * far), 1), np.where(far, 1, np.exp(-s * tau * ~far))
        M, slope = np.zeros((2, n + R, n + R), complex)
        M[:n, :n], M[:n, n:] = s * np.eye(n) - self.A, -self.B
        M[n:, :n], M[n:, n:] = -shift[:, None] * self.C, np.diag(own) - shift[:, None] * self.D
        slope[:n, :n] = np.eye(n)
        turned = np.where(far, 0, tau * shift)[:, None]
        slope[n:, :n], slope[n:, n:] = turned * self.C, np.diag(np.where(far, tau * own, 0)) + turned * self.D
        return M, slope


def _line(tau: float, fast: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """z' = A z + B w, v = C z of a delay (s): dz/dt = -dz/dx at Chebyshev nodes, z = w at the first, v at the last."""
    if tau == 0:
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    n = _nodes(tau, fast)
    x = np.cos(np.pi * np.arange(n + 1) / n)
    c = np.r_[2.0, np.ones(n - 1), 2.0] * (-1.0) ** np.arange(n + 1)
    slopes = np.outer(c, 1 / c) / (x[:, None] - x + np.eye(n + 1))
    slopes = (slopes - np.diag(slopes.sum(axis=1))) * 2 / tau
    last = np.zeros((1, n))
    last[0, -1] = 1.0
    return slopes[1:, 1:], slopes[1:, :1], last


def _nodes(tau: float, fast: float) -> int:
    """Chebyshev nodes of a delay (s)."""
    return NODES + int(np.ceil(PER_RADIAN * 2 * np.pi * fast * tau)) if tau else 0


@dataclass(frozen=True, repr=False)
class DelayedModes(Modes):
    """The roots of a loop with continuous delays in a circle around 0, and all that grow; infinitely many others decay.

    Its other attributes are those of `Modes`.

    Attributes
    ----------
    radius : float, 1/s
        Radius of the circle.
    decay : float, 1/s
        Roots in the circle that decay faster are left out; inf unless rounding hides them because the delays are long.
    counted : int or None
        Number of roots in the circle or with a real part of at least 0, by the argument principle; None if they cannot
        be counted.
    growing : int or None
        Number of roots that grow, at any frequency, by the argument principle; None if they cannot be counted.
    correction : float, 1/s
        Largest distance of an electromechanical mode from that of the Pade approximation.

    Examples
    --------
    >>> late = st.Controller("deviation:1", "order:1@5", [], [], [], [[100.0]], delay="300ms")
    >>> modes = st.load("two_area").closed_loop(late, storage="50MW").modes()
    >>> modes.growing, modes.certified, modes.stable
    (0, True, True)
    """

    radius: float = 0.0
    decay: float = np.inf
    counted: int | None = 0
    growing: int | None = 0
    correction: float = 0.0

    @property
    def certified(self) -> bool:
        """Whether as many roots were found as counted."""
        return self.counted == len(self)

    @property
    def stable(self) -> bool:
        """Whether no root grows, at any frequency."""
        return self.growing == 0

    def fastest_growing(self) -> str:
        """The growing root with the largest real part, and its mode, or why it is not known."""
        if self.growing is None:
            return "its direct path does not bound the growing roots"
        known = int((self.eigenvalues.real > 0).sum())
        return super().fastest_growing() if known else f"{counted(self.growing, 'root')} that grow were not found"

    def __str__(self) -> str:
        how = f"by {self.correction:.1e}" if self.correction > CONVERGED else f"by less than {CONVERGED:g}"
        moved = f"the approximation in the simulation moves swings {how} 1/s"
        return f"{super().__str__()} {self.proof()}; {moved}."

    def proof(self) -> str:
        """What is counted and found, as a sentence without its end."""
        where = f"below {self.radius:.3g} 1/s"
        if self.decay < self.radius:
            where += f" that decay with less than {self.decay:.3g} 1/s"
        if self.counted is None:
            return f"Continuous delays are exact, but the roots {where} cannot be counted: {len(self)} found"
        found = "all found" if self.certified else f"{len(self)} found"
        return f"Continuous delays are exact: {counted(self.counted, 'root')} {where} or growing, {found}"

    __repr__ = __str__


def delayed_modes(loop: Linear, opened: DelayedLoop) -> DelayedModes:
    """The exact modes of a closed loop with continuous delays, of its linear model with Pade approximations."""
    rotation = loop.rotation()
    near = eigen(loop.A, rotation)
    zero = near.some(near.values == 0)
    with process.one_thread():
        roots = opened.roots(rotation)
    values, right, left = list(zero.values), list(zero.right.T), list(zero.left.T)
    for root in sorted(roots.found, key=lambda root: (root.s.imag, root.s.real)):
        v, w = opened.vectors(root)
        both = root.s.imag > 0
        values += [root.s, root.s.conjugate()] if both else [complex(root.s.real)]
        right += [v, v.conj()] if both else [v.real + 0j]
        left += [w, w.conj()] if both else [w.real + 0j]
    parts = np.array(values), np.array(right).T, np.array(left).T
    for part in parts:
        part.setflags(write=False)
    known = Modes(loop, *parts)
    moved = [np.abs(near.values - known.eigenvalues[k]).min() for k in known.swings()]
    return DelayedModes(
        loop,
        *parts,
        radius=roots.region.radius,
        decay=roots.region.left,
        counted=None if roots.counted is None else roots.counted + rotation.shape[1],  # with the angle references
        growing=roots.growing,
        correction=float(max(moved, default=0.0)),
    )
