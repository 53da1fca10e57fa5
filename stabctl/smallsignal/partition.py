"""Areas of a network: groups of buses that are connected only through a few others, the separators."""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order, connected_components, maximum_flow, shortest_path


class Parts(NamedTuple):
    """Buses of every area, and those that separate the areas."""

    areas: tuple[np.ndarray, ...]
    separator: np.ndarray


def partition(links: sp.csr_matrix, weight: np.ndarray, most: int) -> Parts:
    """Divide a graph into areas of at most `most` (sum of `weight`) by removing the nodes between them.

    A group whose ends cannot be told apart stays whole, whatever its weight.
    """
    graph = sp.csr_matrix(abs(links) + abs(links.T))
    groups, areas, cut = _connected(graph, np.arange(graph.shape[0])), [], []
    while groups:
        group = groups.pop()
        between = _cut(graph[group][:, group], weight[group]) if weight[group].sum() > most else None
        if between is None:
            areas.append(group)
        else:
            cut.append(group[between])
            groups += _connected(graph, np.delete(group, between))
    return Parts(_gathered(areas, weight, most), np.sort(np.concatenate([*cut, np.zeros(0, int)])))


def _connected(graph: sp.csr_matrix, nodes: np.ndarray) -> list[np.ndarray]:
    count, label = connected_components(graph[nodes][:, nodes], directed=False)
    return [nodes[label == k] for k in range(count)]


def _cut(graph: sp.csr_matrix, weight: np.ndarray) -> np.ndarray | None:
    """The fewest nodes that separate one end of the graph, a quarter of the weight, from the other end."""
    far = breadth_first_order(graph, 0, directed=False)[0][-1]
    order = np.argsort(shortest_path(graph, directed=False, unweighted=True, indices=far), kind="stable")
    before = np.cumsum(weight[order]) - weight[order]
    near, beyond = order[before < weight.sum() / 4], order[before >= 3 / 4 * weight.sum()]
    if not len(near) or not len(beyond):
        return None
    n = graph.shape[0]
    enter, leave, source, sink = np.arange(n), n + np.arange(n), 2 * n, 2 * n + 1
    a, b = graph.nonzero()
    tails = np.r_[enter, leave[a], np.full(len(near), source), leave[beyond]]
    heads = np.r_[leave, enter[b], enter[near], np.full(len(beyond), sink)]
    most = np.r_[np.ones(n, np.int32), np.full(len(tails) - n, n, np.int32)]
    capacity = sp.csr_array((most, (tails, heads)), (2 * n + 2, 2 * n + 2), dtype=np.int32)
    left = sp.csr_matrix(capacity - maximum_flow(capacity, source, sink).flow)
    left.data[left.data < 0] = 0
    left.eliminate_zeros()
    reached = np.zeros(2 * n + 2, bool)
    reached[breadth_first_order(left, source)[0]] = True
    return np.flatnonzero(reached[:n] & ~reached[n : 2 * n])


def _gathered(areas: list[np.ndarray], weight: np.ndarray, most: int) -> tuple[np.ndarray, ...]:
    """Small areas put together, as long as they stay within `most`."""
    bins: list[list[np.ndarray]] = []
    sums: list[float] = []
    for area in sorted(areas, key=lambda a: -weight[a].sum()):
        own = weight[area].sum()
        k = next((k for k, s in enumerate(sums) if s + own <= most), None)
        if k is None:
            bins.append([area])
            sums.append(own)
        else:
            bins[k].append(area)
            sums[k] += own
    return tuple(np.sort(np.concatenate(b)) for b in bins)
