"""Stress majorization: points whose distances are close to given ones, d_ij, weighted by 1/d_ij^2.

Each step solves V X' = B(X) X, with the Laplacian V of the weights and B_ij = -w_ij d_ij / |x_i - x_j|; the stress
sum w_ij (|x_i - x_j| - d_ij)^2 never increases.
Source: E. Gansner, Y. Koren, S. North, Graph Drawing by Stress Majorization, 2004, eqs. (2), (6) to (8).
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg, eigsh
from scipy.spatial.distance import cdist

STEPS = 200
TOLERANCE = 3e-4  # relative decrease of the stress in a step, below which it ends
PRECISE = 1e-2  # relative residual of each solution


def stress_majorization(D: np.ndarray) -> np.ndarray:
    """Points (n, 2) whose distances are close to D (n, n); the longest axis is horizontal."""
    n = len(D)
    if n < 3:
        return np.c_[np.arange(n, dtype=float), np.zeros(n)]
    D = np.maximum(D, 1e-9) * (1 - np.eye(n))
    w = np.divide(1.0, D**2, out=np.zeros_like(D), where=D > 0)
    wd, total = w * D, w.sum(axis=1)
    solve, X, before = _laplace(w, total), _scaling(D), np.inf
    for _ in range(STEPS):
        r = cdist(X, X)
        now = float(n * (n - 1) - 2 * np.vdot(wd, r) + 2 * (total @ (X**2).sum(axis=1) - np.vdot(X, w @ X)))
        if before - now < TOLERANCE * now:
            break
        before = now
        np.fill_diagonal(r, 1.0)
        B = np.divide(wd, np.maximum(r, 1e-9, out=r), out=r)
        X = solve(B.sum(axis=1)[:, None] * X - B @ X, X)
    return principal(X)


def _laplace(w: np.ndarray, total: np.ndarray) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Solver of V X' = right from a first guess, by conjugate gradients; V has its rows' sums `total` on its diagonal.

    V is singular by a shift of all points, which does not matter: right has no sum.
    """

    def solve(right: np.ndarray, X: np.ndarray) -> np.ndarray:
        V: Any = LinearOperator(w.shape, matvec=lambda x: total * x - w @ x)
        M: Any = LinearOperator(w.shape, matvec=lambda x: x / total)
        X = X - X.mean(axis=0)
        return np.stack([cg(V, right[:, k], X[:, k], rtol=PRECISE, M=M)[0] for k in range(2)], axis=1)

    return solve


def principal(X: np.ndarray) -> np.ndarray:
    """The points about their mean, turned so that the longest axis is horizontal; the first is left and above."""
    X = X - X.mean(axis=0)
    X = X @ np.linalg.eigh(X.T @ X)[1][:, ::-1]
    return X * np.where(X[0] * [1, -1] > 0, -1.0, 1.0)


def _scaling(D: np.ndarray) -> np.ndarray:
    """Classical scaling: the two largest eigenvectors of the centered squares, from which the steps begin."""
    S = D**2
    S = -0.5 * (S - S.mean(axis=0) - S.mean(axis=1)[:, None] + S.mean())
    n = len(D)
    start = np.cos(np.arange(n))  # the same on every machine
    value, vector = eigsh(S, k=2, v0=start) if n > 10 else tuple(part[..., -2:] for part in np.linalg.eigh(S))
    X = vector[:, ::-1] * np.sqrt(np.maximum(value[::-1], 1e-6))
    return X + 1e-3 * np.c_[np.cos(7.0 * np.arange(n)), np.sin(7.0 * np.arange(n))]  # no two points alike
