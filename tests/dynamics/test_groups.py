"""Systems that fall into groups are solved as if they were one."""

import numpy as np
import pytest

from stabctl.dynamics.newton import Groups


def shuffled(blocks, seed=0):
    """Rows, columns and values of blocks on a diagonal, rows and columns in random order, every entry in two halves."""
    rng = np.random.default_rng(seed)
    height, width = sum(b.shape[0] for b in blocks), sum(b.shape[1] for b in blocks)
    dense, r, c = np.zeros((height, width)), 0, 0
    for b in blocks:
        dense[r : r + b.shape[0], c : c + b.shape[1]] = b
        r, c = r + b.shape[0], c + b.shape[1]
    dense = dense[rng.permutation(height)][:, rng.permutation(width)]
    rows, columns = np.nonzero(dense)
    halves = np.tile(dense[rows, columns] / 2, 2)
    return dense, Groups(np.tile(rows, 2), np.tile(columns, 2), dense.shape), halves


def test_groups_of_several_sizes_are_solved_as_one_system():
    rng = np.random.default_rng(1)
    dense, groups, values = shuffled([rng.normal(size=(n, n)) for n in (1, 3, 3, 5, 2, 3)])
    f = rng.normal(size=len(dense))
    assert {alike.rows.shape for alike in groups.alike} == {(1, 1), (1, 2), (3, 3), (1, 5)}
    assert groups.solve(values, f) == pytest.approx(np.linalg.solve(dense, f), rel=1e-12)


def test_a_row_and_a_column_without_entries_change_nothing():
    """A bypassed block: its state stays where it is."""
    block = np.array([[2.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 3.0]])
    rows, columns = (a.ravel() for a in np.indices(block.shape))
    x = Groups(rows, columns, block.shape).solve(block.ravel(), np.array([1.0, 0.0, 2.0]))
    assert x == pytest.approx([0.2, 0.0, 0.6])


@pytest.mark.parametrize("block", [np.ones((2, 2)), np.vander([1.0, 2, 3, 4], 3), np.vander([2.0, 3], 3)])
def test_a_group_without_a_unique_solution_gets_the_least_squares_one(block):
    dense, groups, values = shuffled([block, np.eye(2)])
    f = np.arange(1.0, 1 + len(dense))
    assert groups.solve(values, f) == pytest.approx(np.linalg.lstsq(dense, f, rcond=None)[0], rel=1e-9)
