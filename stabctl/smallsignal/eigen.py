"""Eigenvalues and eigenvectors of a linear model, with the zero eigenvalue of the angle reference separated exactly.

Rotating all angles together changes nothing: A r = 0 with r = 1 at every angle (of rotors, and those that sensors
track) and 0 elsewhere. In a basis that begins
with r, A' = [0 a; 0 A22]. A second zero (nothing restores the frequency) would make A defective: rounding would split
the double zero into a pair of about 1e-7, which looks unstable. In A22 it is a simple eigenvalue, as accurate as any.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgeev, dgeev_lwork
from scipy.sparse.csgraph import connected_components

NEAR = 1e-9  # eigenvalues this close (relative) share one eigenspace
ZERO = 1e-7  # 1/s   an eigenvalue this small is zero
GROWING = 1e-6  # 1/s   real part of an eigenvalue from which a loop counts as unstable


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
    """Eigenvalues with left and right eigenvectors; `rotation` is the vector r (n) above.

    The right vector of a defective zero is a generalized one: A v is a rotation of all angles, not zero.
    """
    turned, u = A.copy(order="F"), _normal(rotation)
    _reflect(turned, u)
    _reflect(turned.T, u)
    values, Z, Y = _geev(turned[1:, 1:])
    order = np.lexsort((-values.imag, values.real, np.abs(values.imag)))
    values, Z, Y = np.where(np.abs(values) < ZERO, 0, values)[order], Z[:, order], Y[:, order]
    Z = _paired(values, Y, Z)
    a = turned[0, 1:] @ Y
    coupling = np.divide(a, values, out=np.zeros(len(a), complex), where=values != 0)
    both = np.zeros((2 * len(A), len(A)), complex).T
    V, W = both[:, : len(A)], both[:, len(A) :]
    V[0, 0] = W[0, 0] = 1
    V[0, 1:], V[1:, 1:] = coupling, Y
    W[1:, 1:], W[1:, 0] = Z, -(Z @ coupling.conj())
    _reflect(both, u)
    return Eigen(np.r_[0j, values], V, W)


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


def values(A: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Eigenvalues alone (n - 1), without the zero of the angle reference; `rotation` as in `eigen`."""
    return np.linalg.eigvals(without(rotation, A, A[:, :0], A[:0])[0])


def without(
    rotation: np.ndarray, A: np.ndarray, B: np.ndarray, C: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B and C without the angle reference, which no output sees; `rotation` as in `eigen`."""
    A, B, C, u = A.copy(order="F"), B.copy(), C.copy(), _normal(rotation)
    for rows in (A, A.T, B, C.T):
        _reflect(rows, u)
    return A[1:, 1:], B[1:], C[:, 1:]


def _normal(rotation: np.ndarray) -> np.ndarray:
    """Unit normal of the mirror that maps the first axis to the direction of r; 0 if that is the first axis."""
    u = -rotation / np.linalg.norm(rotation)
    u[0] += 1
    return u / (np.linalg.norm(u) or 1.0)


def _reflect(M: np.ndarray, u: np.ndarray) -> None:
    """M := H M, where H = 1 - 2 u u^T."""
    rows = np.flatnonzero(u)
    u = u[rows, None]
    M[rows] -= 2 * u * (u.T @ M[rows])


def _paired(values: np.ndarray, Y: np.ndarray, Z: np.ndarray) -> np.ndarray:
    """Left vectors scaled to W^H V = I, within groups of eigenvalues that coincide."""
    Z = Z / np.einsum("ij,ij->j", Z.conj(), Y).conj()
    upper = np.sort(values.real[values.imag >= 0])
    if (np.diff(upper) <= NEAR * np.maximum(1, np.abs(values).max())).any():
        near = np.abs(values[:, None] - values) <= NEAR * np.maximum(1, np.abs(values))
        member = connected_components(near, directed=False)[1]
        for group in (np.flatnonzero(member == g) for g in np.flatnonzero(np.bincount(member) > 1)):
            raw = Z[:, group] / np.linalg.norm(Z[:, group], axis=0)
            Z[:, group] = raw @ np.linalg.pinv(Y[:, group].conj().T @ raw)
    return Z
