"""Eigenvalues and eigenvectors: all of a dense model without its angle references, or the nearest of a sparse model.

Rotating all angles of an island together changes nothing: A R = 0, where R has a column for every island, with 1 at its
angles (of rotors, and those that sensors track) and 0 elsewhere. In a basis that begins with R, A' = [0 a; 0 A22]. A
second zero (nothing restores the frequency) would make A defective: rounding would split the double zero into a pair of
about 1e-7, which looks unstable. In A22 it is a simple eigenvalue, as accurate as any.

The nearest to a shift s come from block Arnoldi iterations on the sparse descriptor equations: (A - s)^-1 b is the x of
[fx - s, fv; gx, gv] [x; v] = [b; 0], which takes one sparse factorization per shift. The iterations find the
eigenvalues nearest to the shift first; with blocks of vectors, also those that coincide.

Sources: J. Rommes, N. Martins, IEEE Trans. Power Syst. 21 (2006); Y. Saad, Numerical Methods for Large Eigenvalue
Problems, ch. 6.
"""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
from scipy.linalg.lapack import dgeev, dgeev_lwork
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from stabctl._util.errors import StudyError

from .descriptor import Descriptor

NEAR = 1e-9  # eigenvalues this close (relative) share one eigenspace
ZERO = 1e-7  # 1/s   an eigenvalue this small is zero
GROWING = 1e-6  # 1/s   real part of an eigenvalue from which a loop counts as unstable

SEED = 0  # of the random start vectors
PRECISE = 1e-10  # relative residual of a vector that is taken; the Rayleigh quotient squares it
AGREE = 1e-7  # left and right eigenvalues this close, relative to their distance from the shift, are the same
TRUE = 1e-6  # relative residual |A v - s v| of an eigenvector, at most
SAME = 1e-6  # part of a mode along one that is known already, from which it is no other
TINY = 1e-8  # eigenvalues of the operator this small, relative to the largest, are those of modes taken out
Product = Callable[[np.ndarray], np.ndarray]  # of an operator and a block of vectors


class Eigen(NamedTuple):
    """A V = V diag(eigenvalues), W^H V = I, by frequency, conjugate pairs next to each other."""

    values: np.ndarray  # (n) complex, 1/s
    right: np.ndarray  # (n, n) V, a column per mode
    left: np.ndarray  # (n, n) W, a column per mode

    def some(self, chosen: np.ndarray) -> "Eigen":
        """The chosen ones (places or a mask)."""
        return Eigen(self.values[chosen], self.right[:, chosen], self.left[:, chosen])

    def joined(self, more: "Eigen") -> "Eigen":
        """These and more."""
        return Eigen(*(np.concatenate(pair, axis=-1) for pair in zip(self, more, strict=True)))


def eigen(A: np.ndarray, rotation: np.ndarray) -> Eigen:
    """Eigenvalues with left and right eigenvectors; `rotation` is the matrix R (n, islands) above.

    The first ones are the zeros of the angle references. The right vector of a defective zero is a generalized one: A v
    is a rotation of all angles, not zero.
    """
    turned, mirrors = A.copy(order="F"), _mirrors(rotation)
    _reflect(turned, mirrors)
    _reflect(turned.T, mirrors)
    m = len(mirrors)
    values, Z, Y = _geev(turned[m:, m:])
    order = np.lexsort((-values.imag, values.real, np.abs(values.imag)))
    values, Z, Y = np.where(np.abs(values) < ZERO, 0, values)[order], Z[:, order], Y[:, order]
    Z = _paired(values, Y, Z)
    a = turned[:m, m:] @ Y
    coupling = np.divide(a, values, out=np.zeros(a.shape, complex), where=values != 0)
    both = np.zeros((2 * len(A), len(A)), complex).T
    V, W = both[:, : len(A)], both[:, len(A) :]
    V[:m, :m] = W[:m, :m] = np.eye(m)
    V[:m, m:], V[m:, m:] = coupling, Y
    W[m:, m:], W[m:, :m] = Z, -(Z @ coupling.conj().T)
    _reflect(both, mirrors[::-1])
    return Eigen(np.r_[np.zeros(m, complex), values], V, W)


