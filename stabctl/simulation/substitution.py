"""Sparse factors of a network, and the triangular solution inside the compiled loop.

The entries of both factors stand in one flat list each, in the order of elimination: a loop over columns with a short
loop inside spends its time on mispredicted branches.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from stabctl._util.jit import inline, noinline


class Factors(NamedTuple):
    """P_r Y P_c = L D U, L and U with unit diagonals, which are left out."""

    lower: np.ndarray  # (entries of L, 2)   row and column, columns ascending
    L: np.ndarray  # (entries of L)
    upper: np.ndarray  # (entries of U, 2)   row and column, columns descending
    U: np.ndarray  # (entries of U)
    d: np.ndarray  # (buses)   inverse of D
    rows: np.ndarray  # (buses)   P_r: bus of every row
    cols: np.ndarray  # (buses)   P_c: row of every bus


def factor(Y: sp.csc_matrix) -> Factors:
    """Factors of an admittance matrix."""
    options = {"SymmetricMode": True}
    lu = spl.splu(Y.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1, options=options)
    d = 1 / lu.U.diagonal()
    L, U = sp.tril(lu.L, -1).tocoo(), sp.triu(sp.diags(d) @ lu.U, 1).tocoo()
    down, up = np.lexsort((L.row, L.col)), np.lexsort((U.row, -U.col))
    return Factors(
        np.stack([L.row, L.col], 1)[down].astype(np.uintp),
        L.data[down],
        np.stack([U.row, U.col], 1)[up].astype(np.uintp),
        U.data[up],
        d,
        np.argsort(lu.perm_r).astype(np.uintp),
        lu.perm_c.astype(np.uintp),
    )


@inline
def solve(F, current, work, v):
    """v = inv(Y) current."""
    n = len(current)
    for i in range(n):
        work[i] = current[F.rows[i]]
    for k in range(len(F.L)):
        work[F.lower[k, 0]] -= F.L[k] * work[F.lower[k, 1]]
    for i in range(n):
        work[i] *= F.d[i]
    for k in range(len(F.U)):
        work[F.upper[k, 0]] -= F.U[k] * work[F.upper[k, 1]]
    for i in range(n):
        v[i] = work[F.cols[i]]


@noinline
def solve_apart(F, current, work, v):
    """The same, compiled once."""
    solve(F, current, work, v)
