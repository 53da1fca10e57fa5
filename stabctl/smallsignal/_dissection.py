"""Nested dissection of a linearized system: areas of the network, and the separators between them.

An area is a group of buses that is connected to the others only through a few, the separators. These are the fewest
buses between the two ends of a group, found as a maximum flow through buses of capacity 1; the parts are divided again
until they are small. Voltages w of an area at which no device acts are eliminated from its admittances (Schur
complement), M - Y_mw Y_ww^-1 Y_wm. Sources: A. George, Nested dissection of a regular finite element mesh, SIAM J.
Numerical Analysis 10, 1973; L. Ford, D. Fulkerson, Flows in Networks, 1962.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order, connected_components, maximum_flow, shortest_path
from scipy.sparse.linalg import splu

from ._argument_principle import Area, Member, Network, Units
from .descriptor import Descriptor

PORTS = (40, 80)  # voltages of devices in an area, at most, if the network can be divided


def network(d: Descriptor, *most: int) -> Network:
    """Divide a linearized system into fronts of about `most` voltages; voltages without a device are eliminated.

    Of several sizes, by default `PORTS`, that with the least work is chosen: small areas, but not many separators.
    """
    turn = _turn(d)
    gv = (turn.T @ d.gv @ turn).tocsr()
    groups = _units(d.fx, (d.fv @ turn).tocsr(), (turn.T @ d.gx).tocsc())
    device = np.zeros(gv.shape[0], bool)
    for group in groups:
        device[group.at] = True
    parts = _divided(gv, groups, device, most or PORTS)
    kept = _voltages(parts.separator)
    Y, areas = gv[kept][:, kept].toarray(), []
    for buses in parts.areas:
        own = _voltages(buses)
        live, still = own[device[own]], own[~device[own]]
        edge = np.unique(np.r_[gv[own][:, kept].indices, gv[kept][:, own].tocsc().indices]).astype(int)
        ports, n = np.r_[live, kept[edge]], len(live)
        M = gv[ports][:, ports].toarray()
        M[n:, n:] = 0
        if len(still):
            factors = splu(gv[still][:, still].tocsc())
            M -= gv[ports][:, still] @ factors.solve(gv[still][:, ports].toarray())
        Y[np.ix_(edge, edge)] += M[n:, n:]
        if n:
            areas.append(Area(M[:n, :n], M[:n, n:], M[n:, :n], edge, _members(groups, live)))
    return Network(groups, areas, Y, _members(groups, kept))


def _turn(d: Descriptor) -> sp.csr_matrix:
    """Rotation that splits the voltage of every bus into magnitude and angle, which may then be scaled separately."""
    lay = d.point.layout
    re, im = d.point.s[lay.nx : lay.first_setpoint].reshape(-1, 2).T
    blocks = np.array([[re, -im], [im, re]]).transpose(2, 0, 1) / np.hypot(re, im)[:, None, None]
    return sp.block_diag(list(blocks), format="csr")


def _units(fx: sp.csc_matrix, fv: sp.csr_matrix, gx: sp.csc_matrix) -> list[Units]:
    """The units of x' = fx x + fv v with currents gx x, balanced, in groups of equal size."""
    _, label = connected_components(fx, directed=False)
    order = np.argsort(label, kind="stable")
    groups: dict[tuple[int, int], list[tuple[np.ndarray, ...]]] = {}
    for x in np.split(order, np.cumsum(np.bincount(label))[:-1]):
        v = np.union1d(gx[:, x].indices, fv[x].indices)
        F, B, C = (M.toarray() for M in (fx[x][:, x], fv[x][:, v], gx[v][:, x]))
        scale = np.diag(sl.matrix_balance(F, permute=False)[1])
        groups.setdefault(B.shape, []).append((F * scale / scale[:, None], B / scale[:, None], C * scale, v))
    return [Units(*(np.array(part) for part in zip(*group, strict=True))) for group in groups.values()]


class Parts(NamedTuple):
    """Buses of every area, and those that separate the areas."""

    areas: tuple[np.ndarray, ...]
    separator: np.ndarray


def _divided(gv: sp.csr_matrix, groups: list[Units], device: np.ndarray, most: Sequence[int]) -> Parts:
    """Areas and separators of buses; the buses of a unit stay together."""
    buses = gv.shape[0] // 2
    pairs = [np.array([(a, b) for at in g.at // 2 for a, b in pairwise(at)]).reshape(-1, 2) for g in groups]
    a, b = np.concatenate([*pairs, np.zeros((0, 2))]).astype(int).T
    joined = sp.coo_matrix((np.ones(len(a)), (a, b)), (buses, buses))
    count, label = connected_components(joined, directed=False)
    entries = gv.tocoo()
    at = label[entries.row // 2], label[entries.col // 2]
    links = sp.coo_matrix((np.ones(len(entries.data)), at), (count, count)).tocsr()
    weight = np.bincount(label, device.reshape(-1, 2).sum(axis=1), count)
    size = 2 * np.bincount(label, minlength=count)

    def work(parts: Parts) -> float:
        fronts = [*(weight[nodes] for nodes in parts.areas), size[parts.separator]]
        return sum(float(front.sum()) ** 3 for front in fronts)

    parts = min((partition(links, weight, n) for n in most), key=work)
    areas = tuple(np.flatnonzero(np.isin(label, nodes)) for nodes in parts.areas)
    return Parts(areas, np.flatnonzero(np.isin(label, parts.separator)))


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


def _voltages(buses: np.ndarray) -> np.ndarray:
    """Places of the two parts of the voltage of some buses, in order."""
    return (2 * buses[:, None] + [0, 1]).ravel()


def _members(groups: list[Units], voltages: np.ndarray) -> list[Member]:
    found = []
    for k, group in enumerate(groups):
        rows = np.flatnonzero(np.isin(group.at, voltages).all(axis=1)) if group.at.shape[1] else np.zeros(0, int)
        while len(rows):
            apart = np.array(_apart(group.at[rows]))
            found.append(Member(k, rows[apart], np.searchsorted(voltages, group.at[rows[apart]])))
            rows = np.delete(rows, apart)
    return found


def _apart(places: np.ndarray) -> list[int]:
    """The first unit, and each later one that shares no voltage with those before."""
    taken: set[int] = set()
    chosen = []
    for k, own in enumerate(places.tolist()):
        if taken.isdisjoint(own):
            taken.update(own)
            chosen.append(k)
    return chosen
