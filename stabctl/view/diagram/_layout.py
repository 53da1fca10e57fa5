"""Layout of a diagram, calculated once and kept in the user's cache folder under a hash of the data it depends on.

The graph has a node for every bus, then one for every machine, next to its terminal bus. Its backbone is placed by
stress majorization, then the other nodes, each in the widest free angle. Coordinates given in `buses.csv` are kept; a
bus without is put between its neighbors.
"""

import hashlib
import math
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import shortest_path
from scipy.sparse.linalg import LinearOperator, cg, eigsh, spsolve
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from stabctl._util import files, jit, object_code
from stabctl.model import network
from stabctl.model.case import Case

LEAST = 0.42  # distance between nodes, of the median length of a branch
PASSES = 200
POWER = 0.1  # of |z| in the length of a branch: an electrically long line is drawn longer, but not in proportion
STUB = 0.7  # length of the stub of a machine, of that of a branch
STEPS = 200
TOLERANCE = 3e-4  # relative decrease of the stress in a step, below which it ends
PRECISE = 1e-2  # relative residual of each solution


def cached_layout(case: Case) -> np.ndarray:
    """The layout of a case (buses and machines, 2), calculated once."""
    path, shape = object_code.folder() / f"diagram-{_name(case)}", (len(case.buses) + len(case.machines), 2)
    content = files.kept(path)
    if content is not None:
        return np.frombuffer(content).reshape(shape)
    found = node_positions(case)
    files.keep(path, np.asarray(found, float).tobytes())
    return found


def _name(case: Case) -> str:
    """A hash of the network, the coordinates given, and the code."""
    parts = hashlib.sha256(jit.sources(sys.modules[node_positions.__module__]).encode())
    parts.update(repr([(b.bus, b.x, b.y) for b in case.buses]).encode())
    parts.update(repr([(k.from_bus, k.to_bus, k.r, k.x) for k in case.branches]).encode())
    parts.update(repr([(m.machine, m.bus) for m in case.machines]).encode())
    return parts.hexdigest()[:24]


def node_positions(case: Case) -> np.ndarray:
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


class Graph(NamedTuple):
    """Nodes are numbered from 0: buses in the order of their table, then machines."""

    nodes: int
    ends: np.ndarray  # (edges, 2) nodes
    length: np.ndarray  # (edges) desired length; the median of the branches is 1

    def lengths(self) -> sp.csr_matrix:
        """Desired lengths (nodes, nodes), symmetric; of parallel branches the shortest."""
        order = np.argsort(-self.length, kind="stable")
        shortest = {tuple(sorted(self.ends[k])): self.length[k] for k in order}
        a, b = np.array([*shortest], int).reshape(-1, 2).T
        values = np.fromiter(shortest.values(), float, len(shortest))
        pattern = np.r_[a, b], np.r_[b, a]
        return sp.csr_matrix((np.r_[values, values], pattern), shape=(self.nodes, self.nodes))

    def neighbors(self) -> list[list[int]]:
        """Nodes next to every node, in ascending order."""
        found: list[set[int]] = [set() for _ in range(self.nodes)]
        for a, b in self.ends.tolist():
            if a != b:
                found[a].add(b)
                found[b].add(a)
        return [sorted(nodes) for nodes in found]

    def distances(self, chosen: np.ndarray) -> np.ndarray:
        """Shortest distances along branches between chosen nodes; unconnected parts are put beside each other."""
        D = shortest_path(self.lengths()[chosen][:, chosen], directed=False)
        finite = np.isfinite(D)
        return np.where(finite, D, 1.3 * D[finite].max(initial=1.0))


def graph(case: Case) -> Graph:
    """The graph of a case."""
    net, buses = network.build(case), len(case.buses)
    length = np.maximum(np.abs(net.z), 1e-6) ** POWER
    length /= np.median(length) if len(length) else 1.0
    machines = np.stack([net.machine_bus, buses + np.arange(len(case.machines))], axis=1)
    ends = np.vstack([np.stack([net.frm, net.to], axis=1), machines]).astype(int)
    return Graph(buses + len(machines), ends, np.r_[np.clip(length, 0.4, 2.5), np.full(len(machines), STUB)])


