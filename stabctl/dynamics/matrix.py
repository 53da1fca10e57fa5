"""Matrices of a system: sparse, or dense arrays if it is small, because handling a few sparse entries takes longer."""

from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

Matrix: TypeAlias = Any  # csr_matrix or csc_matrix, or an array if the system is small


def matrix(entries: np.ndarray, at: tuple[np.ndarray, np.ndarray], shape: tuple[int, int], dense: bool) -> Matrix:
    """The matrix with these entries at these rows and columns; those of one place are added up."""
    if dense:
        return np.bincount(at[0] * shape[1] + at[1], entries, shape[0] * shape[1]).reshape(shape)
    live = entries != 0
    return sp.csr_matrix((entries[live], (at[0][live], at[1][live])), shape=shape)


def array(M: Matrix) -> np.ndarray:
    """A matrix as a dense array."""
    return M if isinstance(M, np.ndarray) else M.toarray()


def filled(M: Matrix, axis: int) -> np.ndarray:
    """Which columns (axis 0) or rows (axis 1) have an entry."""
    return np.asarray(abs(M).sum(axis)).ravel() != 0


def solved(M: Matrix, b: np.ndarray) -> np.ndarray:
    """inv(M) b."""
    return np.linalg.solve(M, b) if isinstance(M, np.ndarray) else splu(M.tocsc()).solve(b)
