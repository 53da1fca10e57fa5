"""Algebraic Riccati equations by doubling, which takes a tenth of the time of Schur vectors for hundreds of states.

    continuous   A' X + X A - X G X + Q = 0
    discrete     A' X (1 + G X)^-1 A + Q = X,       G = B R^-1 B'

Source: E. Chu, H. Fan, W. Lin, A structure-preserving doubling algorithm for continuous-time algebraic Riccati
equations, Linear Algebra and its Applications 396, 2005.
"""

import numpy as np

SHIFT = 10.0  # 1/s   of the Cayley transform; must not be an eigenvalue of A
MOST = 60  # doublings
ENOUGH = 1e-14  # relative change of X of the last doubling


def continuous(A: np.ndarray, G: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """The stabilizing solution of the continuous equation. Raises `numpy.linalg.LinAlgError` if there is none."""
    inverse = np.linalg.inv(A - SHIFT * np.eye(len(A)))
    W = np.linalg.inv((A - SHIFT * np.eye(len(A))).T + Q @ inverse @ G)
    return _doubled(np.eye(len(A)) + 2 * SHIFT * W.T, 2 * SHIFT * inverse @ G @ W, 2 * SHIFT * W @ Q @ inverse)


def discrete(A: np.ndarray, G: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """The stabilizing solution of the discrete equation. Raises `numpy.linalg.LinAlgError` if there is none."""
    return _doubled(A, G, Q)


def _doubled(A: np.ndarray, G: np.ndarray, X: np.ndarray) -> np.ndarray:
    """The limit of X; every step doubles the horizon of the optimization."""
    one = np.eye(len(A))
    for _ in range(MOST):
        with np.errstate(over="ignore", invalid="ignore"):
            M = np.linalg.inv(one + G @ X)
            change = A.T @ X @ M @ A
            A, G, X = A @ M @ A, _even(G + A @ M @ G @ A.T), _even(X + change)
        if not np.isfinite(X).all():
            break
        if np.abs(change).max() <= ENOUGH * np.abs(X).max():
            return X
    raise np.linalg.LinAlgError("no stabilizing solution")


def _even(X: np.ndarray) -> np.ndarray:
    return np.asarray(X + X.T) / 2
