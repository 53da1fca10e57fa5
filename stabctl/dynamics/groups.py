"""The Jacobian of the devices as dense blocks, one per unit with its controls.

Devices of different units are coupled only through the network. Rows and columns are grouped once, by the pattern
alone; groups of equal shape are solved together.
"""

import contextlib
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components


class Alike(NamedTuple):
    """Groups of equal shape."""

    rows: np.ndarray  # (groups, height)
    columns: np.ndarray  # (groups, width)
    entries: np.ndarray  # entries of the matrix that lie in these groups
    places: np.ndarray  # where each of them goes in the (groups, height, width) blocks, flattened


class Groups:
    """A sparse pattern that separates into independent groups of rows and columns.

    Parameters
    ----------
    rows, columns
        Row and column of every entry; the values of repeated entries are added.
    shape
        Numbers of rows and columns.
    """

    def __init__(self, rows: np.ndarray, columns: np.ndarray, shape: tuple[int, int]) -> None:
        self.width = shape[1]
        pattern = sp.coo_matrix((np.ones(len(rows)), (rows, columns + shape[0])), shape=(sum(shape), sum(shape)))
        count, group = connected_components(pattern, directed=False)
        of_row, of_column = group[: shape[0]], group[shape[0] :]
        heights, widths = np.bincount(of_row, minlength=count), np.bincount(of_column, minlength=count)
        by_row, by_column = np.argsort(of_row, kind="stable"), np.argsort(of_column, kind="stable")
        first_row, first_column = np.cumsum(heights) - heights, np.cumsum(widths) - widths
        local_row, local_column = np.empty(shape[0], np.int64), np.empty(shape[1], np.int64)
        local_row[by_row] = np.arange(shape[0]) - np.repeat(first_row, heights)
        local_column[by_column] = np.arange(shape[1]) - np.repeat(first_column, widths)
        of_entry, number = of_row[rows], np.empty(count, np.int64)
        self.alike: list[Alike] = []
        for height, width in sorted(set(zip(heights.tolist(), widths.tolist(), strict=True))):
            these = (heights == height) & (widths == width)
            members = np.flatnonzero(these)
            number[members] = np.arange(len(members))
            entries = np.flatnonzero(these[of_entry])
            r, c = rows[entries], columns[entries]
            self.alike.append(
                Alike(
                    by_row[first_row[members][:, None] + np.arange(height)],
                    by_column[first_column[members][:, None] + np.arange(width)],
                    entries,
                    (number[of_entry[entries]] * height + local_row[r]) * width + local_column[c],
                )
            )

    def blocks(self, data: np.ndarray, alike: Alike) -> np.ndarray:
        """The blocks (groups, height, width) of the entries `data`."""
        shape = (*alike.rows.shape, alike.columns.shape[1])
        return np.bincount(alike.places, data[alike.entries], int(np.prod(shape))).reshape(shape)

    def solve(self, data: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Solve J x = f for the entries `data` of J; x is 0 for empty rows and columns (bypassed blocks)."""
        x = np.zeros(self.width)
        for alike in self.alike:
            if alike.rows.size and alike.columns.size:
                x[alike.columns] = _solved(self.blocks(data, alike), f[alike.rows])
        return x


def _solved(blocks: np.ndarray, f: np.ndarray) -> np.ndarray:
    """inv(block) f of every block; the least-squares solution if a block is singular or not square.

    An unknown without an entry is exactly 0: rounding would move states that rest at a limit.
    """
    used = (blocks != 0).any(axis=1)
    if blocks.shape[1] == blocks.shape[2]:
        with contextlib.suppress(np.linalg.LinAlgError):
            return np.linalg.solve(_filled(blocks), f[..., None])[..., 0]
    found = np.stack([np.linalg.lstsq(block, one, rcond=None)[0] for block, one in zip(blocks, f, strict=True)])
    return np.where(used, found, 0.0)


def _filled(blocks: np.ndarray) -> np.ndarray:
    """The same with a 1 where an empty row meets an empty column."""
    present = blocks != 0
    row, column = ~present.any(axis=2), ~present.any(axis=1)
    if (row.sum(axis=1) == column.sum(axis=1)).all():
        (group, r), (_, c) = np.nonzero(row), np.nonzero(column)
        blocks[group, r, c] = 1.0
    return blocks
