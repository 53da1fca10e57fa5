"""Factors of Y - D on the iterated rows of a network, where D are the slopes of voltage-dependent currents.

The current i(v) of a bus has a slope in the real and in the imaginary part of v:

    di = a dv + b conj(dv)

In the elimination, such pairs (a, b) take the place of complex numbers. A pair after another, and the inverse of one:

    (a1, b1) (a2, b2) = (a1 a2 + b1 conj(b2), a1 b2 + b1 conj(a2))
    inv(a, b) = (conj(a), -b)/(|a|^2 - |b|^2)

Only the buses that draw currents have slopes, and they are among the rows that are eliminated last, the iterated ones.
The rows before these keep their complex factors of Y; what is eliminated here is S - D, where S = L D U of the iterated
rows. The order is that of Y. Pivots are not chosen, so whoever uses these factors must check the residual with those of
Y. All operations are in flat lists, which are made once for a network.
"""

from collections.abc import Iterator
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
    slopes = list(zip(F.back[draw_bus] - first, F.cols[draw_bus] - first, strict=True))
    values = {(int(i), int(j)): x for i, j, x in zip(S.row, S.col, S.data, strict=True)}
    below: list[set[int]] = [set() for _ in range(n)]
    right: list[set[int]] = [set() for _ in range(n)]
    for i, j in (*values, *slopes):
        (below[j] if i > j else right[i]).add(max(int(i), int(j)))
    for k in range(n):
        right[k].discard(k)
        for i, j in _products(below[k], right[k]):
            if i != j:
                (below[j] if i > j else right[i]).add(max(i, j))
    entries = [(k, k) for k in range(n)]
    entries += [(i, k) for k in range(n) for i in sorted(below[k])]
    entries += [(k, j) for k in range(n) for j in sorted(right[k])]
    place = {entry: e for e, entry in enumerate(entries)}
    operations = [
        (place[i, j], place[i, k], place[k, j])
        for k in range(n)
        for i, j in _products(sorted(below[k]), sorted(right[k]))
    ]
    count = [np.cumsum([0, *map(len, of)]) for of in (below, right)]
    lists = [*np.array(entries, np.uint32).reshape(-1, 2).T, n + count[0], n + count[0][-1] + count[1]]
    lists += [np.cumsum([0, *(len(b) * len(r) for b, r in zip(below, right, strict=True))])]
    lists += [*np.array(operations, np.uint32).reshape(-1, 3).T, [place[int(i), int(j)] for i, j in slopes]]
    S_of = np.array([values.get(entry, 0.0) for entry in entries], complex)
    return Pattern(S_of, *(np.ascontiguousarray(one, np.uint32) for one in lists))


def _products(
    below: "Iterator[int] | set[int] | list[int]", right: "set[int] | list[int]"
) -> Iterator[tuple[int, int]]:
    return ((i, j) for i in below for j in right)


@noinline
def eliminate(of, scale, slopes, a, b):
    """Factors L D U of scale S - D, in (a, b); D is kept inverted. Returns whether every pivot has an inverse."""
    n = len(of.L) - 1
    for e in range(len(of.S)):
        a[e], b[e] = scale * of.S[e], 0
    for j in range(len(of.at)):
        a[of.at[j]] -= slopes[j, 0]
        b[of.at[j]] -= slopes[j, 1]
    for k in range(n):
        size = square(a[k]) - square(b[k])
        if not size * size > 0:
            return False
        a[k], b[k] = a[k].conjugate() / size, -b[k] / size
        for e in range(of.L[k], of.L[k + 1]):
            a[e], b[e] = product(a[e], b[e], a[k], b[k])
        for o in range(of.operations[k], of.operations[k + 1]):
            t, l, r = of.target[o], of.left[o], of.right[o]
            more = product(a[l], b[l], a[r], b[r])
            a[t] -= more[0]
            b[t] -= more[1]
    for e in range(of.U[0], of.U[n]):
        k = of.row[e]
        a[e], b[e] = product(a[k], b[k], a[e], b[e])
    return True


@inline
def square(z):
    """The square of a magnitude."""
    return z.real * z.real + z.imag * z.imag


@inline
def product(a, b, c, d):
    """The pair (a, b) after the pair (c, d)."""
    return a * c + b * d.conjugate(), a * d + b * c.conjugate()


@inline
def substitute(of, a, b, x):
    """Solve (scale S - D) x = x in place, with the factors that `eliminate` has made."""
    n = len(of.L) - 1
    for e in range(of.L[0], of.L[n]):
        z = x[of.col[e]]
        x[of.row[e]] -= a[e] * z + b[e] * z.conjugate()
    for k in range(n):
        x[k] = a[k] * x[k] + b[k] * x[k].conjugate()
    for back in range(of.U[n] - of.U[0]):
        e = of.U[n] - 1 - back
        z = x[of.col[e]]
        x[of.row[e]] -= a[e] * z + b[e] * z.conjugate()
