"""The characteristic function of a loop with delays, and how far its phase is known from one point.

The loop opened at its delays is H(s) = D + C (s - A)^-1 B = D + sum_i c_i b_i / (s - a_i), a_i the eigenvalues of A.
Its roots are the zeros of the entire function

    f(s) = det(s - A) det N(s),  N = 1 - E H,  E = diag(exp(-s tau)),

where a row of N may be multiplied by exp(s tau_j), whose phase is known. Around a point s0, with
N(s0 + h) = N0 (1 + M(h)), M = h M1 + ..., the Frobenius norm F of M limits the phase of the determinant, as in
`argument_principle`:

    |log det(1 + M) - h tr M1| <= -log(1 - F) - F + sqrt(n) |M - h M1|.

What M leaves out after h M1 is bounded term by term: |exp(x) - 1 - x| <= exp|x| - 1 - |x|, the norms of the next terms
of H, and what they leave out, h^k / ((s0 - a)^k (s0 + h - a)) of 1 / (s0 + h - a).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg as sl

from ._argument_principle import SLACK, WHOLE, OnBoundaryError
from .eigen import GROWING

TERMS = 4  # of the series of H around a point that are computed; the rest is bounded
ROUNDING = 1e-14  # error of H, relative to the sum of the magnitudes of its terms
TOGETHER = 2**19  # numbers in the arrays of points that are computed at once
DEPENDENT = 1e-12  # size of a combination of rows of H, relative to the largest, that is zero
PARALLEL = 1e12  # condition of the eigenvectors, from which A has too few
CHANGES = 0.0, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4  # relative, of the diagonal of such an A
FARTHEST = 1e12  # 1/s   largest bound of the growing roots
STARTS = 33  # points of a path to begin with
HALVINGS = 44  # of the distance between them
MOST = 4000  # points added at once
ROUNDED = 0.05  # rad   largest error of a phase by rounding
Path = Callable[[np.ndarray], np.ndarray]  # points (1/s) at parameters from 0 to 1


@dataclass(frozen=True)
class Points:
    """N at points of the s-plane, its rows scaled."""

    s: np.ndarray  # (points) 1/s
    phase: np.ndarray  # (points) of det N, without the scaling
    slope: np.ndarray  # (points) d log det N / ds, without the scaling
    first: np.ndarray  # (points) norm of M1
    gaps: np.ndarray  # (points, n) |s - a_i|
    own: np.ndarray  # (points, channels) what multiplies exp(s tau) in a row of N, or 0
    shift: np.ndarray  # (points, channels) what multiplies exp(-s tau) H in a row of N, or 0
    plain: np.ndarray  # (points, channels) what multiplies H in a row of N, or 0
    rows: np.ndarray  # (points, channels, 1 + TERMS) norms of the rows of the Taylor coefficients of H
    spread: np.ndarray  # (points, channels) norms of the columns of N^-1

    def some(self, chosen: np.ndarray | slice) -> "Points":
        """The chosen ones."""
        return Points(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    def joined(self, more: "Points") -> "Points":
        """These and more."""
        both = ((getattr(self, name), getattr(more, name)) for name in self.__dataclass_fields__)
        return Points(*map(np.concatenate, both))


@dataclass(frozen=True)
class Characteristic:
    """The function f of a loop with delays (channels, s), in the coordinates of the eigenvectors of A."""

    poles: np.ndarray  # (n) a_i, 1/s
    b: np.ndarray  # (n, channels)
    c: np.ndarray  # (channels, n)
    D: np.ndarray
    delays: np.ndarray
    neglected: float = 0.0  # size of what rounding leaves of H where it is zero

    @classmethod
    def of(cls, A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, delays: np.ndarray) -> "Characteristic":
        """Of x' = A x + B v, w = C x + D v, v = w after the delays; outputs without delay are closed."""
        now = delays == 0
        if now.any():
            late = ~now
            Q = np.linalg.inv(np.eye(now.sum()) - D[np.ix_(now, now)])
            x, v = Q @ C[now], Q @ D[np.ix_(now, late)]
            A, C = A + B[:, now] @ x, C[late] + D[np.ix_(late, now)] @ x
            B, D = B[:, late] + B[:, now] @ v, D[np.ix_(late, late)] + D[np.ix_(late, now)] @ v
            delays = delays[late]
        poles, V = _apart(A)
        found = cls(poles.astype(complex), np.linalg.solve(V, B.astype(complex)), C @ V, D, delays)
        size = found.largest(1 + 2 * np.abs(poles).max(initial=0.0))
        scale = np.diag(sl.matrix_balance(size, permute=False)[1]) if len(size) else np.ones(0)
        found = replace(found, b=found.b * scale, c=found.c / scale[:, None], D=D * scale / scale[:, None])
        return found._independent(False)._independent(True)

    def _independent(self, columns: bool) -> "Characteristic":
        """Without the combinations of rows or columns of H with one delay that are zero for every s.

        With H = U U^T H and E U = U E, det(1 - E H) = det(1 - E U^T H U). Such combinations are exact, the deviations
        of all machines from their mean for example, but would be hidden by rounding where E is large.
        """
        if not len(self.delays):
            return self
        samples = np.exp(1j * np.linspace(0.3, 2.8, 5)) * 10.0 ** np.arange(-0.5, 2.0, 0.5)
        H = np.array([self.D + (self.c / (s - self.poles)) @ self.b for s in samples])
        H = np.concatenate(H.transpose(0, 2, 1) if columns else H, axis=1)
        U, tau, left_out = independent(np.hstack([H.real, H.imag]), self.delays)
        left_out = max(left_out, self.neglected)
        return replace(self, b=self.b @ U, c=U.T @ self.c, D=U.T @ self.D @ U, delays=tau, neglected=left_out)

    def scaled(self, gain: float) -> "Characteristic":
        """With H multiplied by a gain."""
        return replace(self, c=gain * self.c, D=gain * self.D, neglected=gain * self.neglected)

    def later(self, delay: float) -> "Characteristic":
        """With all delays longer (s)."""
        return replace(self, delays=self.delays + delay)

    @cached_property
    def _weights(self) -> np.ndarray:
        """Norms of the rows of c_i b_i (n, channels)."""
        return np.abs(self.c.T) * np.linalg.norm(self.b, axis=1)[:, None]

    def at(self, s: np.ndarray) -> Points:
        """N at points (1/s)."""
        most = max(1, TOGETHER // max(1, self.b.size))
        parts = [self._at(s[k : k + most]) for k in range(0, max(len(s), 1), most)]
        found = parts[0]
        for part in parts[1:]:
            found = found.joined(part)
        return found

    def _at(self, s: np.ndarray) -> Points:
        R, tau = len(self.delays), self.delays
        away = s[:, None] - self.poles
        terms = self.c / away[:, None, :]
        series = [self.D + terms @ self.b]
        for _ in range(TERMS):
            terms = -terms / away[:, None, :]
            series.append(terms @ self.b)
        (H, slope, *_), rows = series, np.stack([np.linalg.norm(term, axis=2) for term in series], axis=2)
        with np.errstate(divide="ignore"):
            turned = np.log(rows[:, :, 0]) > s.real[:, None] * tau  # |E H| > 1: rows multiplied by exp(s tau)
        e = np.exp(np.where(turned, s[:, None], -s[:, None]) * tau)
        own, shift, plain = np.where(turned, e, 0), np.where(turned, 0, e), turned.astype(float)
        N = -(plain + shift)[:, :, None] * H
        N1 = -(plain + shift)[:, :, None] * slope + (tau * shift)[:, :, None] * H
        at = np.arange(R)
        N[:, at, at] += np.where(turned, e, 1)
        N1[:, at, at] += tau * own
        with np.errstate(over="ignore", invalid="ignore"):
            try:
                inverse = np.linalg.inv(N)
            except np.linalg.LinAlgError:
                raise OnBoundaryError from None
            M1 = inverse @ N1
        known = (turned * tau).sum(axis=1)
        phase = np.angle(np.linalg.slogdet(N)[0]) - known * s.imag
        change = np.trace(M1, axis1=1, axis2=2) - known
        first, spread = np.linalg.norm(M1, axis=(1, 2)), np.linalg.norm(inverse, axis=1)
        return Points(s, phase, change, first, np.abs(away), np.abs(own), np.abs(shift), plain, rows, spread)

    def slack(self, p: Points, r: np.ndarray) -> np.ndarray:
        """Largest errors (points) of the predicted phases, |h| <= r (points); infinite where nothing is known."""
        r = r[:, None]
        inside: np.ndarray = np.all(r < 0.99 * p.gaps, axis=1)
        gaps = np.where(inside[:, None], p.gaps, np.inf)
        later = r ** (TERMS + 1) * ((1 / (gaps ** (TERMS + 1) * (gaps - r))) @ self._weights)
        later += np.einsum("pjk,pk->pj", p.rows[:, :, 2:], r ** np.arange(2, TERMS + 1))
        x = np.minimum(r * self.delays, 50.0)
        one, two = np.expm1(x), np.expm1(x) - x
        rest = (
            p.own * two
            + p.shift * (two * p.rows[:, :, 0] + one * r * p.rows[:, :, 1] + (one + 1) * later)
            + p.plain * later
        )
        rest += ROUNDING * (p.shift + p.plain) * ((1 / gaps) @ self._weights)
        left_out = (p.spread * rest).sum(axis=1)
        F = r[:, 0] * p.first + left_out
        good = inside & (F < 1)
        F = np.where(good, F, 0)
        return np.where(good, -np.log1p(-F) - F + np.sqrt(len(self.delays)) * left_out, np.inf)

    def turn(self, path: Path) -> float:
        """Change of the phase of det N along a line or an arc of less than a half circle.

        Between two neighboring points it is known to less than half a turn, so none is lost: points are added until
        this is so. Raises `OnBoundaryError` where a root lies on the path, as far as can be told.
        """
        t = np.linspace(0, 1, STARTS)
        p, turned = self.at(path(t)), 0.0
        a, b, ta, tb = p.some(slice(0, -1)), p.some(slice(1, None)), t[:-1], t[1:]
        for _ in range(HALVINGS):
            half = (ta + tb) / 2
            middle = path(half)
            known = self.slack(a, np.abs(middle - a.s)) <= SLACK
            known &= self.slack(b, np.abs(middle - b.s)) <= SLACK
            expected = (a.slope * (middle - a.s) - b.slope * (middle - b.s)).imag[known]
            change = (b.phase - a.phase)[known]
            turned += float((expected + (change - expected + np.pi) % (2 * np.pi) - np.pi).sum())
            if known.all():
                return turned
            left = ~known
            a, b, ta, tb, half = a.some(left), b.some(left), ta[left], tb[left], half[left]
            between = self.at(middle[left])
            if len(half) > MOST or not (self.slack(between, np.zeros(len(half))) <= ROUNDED).all():
                break
            a, b, ta, tb = a.joined(between), between.joined(b), np.r_[ta, half], np.r_[half, tb]
        raise OnBoundaryError

    def largest(self, far: float) -> np.ndarray:
        """Bounds of the magnitudes of H (channels, channels) for |s| >= far, Re s >= 0.

        |s - a| >= |s| - |a|, and |s - a| >= |s| |Re a| / |a| if Re a <= 0. The first terms of the series of H in 1/s
        may be taken exactly: sum c a^k b / (s^k (s - a)) is what is left after k of them.
        """
        size = np.abs(self.poles)
        steep = np.divide(-self.poles.real, size, out=np.ones(len(size)), where=size > 0)
        gap = np.maximum(far - size, far * np.maximum(steep, 0))
        if not (gap > 0).all():
            return np.full(self.D.shape, np.inf)
        before, best, c = np.abs(self.D), np.full(self.D.shape, np.inf), self.c
        for k in range(4):
            best = np.minimum(best, before + (np.abs(c) / (gap * far**k)) @ np.abs(self.b))
            before = before + np.abs(c @ self.b) / far ** (k + 1)
            c = c * self.poles
        return best

    def bound(self) -> float:
        """|s| beyond which no root has Re s >= 0, 1/s; infinite if the direct path D does not allow any.

        There the spectral radius of |H| is below 1, and that of E H as well.
        """

        def small(far: float) -> bool:
            size = self.largest(far)
            return bool(np.isfinite(size).all() and np.abs(np.linalg.eigvals(size)).max(initial=0.0) < 1 - 1e-6)

        low, high = 1e-3, FARTHEST
        if not small(high):
            return np.inf
        while high > 1.01 * low:
            middle = float(np.sqrt(low * high))
            low, high = (low, middle) if small(middle) else (middle, high)
        return high

    def shifted(self, x: float) -> "Characteristic":
        """As a function of s - x (1/s)."""
        late = np.exp(-x * self.delays)[:, None]
        return replace(self, poles=self.poles - x, c=late * self.c, D=late * self.D)

    def far(self, s: complex) -> float:
        """Phase of det N at a point beyond the `bound`, from 0 on the positive real axis."""
        away = s - self.poles
        H = self.D + (self.c / away) @ self.b
        return float(np.angle(1 - np.linalg.eigvals(np.exp(-s * self.delays)[:, None] * H)).sum())


def independent(rows: np.ndarray, delays: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Orthonormal combinations (channels, independent) that span the rows of each delay, with their delays.

    The last is the size of the rows' part that is left out.
    """
    whole, late, left_out = [np.zeros((len(delays), 0))], [np.zeros(0)], 0.0
    for tau in np.unique(delays):
        own = delays == tau
        U, sizes, _ = np.linalg.svd(rows[own], full_matrices=False)
        kept = sizes > DEPENDENT * sizes[0]
        left_out = max(left_out, float(sizes[~kept].max(initial=0.0)))
        whole.append(np.zeros((len(delays), kept.sum())))
        whole[-1][own] = U[:, kept]
        late.append(np.full(kept.sum(), tau))
    return np.hstack(whole), np.concatenate(late), left_out


def _apart(A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and vectors of A; where equal stages of a controller leave it without enough vectors, of A nearby.

    Diagonal elements are then changed, each a little differently, by as few parts as give independent vectors.
    """
    for change in CHANGES:
        poles, V = np.linalg.eig(A + change * np.diag(np.diag(A) * np.linspace(-1, 1, len(A))))
        if np.linalg.cond(V, 1) < PARALLEL:
            break
    return poles, V


def growing(f: Characteristic) -> int | None:
    """Number of roots that grow; None if they cannot be counted."""
    f = f.shifted(GROWING)
    far = f.bound()
    try:
        if np.isinf(far):
            return None
        turns = (f.far(1j * far) + f.turn(lambda t: 1j * far * (1 - t) ** 3)) / np.pi
        return whole(turns) + int((f.poles.real > 0).sum())
    except OnBoundaryError:
        return None


def whole(turns: float) -> int:
    """The whole number of turns; raises `OnBoundaryError` if rounding is too large."""
    if abs(turns - round(turns)) > WHOLE:
        raise OnBoundaryError
    return round(turns)