def backbone(near: list[list[int]], rounds: int = 3) -> np.ndarray:
    """Nodes (ascending) left after leaves have been removed several times, as long as three are left."""
    left, degree = set(range(len(near))), [len(n) for n in near]
    for _ in range(rounds):
        leaves = {n for n in left if degree[n] <= 1}
        if not leaves or len(left) - len(leaves) < 3:
            break
        for n in leaves:
            for m in near[n]:
                degree[m] -= 1
        left -= leaves
    return np.array(sorted(left), int)


def stress_majorization(D: np.ndarray) -> np.ndarray:
    """Points (n, 2) whose distances are close to D (n, n), weighted by 1/D^2; the longest axis is horizontal.

    Each step solves V X' = B(X) X, with the Laplacian V of the weights and B_ij = -w_ij d_ij / |x_i - x_j|; the stress
    sum w_ij (|x_i - x_j| - d_ij)^2 never increases.
    Source: E. Gansner, Y. Koren, S. North, Graph Drawing by Stress Majorization, 2004, eqs. (2), (6) to (8).
    """
    n = len(D)
    if n < 3:
        return np.c_[np.arange(n, dtype=float), np.zeros(n)]
    D = np.maximum(D, 1e-9) * (1 - np.eye(n))
    w = np.divide(1.0, D**2, out=np.zeros_like(D), where=D > 0)
    wd, total = w * D, w.sum(axis=1)
    solve, X, before = _laplace(w, total), _scaling(D), np.inf
    for _ in range(STEPS):
        r = cdist(X, X)
        now = float(n * (n - 1) - 2 * np.vdot(wd, r) + 2 * (total @ (X**2).sum(axis=1) - np.vdot(X, w @ X)))
        if before - now < TOLERANCE * now:
            break
        before = now
        np.fill_diagonal(r, 1.0)
        B = np.divide(wd, np.maximum(r, 1e-9, out=r), out=r)
        X = solve(B.sum(axis=1)[:, None] * X - B @ X, X)
    return principal(X)


def _laplace(w: np.ndarray, total: np.ndarray) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Solver of V X' = right from a first guess, by conjugate gradients; V has its rows' sums `total` on its diagonal.

    V is singular by a shift of all points, which does not matter: right has no sum.
    """

    def solve(right: np.ndarray, X: np.ndarray) -> np.ndarray:
        V: Any = LinearOperator(w.shape, matvec=lambda x: total * x - w @ x)
        M: Any = LinearOperator(w.shape, matvec=lambda x: x / total)
        X = X - X.mean(axis=0)
        return np.stack([cg(V, right[:, k], X[:, k], rtol=PRECISE, M=M)[0] for k in range(2)], axis=1)

    return solve


def _scaling(D: np.ndarray) -> np.ndarray:
    """Classical scaling: the two largest eigenvectors of the centered squares, from which the steps begin."""
    S = D**2
    S = -0.5 * (S - S.mean(axis=0) - S.mean(axis=1)[:, None] + S.mean())
    n = len(D)
    start = np.cos(np.arange(n))  # the same on every machine
    value, vector = eigsh(S, k=2, v0=start) if n > 10 else tuple(part[..., -2:] for part in np.linalg.eigh(S))
    X = vector[:, ::-1] * np.sqrt(np.maximum(value[::-1], 1e-6))
    return X + 1e-3 * np.c_[np.cos(7.0 * np.arange(n)), np.sin(7.0 * np.arange(n))]  # no two points alike


def principal(X: np.ndarray) -> np.ndarray:
    """The points about their mean, turned so that the longest axis is horizontal; the first is left and above."""
    X = X - X.mean(axis=0)
    X = X @ np.linalg.eigh(X.T @ X)[1][:, ::-1]
    return X * np.where(X[0] * [1, -1] > 0, -1.0, 1.0)


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
