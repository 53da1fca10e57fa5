"""A sparse matrix that falls into groups of rows and columns which do not touch: one per unit with its controls."""

import contextlib
from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components


def solve(J: sp.csr_matrix, f: np.ndarray) -> np.ndarray:
    """inv(J) f, group by group; rows and columns without an entry (bypassed blocks) are left out and give 0."""
    out = np.zeros(J.shape[1])
    moving = np.flatnonzero(np.diff(J.indptr) > 0)
    read = np.flatnonzero(np.diff(J.tocsc().indptr) > 0)
    A = J[moving][:, read]
    pattern = sp.bmat([[None, A], [A.T, None]], format="csr")
    count, group = connected_components(pattern, directed=False)
    of_row, of_column = group[: len(moving)], group[len(moving) :]
    entries = A.tocoo()
    for r, c in _groups(count, of_row, of_column):
        which, local_row, local_column = np.full(count, -1), np.empty(len(moving), int), np.empty(len(read), int)
        which[of_row[r[:, 0]]] = np.arange(len(r))
        local_row[r], local_column[c] = np.arange(r.shape[1]), np.arange(c.shape[1])
        mine = which[of_row[entries.row]]
        keep = mine >= 0
        blocks = np.zeros((len(r), r.shape[1], c.shape[1]))
        blocks[mine[keep], local_row[entries.row[keep]], local_column[entries.col[keep]]] = entries.data[keep]
        out[read[c]] = _solved(blocks, f[moving[r]])
    return out


def _groups(count: int, of_row: np.ndarray, of_column: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Rows and columns of the groups, those of equal shape together: (groups, rows) and (groups, columns)."""
    heights, widths = np.bincount(of_row, minlength=count), np.bincount(of_column, minlength=count)
    rows, columns = np.argsort(of_row, kind="stable"), np.argsort(of_column, kind="stable")
    first_row, first_column = np.cumsum(heights) - heights, np.cumsum(widths) - widths
    for height, width in sorted(set(zip(heights.tolist(), widths.tolist(), strict=True))):
        groups = np.flatnonzero((heights == height) & (widths == width))
        if height:
            yield (
                rows[first_row[groups][:, None] + np.arange(height)],
                columns[first_column[groups][:, None] + np.arange(width)],
            )


def _solved(blocks: np.ndarray, f: np.ndarray) -> np.ndarray:
    """inv(block) f of every block; the least-squares solution where a block is singular or not square."""
    if blocks.shape[1] == blocks.shape[2]:
        with contextlib.suppress(np.linalg.LinAlgError):
            return np.linalg.solve(blocks, f[..., None])[..., 0]
    return np.stack([np.linalg.lstsq(block, one, rcond=None)[0] for block, one in zip(blocks, f, strict=True)])


def fastest(A: sp.csr_matrix) -> float:
    """Largest magnitude of an eigenvalue of a square matrix, group by group."""
    count, group = connected_components(A, directed=False)
    order = np.argsort(group, kind="stable")
    bounds = np.searchsorted(group[order], np.arange(count + 1))
    largest = 0.0
    sizes = np.diff(bounds)
    for size in np.unique(sizes):
        members = np.array([order[bounds[g] : bounds[g + 1]] for g in np.flatnonzero(sizes == size)])
        blocks = np.zeros((len(members), size, size))
        where = np.full(len(group), -1)
        where[members] = np.arange(size)
        which = np.full(len(group), -1)
        which[members] = np.arange(len(members))[:, None]
        coo = A.tocoo()
        mine = which[coo.row] >= 0
        blocks[which[coo.row[mine]], where[coo.row[mine]], where[coo.col[mine]]] = coo.data[mine]
        largest = max(largest, float(np.abs(np.linalg.eigvals(blocks)).max()))
    return largest
