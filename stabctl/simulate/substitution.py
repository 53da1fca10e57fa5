"""Sparse factors of a network, and the triangular solution inside the compiled loop."""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from stabctl.compiled import kernel


class Factors(NamedTuple):
    """P_r Y P_c = L U with unit L; U without its diagonal, which is kept inverted."""

    Lp: np.ndarray
    Li: np.ndarray
    Lx: np.ndarray
    Up: np.ndarray
    Ui: np.ndarray
    Ux: np.ndarray
    Ud: np.ndarray
    rows: np.ndarray
    cols: np.ndarray


def factor(Y: sp.csc_matrix) -> Factors:
    """Factors of an admittance matrix."""
    options = {"SymmetricMode": True}
    lu = spl.splu(Y.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1, options=options)
    L, U = sp.tril(lu.L, -1).tocsc(), sp.triu(lu.U, 1).tocsc()
    return Factors(L.indptr, L.indices, L.data, U.indptr, U.indices, U.data, 1 / lu.U.diagonal(), lu.perm_r, lu.perm_c)


@kernel
def solve(F, current, work, v):  # noqa: ANN001, ANN201, N803
    """v = inv(Y) current."""
    n = len(current)
    for i in range(n):
        work[F.rows[i]] = current[i]
    for j in range(n):
        y = work[j]
        for k in range(F.Lp[j], F.Lp[j + 1]):
            work[F.Li[k]] -= F.Lx[k] * y
    for j in range(n - 1, -1, -1):
        y = work[j] * F.Ud[j]
        work[j] = y
        for k in range(F.Up[j], F.Up[j + 1]):
            work[F.Ui[k]] -= F.Ux[k] * y
    for i in range(n):
        v[i] = work[F.cols[i]]
