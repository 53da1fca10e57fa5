"""The network with its devices at a point of the s-plane, divided into fronts, and how far each may be continued.

A front is a matrix N(s): the nodal admittances of an area with its devices, or those of the separators with all areas
eliminated. Around s0, N(s0 + h) = N0 (1 + E(h)), E(h) = h E1 + h^2 E2 + ... While the Frobenius norm of E (after any
scaling) is at most F < 1, N is regular, and

    |log det(1 + E) - tr E| <= -log(1 - F) - F

because the eigenvalues e of E satisfy sum |e|^2 <= F^2. This limits the phase of det N between points.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgebal, zgetrf, zgetrs

from .units import TERMS, Series, Units, series

SLACK = 1.5  # rad   largest error of the predicted phase, below pi / 2
HALVINGS = 8  # of the interval in which the reach is sought
HUGE = 1e200  # in place of an infinite bound, so that it times 0 is 0


class Member(NamedTuple):
    """Units of a group that belong to a front and share no voltage."""

    group: int
    rows: np.ndarray
    places: np.ndarray  # (units, m) of their voltages in the front


class Area(NamedTuple):
    """Constant admittances of an area and its connection to the separators."""

    Y: np.ndarray
    out: np.ndarray  # (area, edge)
    into: np.ndarray  # (edge, area)
    edge: np.ndarray  # places among the separators
    members: list[Member]


class Front(NamedTuple):
    """One front at a point."""

    phase: float  # of det N0
    inverse: np.ndarray  # of N0
    traces: np.ndarray  # (TERMS) of E1, E2, ...
    scale: np.ndarray  # (n)
    norms: np.ndarray  # (TERMS) of the scaled E
    weights: list[np.ndarray]  # (units) of every group: what the rest of their series adds to the norm of E, at most


class Through(NamedTuple):
    """How areas enter the separators: the norms of into, and of the terms of N(s)^-1 out, both scaled."""

    area: np.ndarray  # places among the fronts
    outer: np.ndarray  # (areas)
    inner: np.ndarray  # (areas, TERMS + 1)


class Fronts:
    """All fronts at a point: the areas, and last the separators, if there are any."""

    def __init__(self, fronts: list[Front], seen: list[Series], through: Through | None) -> None:
        self.seen, self.through = seen, through
        self.phase = np.array([front.phase for front in fronts])
        self.traces = np.array([front.traces for front in fronts]).reshape(-1, TERMS)
        self.norms = np.array([front.norms for front in fronts]).reshape(-1, TERMS)
        self.sizes = np.array([len(front.scale) for front in fronts])
        self.weights = [np.array(group) for group in zip(*(front.weights for front in fronts), strict=True)]

    def turn(self, h: complex) -> np.ndarray:
        """Predicted changes of the phases, Im tr E(h)."""
        return (self.traces @ h ** np.arange(1, TERMS + 1)).imag

    def slack(self, r: float) -> np.ndarray:
        """Largest errors of the predicted phases, |h| <= r."""
        rest = np.zeros(len(self.phase))
        for weights, group in zip(self.weights, self.seen, strict=True):
            rest += weights @ np.minimum(group.rest(r), HUGE)
        F = self.norms @ r ** np.arange(1, TERMS + 1) + rest
        if self.through is not None:
            more = self._later(self.through, r, F, rest)
            rest[-1] += more
            F[-1] += more
        inside = F < 1
        F = np.where(inside, F, 0)
        return np.where(inside, -np.log1p(-F) - F + np.sqrt(self.sizes) * rest, np.inf)

    def _later(self, through: Through, r: float, F: np.ndarray, rest: np.ndarray) -> float:
        """Bound of the norm of what the series of the eliminated areas leave out.

        x_j = -(E1 x_(j-1) + E2 x_(j-2) + ...), so with the norms X of all terms left out, x of the terms known and F
        of E, X <= F X + (the products of E and x known that are of higher order).
        """
        area, outer, inner = through
        F, rest = F[area], rest[area]
        if not (F < 1).all():
            return np.inf
        power = r ** np.arange(TERMS + 1)
        later = np.cumsum((power * inner)[:, ::-1], axis=1)  # of the last, the last two, ... terms known
        higher = (power[1:] * self.norms[area] * later[:, :TERMS]).sum(axis=1) + rest * later[:, TERMS]
        return float((outer * higher / (1 - F)).sum())

    def reach(self) -> float:
        """Distance (1/s) within which every front is regular and its phase is known to `SLACK`."""
        far = 1 / float(self.norms[:, 0].max())
        if self.slack(far).max() <= SLACK:
            return far
        low, high = 0.0, far
        for _ in range(HALVINGS):
            r = (low + high) / 2
            low, high = (r, high) if self.slack(r).max() <= SLACK else (low, r)
        return low


@dataclass(frozen=True)
class Network:
    """A system divided into fronts."""

    groups: list[Units]
    areas: list[Area]
    Y: np.ndarray  # constant admittances of the separators, areas eliminated where they are constant
    members: list[Member]  # units at the separators

    def fronts(self, s: complex) -> Fronts:
        """All fronts at a point s (1/s)."""
        seen = [series(u, s) for u in self.groups]
        whole = np.zeros((TERMS + 1, *self.Y.shape), complex)
        whole[0] = self.Y
        found, edges = [], []
        for k, area in enumerate(self.areas):
            front = _of_area(area, seen)
            found.append(front)
            if len(area.edge):
                edges.append((k, area, front, _eliminate(whole, area, front, seen)))
        through = None
        if len(self.Y):
            for group, rows, at in self.members:
                whole[:, at[:, :, None], at[:, None, :]] += seen[group].terms[:, rows]
            phase, inverse = _inverse(whole[0])
            front = _front(phase, inverse, inverse @ whole[1:], self.members, seen)
            found.append(front)
            through = _through(edges, front)
        return Fronts(found, seen, through)


def _of_area(area: Area, seen: list[Series]) -> Front:
    """The front of an area, whose terms E_j = N0^-1 D_j have only the blocks of its units in D_j."""
    N = area.Y.astype(complex)
    for group, rows, at in area.members:
        N[at[:, :, None], at[:, None, :]] += seen[group].terms[0, rows]
    phase, inverse = _inverse(N)
    E = np.zeros((TERMS, *N.shape), complex)
    for member in area.members:
        at, blocks = member.places, _blocks(member, seen)
        product = inverse[:, at].transpose(1, 0, 2) @ blocks
        E[:, :, at] += product.reshape(len(at), len(N), TERMS, -1).transpose(2, 1, 0, 3)
    return _front(phase, inverse, E, area.members, seen)


def _blocks(member: Member, seen: list[Series]) -> np.ndarray:
    """The terms of its units after the first, side by side (units, m, TERMS m)."""
    terms = seen[member.group].terms[1:, member.rows]
    return terms.transpose(1, 2, 0, 3).reshape(*member.places.shape, -1)


def _inverse(N: np.ndarray) -> tuple[float, np.ndarray]:
    """Phase of the determinant, and the inverse."""
    if not np.isfinite(N).all():
        raise np.linalg.LinAlgError("a pole of a unit")
    factors, pivots, singular = zgetrf(N)
    if singular:
        raise np.linalg.LinAlgError("an eigenvalue")
    phase = np.angle(factors.diagonal()).sum() + np.pi * (np.count_nonzero(pivots != np.arange(len(pivots))) % 2)
    return float(phase), zgetrs(factors, pivots, np.eye(len(pivots), dtype=complex))[0]


def _front(phase: float, inverse: np.ndarray, E: np.ndarray, members: list[Member], seen: list[Series]) -> Front:
    size = _squared(E)
    scale = dgebal(np.sqrt(size[0]), scale=1, permute=0)[3]
    norms = np.sqrt(size @ scale**2 @ scale**-2)
    columns = scale**-2 @ _squared(inverse)
    weights = [np.zeros(len(group.root)) for group in seen]
    for group, rows, at in members:
        weights[group][rows] += np.sqrt(columns[at].sum(axis=1)) * scale[at].max(axis=1)
    return Front(phase, inverse, np.trace(E, axis1=1, axis2=2), scale, norms, weights)


def _squared(values: np.ndarray) -> np.ndarray:
    return values.real**2 + values.imag**2


def _eliminate(whole: np.ndarray, area: Area, front: Front, seen: list[Series]) -> np.ndarray:
    """Add -into N(s)^-1 out to the separators; returns the terms x0, x1, ... of N(s)^-1 out.

    x_j = -N0^-1 (D1 x_(j-1) + D2 x_(j-2) + ...).
    """
    x = np.zeros((TERMS + 1, *area.out.shape), complex)
    x[0] = front.inverse @ area.out
    parts = [
        (m.places, _blocks(m, seen), np.zeros((len(m.rows), TERMS * m.places.shape[1], x.shape[2]), complex))
        for m in area.members
    ]
    for j in range(1, TERMS + 1):
        right = np.zeros(area.out.shape, complex)
        for at, blocks, before in parts:
            m = at.shape[1]
            last = before[:, m * (TERMS - j) :]  # x_(j-1), x_(j-2), ... at the units, one below the other
            last[:, :m] = x[j - 1, at]
            right[at] += blocks[:, :, : m * j] @ last
        x[j] = -(front.inverse @ right)
    whole[:, area.edge[:, None], area.edge] -= area.into @ x
    return x


def _through(edges: list[tuple[int, Area, Front, np.ndarray]], separators: Front) -> Through:
    inverse, scale = separators.inverse / separators.scale[:, None], separators.scale
    outer = [np.linalg.norm(inverse[:, area.edge] @ (area.into * front.scale)) for _, area, front, _ in edges]
    inner = [np.sqrt(front.scale**-2 @ _squared(x) @ scale[area.edge] ** 2) for _, area, front, x in edges]
    return Through(np.array([k for k, *_ in edges], int), np.array(outer), np.array(inner).reshape(-1, TERMS + 1))
