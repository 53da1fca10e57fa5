"""Factors of the Jacobian of Newton's method for the bus voltages: Y - D on the iterated rows of a network.

Y are the admittances, and D the slopes of the voltage-dependent currents (pu). The current of a bus follows the real
and the imaginary part of its voltage, each with a slope of its own:

    di = p Re dv + q Im dv

So p and q, the columns of a real matrix of order two, take the place of a complex number in the elimination. That of an
admittance Y has p = Y and q = jY.

Only the buses that draw currents have slopes, and they are among the rows that are eliminated last, the iterated ones.
The rows before these keep their complex factors of Y; what is eliminated here is S - D, where S = L D U of the iterated
rows. The order is that of Y. Pivots are not chosen, so whoever uses these factors must check the residual with those of
Y. All operations are in flat lists, which are made once for a network.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from stabctl._util.jit import inline, noinline
from stabctl._util.words import record

from ._substitution import Factors


@record
class Pattern(NamedTuple):
    """Entries and operations of the elimination of n rows: the diagonal, L by columns, U by rows."""

    S: np.ndarray  # (entries), complex, pu   their values in Y, after the elimination of the other rows
    row: np.ndarray  # (entries)
    col: np.ndarray  # (entries)
    L: np.ndarray  # (n + 1)   first entry of every column of L, and the one after the last
    U: np.ndarray  # (n + 1)   the same of the rows of U
    operations: np.ndarray  # (n + 1)   first operation of every pivot
    target: np.ndarray  # (operations)   the entry from which the product of two others is subtracted
    left: np.ndarray  # (operations)   the first, of L
    right: np.ndarray  # (operations)   the second, of U
    at: np.ndarray  # (drawing buses)   entries of their slopes


def pattern(F: Factors, draw_bus: np.ndarray) -> Pattern:
    """The elimination of the iterated rows of a network with these factors."""
    first, n = int(F.again[0]), int(F.all[0] - F.again[0])
    lower = F.L[F.again[1] :], (F.L_row[F.again[1] :] - first, F.L_col[F.again[1] :] - first)
    upper = F.U[: F.again[2]], (F.U_row[: F.again[2]] - first, F.U_col[: F.again[2]] - first)
    L, U = (sp.csc_matrix(entries, shape=(n, n)) + sp.identity(n) for entries in (lower, upper))
    S = (L @ sp.diags(1 / F.d[first:]) @ U).tocoo()
    values = {(int(i), int(j)): x for i, j, x in zip(S.row, S.col, S.data, strict=True)}
    slopes = [(int(i), int(j)) for i, j in zip(F.back[draw_bus] - first, F.cols[draw_bus] - first, strict=True)]
    below: list[set[int]] = [set() for _ in range(n)]  # rows of L in each column
    right: list[set[int]] = [set() for _ in range(n)]  # columns of U in each row
    made: list[tuple[tuple[int, int], ...]] = []
    for i, j in (*values, *slopes):
        _add(i, j, below, right)
    for k in range(n):
        for i, j in product(sorted(below[k]), sorted(right[k])):
            made.append(((i, j), (i, k), (k, j)))
            _add(i, j, below, right)
    entries = [(k, k) for k in range(n)]
    entries += [(i, k) for k in range(n) for i in sorted(below[k])]
    entries += [(k, j) for k in range(n) for j in sorted(right[k])]
    place = {entry: e for e, entry in enumerate(entries)}
    of_L = np.cumsum([n, *map(len, below)])
    of_U = np.cumsum([of_L[-1], *map(len, right)])
    lists = (
        *np.array(entries).reshape(-1, 2).T,
        of_L,
        of_U,
        np.cumsum([0, *(np.diff(of_L) * np.diff(of_U))]),
        *np.array([[place[entry] for entry in three] for three in made]).reshape(-1, 3).T,
        [place[entry] for entry in slopes],
    )
    return Pattern(
        np.array([values.get(entry, 0.0) for entry in entries], complex),
        *(np.ascontiguousarray(one, np.uint32) for one in lists),
    )


def _add(i: int, j: int, below: list[set[int]], right: list[set[int]]) -> None:
    """Add an entry beside the diagonal."""
    if i > j:
        below[j].add(i)
    elif i < j:
        right[i].add(j)


@noinline
def eliminate(of, scale, slopes, M):
    """Factors L D U of scale S - D in M (entries, 4: p, q); D is kept inverted. Whether every pivot has an inverse."""
    n = len(of.L) - 1
    for e in range(len(of.S)):
        Y = scale * of.S[e]
        M[e, 0], M[e, 1], M[e, 2], M[e, 3] = Y.real, Y.imag, -Y.imag, Y.real
    for j in range(len(of.at)):
        e, p, q = of.at[j], slopes[j, 0], slopes[j, 1]
        M[e, 0] -= p.real
        M[e, 1] -= p.imag
        M[e, 2] -= q.real
        M[e, 3] -= q.imag
    for k in range(n):
        det = M[k, 0] * M[k, 3] - M[k, 1] * M[k, 2]
        if not det * det > 0:
            return False
        M[k, 0], M[k, 1], M[k, 2], M[k, 3] = M[k, 3] / det, -M[k, 1] / det, -M[k, 2] / det, M[k, 0] / det
        for e in range(of.L[k], of.L[k + 1]):
            store(M, e, after(M, e, k))
        for o in range(of.operations[k], of.operations[k + 1]):
            t, more = of.target[o], after(M, of.left[o], of.right[o])
            for i in range(4):
                M[t, i] -= more[i]
    for e in range(of.U[0], of.U[n]):
        store(M, e, after(M, of.row[e], e))
    return True


@inline
def image(M, e, re, im):
    """What entry e makes of a number: p re + q im, real and imaginary part."""
    return M[e, 0] * re + M[e, 2] * im, M[e, 1] * re + M[e, 3] * im


@inline
def after(M, e, g):
    """Entry e after entry g."""
    p, q = image(M, e, M[g, 0], M[g, 1]), image(M, e, M[g, 2], M[g, 3])
    return p[0], p[1], q[0], q[1]


@inline
def store(M, e, new):
    """Set entry e."""
    M[e, 0], M[e, 1], M[e, 2], M[e, 3] = new


@inline
def substitute(of, M, x):
    """Solve (scale S - D) x = x in place (rows, 2: real, imaginary), with the factors that `eliminate` has made."""
    n = len(of.L) - 1
    for e in range(of.L[0], of.L[n]):
        re, im = image(M, e, x[of.col[e], 0], x[of.col[e], 1])
        x[of.row[e], 0] -= re
        x[of.row[e], 1] -= im
    for k in range(n):
        x[k, 0], x[k, 1] = image(M, k, x[k, 0], x[k, 1])
    for e in range(of.U[n] - 1, of.U[0] - 1, -1):
        re, im = image(M, e, x[of.col[e], 0], x[of.col[e], 1])
        x[of.row[e], 0] -= re
        x[of.row[e], 1] -= im
