"""Devices seen from their terminals: units of coupled states, each with an admittance that is rational in s.

The states fall into units that share no equation, such as a machine with its controls. With the states eliminated, the
currents of a unit are D(s) v, D(s) = -C (F - s)^-1 B, in terms of its voltages v. Around a point s0, with
R = (F - s0)^-1,

    D(s0 + h) = -C (R + h R^2 + h^2 R^3 + ...) B.
"""

from typing import NamedTuple

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

DOUBLINGS = 3
TERMS = ROOT = 2**DOUBLINGS  # terms of a series after the first; power of R whose norm bounds what is left out


class Units(NamedTuple):
    """Units with the same numbers of states and voltages; x' = F x + B v, currents C x."""

    F: np.ndarray  # (units, n, n)
    B: np.ndarray  # (units, n, m)
    C: np.ndarray  # (units, m, n)
    at: np.ndarray  # (units, m) their voltages

    def poles(self) -> np.ndarray:
        """Eigenvalues of all F."""
        return np.linalg.eigvals(self.F).ravel()


class Series(NamedTuple):
    """Taylor coefficients of the admittances of some units, and what bounds the rest."""

    terms: np.ndarray  # (TERMS + 1, units, m, m)
    beyond: np.ndarray  # (ROOT, units)  bounds of the first terms left out
    root: np.ndarray  # (units)  norm of R^ROOT

    def rest(self, r: float) -> np.ndarray:
        """Bounds (units) of the norm of all terms left out, |h| <= r; infinite where the series may diverge."""
        with np.errstate(over="ignore", invalid="ignore"):
            ratio = r**ROOT * self.root
            first = r ** np.arange(TERMS + 1, TERMS + 1 + ROOT) @ self.beyond
            return np.where(ratio < 1, first / np.where(ratio < 1, 1 - ratio, 1), np.inf)


def units(fx: sp.csc_matrix, fv: sp.csr_matrix, gx: sp.csc_matrix) -> list[Units]:
    """The units of x' = fx x + fv v with currents gx x, balanced, in groups of equal size."""
    _, label = connected_components(fx, directed=False)
    order = np.argsort(label, kind="stable")
    groups: dict[tuple[int, int], list[tuple[np.ndarray, ...]]] = {}
    for x in np.split(order, np.cumsum(np.bincount(label))[:-1]):
        v = np.union1d(gx[:, x].indices, fv[x].indices)
        F, B, C = (M.toarray() for M in (fx[x][:, x], fv[x][:, v], gx[v][:, x]))
        scale = np.diag(sl.matrix_balance(F, permute=False)[1])
        groups.setdefault(B.shape, []).append((F * scale / scale[:, None], B / scale[:, None], C * scale, v))
    return [Units(*(np.array(part) for part in zip(*group, strict=True))) for group in groups.values()]


def series(u: Units, s: complex) -> Series:
    """The admittances of some units around a point s (1/s)."""
    R, (count, n, m) = np.linalg.inv(u.F - s * np.eye(u.F.shape[1])), u.B.shape
    X = R @ u.B
    for _ in range(DOUBLINGS):  # R B, R^2 B, ..., side by side
        X, R = np.concatenate([X, R @ X], axis=2), R @ R
    later = R @ X
    terms = -u.C @ np.concatenate([X, later[:, :, :m]], axis=2)
    left_out = np.concatenate([later[:, :, m:], R @ later[:, :, :m]], axis=2)
    beyond = (
        np.linalg.norm(left_out.reshape(count, n, ROOT, m), axis=(1, 3)) * np.linalg.norm(u.C, axis=(1, 2))[:, None]
    )
    return Series(terms.reshape(count, m, TERMS + 1, m).transpose(2, 0, 1, 3), beyond.T, np.linalg.norm(R, axis=(1, 2)))
