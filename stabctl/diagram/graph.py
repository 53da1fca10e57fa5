"""The graph of a diagram: a node for every bus, then one for every machine, next to its terminal bus."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import shortest_path

from stabctl.model import network
from stabctl.model.case import Case

POWER = 0.1  # of |z| in the length of a branch: an electrically long line is drawn longer, but not in proportion
STUB = 0.7  # length of the stub of a machine, of that of a branch


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
    for leaves in _leaves(near, left, degree, rounds):
        left -= leaves
    return np.array(sorted(left), int)


def _leaves(near: list[list[int]], left: set[int], degree: list[int], rounds: int) -> Iterator[set[int]]:
    for _ in range(rounds):
        leaves = {n for n in left if degree[n] <= 1}
        if not leaves or len(left) - len(leaves) < 3:
            return
        for n in leaves:
            for m in near[n]:
                degree[m] -= 1
        yield leaves
