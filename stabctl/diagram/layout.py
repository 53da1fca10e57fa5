"""Layout of a diagram: the backbone by stress majorization, stubs spread over the widest free angles.

Coordinates given in `buses.csv` are kept; a bus without is put between its neighbors.
"""

import math

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from stabctl.model.case import Case

from .graph import STUB, Graph, backbone, graph
from .stress_majorization import stress_majorization

LEAST = 0.42  # distance between nodes, of the median length of a branch
PASSES = 200


def layout(case: Case) -> np.ndarray:
    """Positions (buses and machines, 2) in lengths of the median branch, the same for the same case everywhere."""
    g = graph(case)
    near = g.neighbors()
    given = np.array([(b.x, b.y) for b in case.buses], float)
    if given.any():
        X, kept = _between(given, g), np.arange(len(given))[given.any(axis=1)]
        length = np.linalg.norm(X[g.ends[: len(case.branches), 0]] - X[g.ends[: len(case.branches), 1]], axis=1)
        X = (X - X.mean(axis=0)) / (np.median(length[length > 0]) if (length > 0).any() else 1.0)
        X = _with_stubs(near, {int(n): X[n] for n in range(len(given))})
        return _apart(X, g, kept, held=0.0)
    core = backbone(near)
    X = _with_stubs(near, dict(zip(core.tolist(), stress_majorization(g.distances(core)), strict=True)))
    return _apart(X, g, core, held=0.3)


def _between(given: np.ndarray, g: Graph) -> np.ndarray:
    """Coordinates of all buses: those without are the means of their neighbors (a Laplace equation)."""
    n, known = len(given), given.any(axis=1)
    A = g.lengths()[:n, :n]
    A.data[:] = 1.0
    middle = given[known].mean(axis=0)
    L = sp.diags(np.asarray(A.sum(axis=1)).ravel() + 1e-6) - A
    X, free = given.copy(), np.flatnonzero(~known)
    if len(free):
        right = A[free][:, np.flatnonzero(known)] @ given[known] + 1e-6 * middle
        X[free] = spsolve(L[free][:, free].tocsc(), right).reshape(-1, 2)
    return X


def _with_stubs(near: list[list[int]], X: dict[int, np.ndarray]) -> np.ndarray:
    """The other nodes around those placed, each in the widest free angle."""
    todo = list(X)
    for n in todo:
        stubs = [m for m in near[n] if m not in X]
        for m, angle in zip(stubs, _slots(n, near, X, len(stubs)), strict=True):
            X[m] = X[n] + STUB * np.array([math.cos(angle), math.sin(angle)])
            todo.append(m)
    for n in range(len(near)):
        X.setdefault(n, np.zeros(2))
    return np.array([X[n] for n in range(len(near))])


def _slots(n: int, near: list[list[int]], X: dict[int, np.ndarray], count: int) -> list[float]:
    """Angles of a number of stubs at a node, each in the middle of what is then the widest free angle."""
    taken = sorted(math.atan2(*(X[m] - X[n])[::-1]) for m in near[n] if m in X)
    gaps = [(b - a, a) for a, b in zip(taken, [*taken[1:], taken[0] + 2 * math.pi], strict=True)] if taken else []
    gaps = gaps or [(2 * math.pi, -math.pi / 2)]
    found = []
    for _ in range(count):
        width, start = gaps.pop(max(range(len(gaps)), key=lambda i: round(gaps[i][0], 9)))
        found.append(start + width / 2)
        gaps += [(width / 2, start), (width / 2, start + width / 2)]
    return found


def _apart(X: np.ndarray, g: Graph, firm: np.ndarray, held: float) -> np.ndarray:
    """The nodes pushed apart until none are closer than `LEAST`; firm ones move by the share `held` only."""
    share, turned = np.ones(len(X)), np.c_[np.cos(3.0 * np.arange(len(X))), np.sin(3.0 * np.arange(len(X)))]
    share[firm] = held
    for _ in range(PASSES):
        a, b = cKDTree(X).query_pairs(LEAST, output_type="ndarray").T
        if not len(a):
            break
        order = np.lexsort((b, a))
        a, b = a[order], b[order]
        gap = X[a] - X[b]
        r = np.linalg.norm(gap, axis=1)[:, None]
        gap = np.where(r > 1e-9, gap / np.maximum(r, 1e-9), turned[a])
        push, step = 0.5 * np.maximum(LEAST - r, 0) * gap, np.zeros_like(X)
        np.add.at(step, a, push)
        np.add.at(step, b, -push)
        step *= share[:, None]
        X = X + step
        if np.abs(step).max() < 1e-3:
            break
    return X
