"""Sparse factors of a network, and the triangular solution inside the compiled loop.

The entries of each factor are in one flat list, because a short loop inside a loop over columns would spend its time on
mispredicted branches. Columns of the same level are independent and next to each other, so that the processor can work
on several at once. What the iterated buses depend on is eliminated last, so an iteration repeats only that part.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from stabctl._util.jit import inline, noinline
from stabctl._util.words import record

OPTIONS: Any = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.1, "options": {"SymmetricMode": True}}


@record
class Factors(NamedTuple):
    """P_r Y P_c = L D U; L and U have unit diagonals, which are not stored.

    Places are unsigned numbers, so that compiled code need not look for negative ones.
    """

    L: np.ndarray  # (entries of L)   columns ascending
    L_row: np.ndarray  # (entries of L)
    L_col: np.ndarray  # (entries of L)
    U: np.ndarray  # (entries of U)   the iterated rows first, then columns descending
    U_row: np.ndarray  # (entries of U)
    U_col: np.ndarray  # (entries of U)
    d: np.ndarray  # (buses)   inverse of D
    rows: np.ndarray  # (buses)   P_r: bus of every row
    cols: np.ndarray  # (buses)   P_c: row of every bus
    back: np.ndarray  # (buses)   row of every bus, the inverse of P_r
    again: np.ndarray  # (3)   first row, first entry of L and last entry of U that an iteration repeats
    all: np.ndarray  # (3)   rows, entries of L and of U


def factor(Y: sp.csc_matrix, iterated: Iterable[int] = ()) -> Factors:
    """Factors of an admittance matrix, and the part of them that each iteration at some buses repeats."""
    lu = spl.splu(Y.tocsc(), **OPTIONS)
    d = 1 / lu.U.diagonal()
    L, U = sp.tril(lu.L, -1).tocoo(), sp.triu(sp.diags(d) @ lu.U, 1).tocoo()
    buses = np.array(list(iterated), int)
    last, level = np.zeros(len(d), int), [0] * len(d)
    last[lu.perm_r[buses]] = last[lu.perm_c[buses]] = 1
    pairs = np.r_[np.c_[L.col, L.row], np.c_[U.row, U.col]]
    for before, after in pairs[np.argsort(pairs[:, 0], kind="stable")].tolist():
        last[after] |= last[before]
        level[after] = max(level[after], level[before] + 1)
    order = np.lexsort((np.array(level), last))
    place = np.argsort(order)
    down = np.lexsort((place[L.row], place[L.col]))
    up = np.lexsort((place[U.row], -place[U.col], -last[U.row]))
    again = len(d) - last.sum(), len(L.data) - last[L.col].sum(), last[U.row].sum()
    rows, columns = place[lu.perm_r], place[lu.perm_c]
    places = place[L.row[down]], place[L.col[down]], place[U.row[up]], place[U.col[up]], np.argsort(rows), columns, rows
    L_row, L_col, U_row, U_col, *of_buses = (np.ascontiguousarray(one, np.uint32) for one in places)
    sizes = (np.array(one, np.uintp) for one in (again, (len(d), len(L.data), len(U.data))))
    return Factors(L.data[down], L_row, L_col, U.data[up], U_row, U_col, d[order], *of_buses, *sizes)


@inline
def forward(F, current, work):
    """Forward substitution of the rows that are not iterated: work = inv(L) current, complete for these rows only."""
    for i in range(F.all[0]):
        work[i] = current[F.rows[i]]
    for k in range(F.again[1]):
        work[F.L_row[k]] -= F.L[k] * work[F.L_col[k]]


@inline
def middle(F, work):
    """Forward and backward substitution of the iterated rows: work = v."""
    for k in range(F.again[1], F.all[1]):
        work[F.L_row[k]] -= F.L[k] * work[F.L_col[k]]
    for i in range(F.again[0], F.all[0]):
        work[i] *= F.d[i]
    for k in range(F.again[2]):
        work[F.U_row[k]] -= F.U[k] * work[F.U_col[k]]


@inline
def backward(F, work, v):
    """Backward substitution for the other voltages."""
    for i in range(F.again[0]):
        work[i] *= F.d[i]
    for k in range(F.again[2], F.all[2]):
        work[F.U_row[k]] -= F.U[k] * work[F.U_col[k]]
    for i in range(F.all[0]):
        v[i] = work[F.cols[i]]


@noinline
def solve_apart(F, current, work, v):
    """Solve v = inv(Y) current; compiled once."""
    forward(F, current, work)
    middle(F, work)
    backward(F, work, v)