def _geev(A: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eigenvalues, left and right vectors from LAPACK, as from `scipy.linalg.eig`, which takes longer if A is small."""
    if not len(A):
        return np.zeros(0, complex), *np.zeros((2, 0, 0), complex)
    re, im, left, right, failed = dgeev(A, lwork=int(dgeev_lwork(len(A))[0]))
    if failed:
        raise np.linalg.LinAlgError("The QR algorithm found no eigenvalues.")
    first = np.flatnonzero(im > 0)  # of each pair, whose vectors are stored as real and imaginary part
    vectors = []
    for part in (left, right):
        v = part.astype(complex)
        v[:, first] += 1j * part[:, first + 1]
        v[:, first + 1] = v[:, first].conj()
        vectors.append(v)
    return re + 1j * im, *vectors


def _paired(values: np.ndarray, Y: np.ndarray, Z: np.ndarray) -> np.ndarray:
    """Left vectors scaled to W^H V = I, within groups of eigenvalues that coincide; Z are unit vectors."""
    raw, Z = Z, Z / np.einsum("ij,ij->j", Z.conj(), Y).conj()
    upper = np.sort(values.real[values.imag >= 0])
    if (np.diff(upper) <= NEAR * np.maximum(1, np.abs(values).max())).any():
        near = np.abs(values[:, None] - values) <= NEAR * np.maximum(1, np.abs(values))
        member = connected_components(near, directed=False)[1]
        for group in (np.flatnonzero(member == g) for g in np.flatnonzero(np.bincount(member) > 1)):
            Z[:, group] = raw[:, group] @ np.linalg.pinv(Y[:, group].conj().T @ raw[:, group])
    return Z


def values(A: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Eigenvalues alone, without the zeros of the angle references; `rotation` as in `eigen`."""
    return np.linalg.eigvals(without(rotation, A, A[:, :0], A[:0])[0])


def without(
    rotation: np.ndarray, A: np.ndarray, B: np.ndarray, C: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B and C without the angle references, which no output sees; `rotation` as in `eigen`."""
    A, B, C, mirrors = A.copy(order="F"), B.copy(), C.copy(), _mirrors(rotation)
    for rows in (A, A.T, B, C.T):
        _reflect(rows, mirrors)
    m = len(mirrors)
    return A[m:, m:], B[m:], C[:, m:]


def _mirrors(rotation: np.ndarray) -> list[np.ndarray]:
    """Unit normals of mirrors that, one after the other, map the columns of R to the directions of the first axes.

    A normal is 0 if its column has that direction already; columns of zeros are left out.
    """
    found: list[np.ndarray] = []
    for column in rotation[:, rotation.any(axis=0)].T:
        u, i = -column / np.linalg.norm(column), len(found)
        _reflect(u[:, None], found)
        u[i] += 1
        found.append(u / (np.linalg.norm(u) or 1.0))
    return found


def _reflect(M: np.ndarray, mirrors: Iterable[np.ndarray]) -> None:
    """M := H M, where H are the reflections 1 - 2 u u^T, one after the other."""
    for normal in mirrors:
        rows = np.flatnonzero(normal)
        u = normal[rows, None]
        M[rows] -= 2 * u * (u.T @ M[rows])


# The modes nearest to a shift.


class Near(NamedTuple):
    """Modes found around a shift, and the radius (1/s) within which they seem to be all."""

    shift: complex
    modes: Eigen
    radius: float


def near(d: Descriptor, shift: complex, steps: tuple[int, int], known: Eigen) -> Near:
    """Modes around a shift (1/s), other than those known already; W^H V = 1.

    `steps` are the number of vectors in a block, and the number in all. Only modes whose left and right vectors both
    converged are returned.
    """
    n = len(d.rows)
    forward, adjoint = _resolvent(d, shift)
    right = _arnoldi(forward, _without(known.right, known.left), n, *steps)
    left = _arnoldi(adjoint, _without(known.left, known.right), n, *steps)
    groups = _matched(right.values, left.values.conj())
    V, W, radius = [], [], np.inf
    for of_right, of_left in groups:
        pair = right.vectors[:, of_right], left.vectors[:, of_left]
        if len(of_right) != len(of_left) or max(right.miss[of_right].max(), left.miss[of_left].max()) > PRECISE:
            radius = min(radius, float(np.abs(1 / right.values[of_right]).min()))
            continue
        V.append(pair[0])
        W.append(pair[1] @ np.linalg.pinv(pair[0].conj().T @ pair[1]))
    if not V:
        return Near(shift, known.some(np.zeros(0, int)), radius)
    found = _checked(d, np.concatenate(V, axis=1), np.concatenate(W, axis=1))
    again = np.abs(known.left.conj().T @ found.right).max(axis=0, initial=0.0) > SAME
    return Near(shift, found.some(~again), radius)


def _resolvent(d: Descriptor, shift: complex) -> tuple[Product, Product]:
    n, m = len(d.rows), d.gv.shape[0]
    moved: Any = shift * sp.identity(n, format="csc")
    pencil = sp.bmat([[d.fx - moved, d.fv], [d.gx, d.gv]], format="csc")
    try:
        factors = splu(pencil, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1, options={"SymmetricMode": True})
    except RuntimeError:
        raise StudyError(f"The shift {shift:.4g} 1/s is itself an eigenvalue; choose another one nearby.") from None

    def product(trans: str) -> Product:
        def solved(b: np.ndarray) -> np.ndarray:
            padded = np.zeros((n + m, b.shape[1]), complex, "F")
            padded[:n] = b
            return factors.solve(padded, trans)[:n]  # type: ignore[call-overload]

        return solved

    return product("N"), product("H")


def _without(V: np.ndarray, W: np.ndarray) -> Product:
    """Vectors without their parts along the modes V, W."""
    adjoint = W.conj().T
    return lambda x: x - V @ (adjoint @ x)


class Ritz(NamedTuple):
    """Eigenvalues of an operator, the largest first, with vectors and relative residuals of these."""

    values: np.ndarray
    vectors: np.ndarray
    miss: np.ndarray


def _arnoldi(product: Product, without: Product, n: int, block: int, most: int) -> Ritz:
    """Arnoldi iterations in the invariant subspace without the modes known, to which rounding would lead back."""
    if n <= most:
        Q = np.eye(n, dtype=complex)
        return _ritz(Q, without(product(Q)), block)
    size = most // block * block
    start = np.random.default_rng(SEED).normal(size=(2, n, block))
    Q, P = np.zeros((2, size, n), complex).transpose(0, 2, 1)  # columns are contiguous; P = operator Q
    new = without(product(start[0] + 1j * start[1]))
    for k in range(0, size, block):
        for _ in range(2):
            new = new - Q[:, :k] @ (new.conj().T @ Q[:, :k]).conj().T
            new = sl.qr(new, mode="economic", check_finite=False)[0]
        Q[:, k : k + block] = new
        new = product(new)
        P[:, k : k + block] = new = without(new)
    return _ritz(Q, P, block)


def _ritz(Q: np.ndarray, P: np.ndarray, block: int) -> Ritz:
    """Eigenvalues in the space of the columns of Q, which an operator turns into P; only the last block leaves it.

    Vectors that are not precise are zero.
    """
    H = Q.conj().T @ P
    mu, Z = np.linalg.eig(H)
    order = np.argsort(-np.abs(mu))
    order = order[np.abs(mu[order]) > TINY * np.abs(mu).max()]
    mu, Z = mu[order], Z[:, order]
    beyond = P[:, -block:] - Q @ H[:, -block:]
    miss = np.linalg.norm(beyond @ Z[-block:], axis=0) / np.abs(mu)
    near, V = miss <= PRECISE, np.zeros((len(Q), len(mu)), complex)
    V[:, near] = P @ Z[:, near] / mu[near]  # once more multiplied by the operator: small residuals also in terms of A
    miss[near] = np.linalg.norm(V[:, near] - Q @ Z[:, near], axis=0)
    return Ritz(mu, V, miss)


def _matched(right: np.ndarray, left: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Groups of eigenvalues that coincide, as places among the right and the left ones."""
    both = np.r_[right, left]
    alike = np.abs(both[:, None] - both) <= AGREE * np.abs(both)
    label = connected_components(alike, directed=False)[1]
    of_right, of_left = np.split(label, [len(right)])
    return [(np.flatnonzero(of_right == g), np.flatnonzero(of_left == g)) for g in np.unique(of_right)]


def _checked(d: Descriptor, V: np.ndarray, W: np.ndarray) -> Eigen:
    """Modes with the values w^H A v, whose error is the product of those of both vectors; only true eigenvectors."""
    size = np.linalg.norm(V, axis=0)
    V, W = V / size, W * size
    factors, currents = splu(d.gv), d.gx @ V
    moved = d.fx @ V - d.fv @ (factors.solve(currents.real) + 1j * factors.solve(currents.imag))
    values = np.einsum("ik,ik->k", W.conj(), moved)
    true = np.linalg.norm(moved - V * values, axis=0) < TRUE * np.abs(values)
    return Eigen(values, V, W).some(true)
