"""The network with its devices at a point of the s-plane, divided into fronts, and how far each may be continued.

A front is a matrix N(s): the nodal admittances of an area with its devices, or those of the separators with all areas
eliminated. Around s0, N(s0 + h) = N0 (1 + E(h)), E(h) = h E1 + h^2 E2 + ... While the Frobenius norm of E (after any
scaling) is at most F < 1, N is regular, and

    |log det(1 + E) - tr E| <= -log(1 - F) - F

because the eigenvalues e of E satisfy sum |e|^2 <= F^2. This limits the phase of det N between points.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy.linalg as sl

from .units import TERMS, Series, Units, series

SLACK = 1.5  # rad   largest error of the predicted phase, below pi / 2
HALVINGS = 8  # of the interval in which the reach is sought


class Member(NamedTuple):
    """Units of a group that belong to a front."""

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
    inverse: np.ndarray
    E: np.ndarray  # (TERMS, n, n)   E1, E2, ...
    scale: np.ndarray  # (n)
    norms: np.ndarray  # (TERMS) of the scaled E
    rest: Callable[[float], float]  # bound of the norm of the terms left out, |h| <= r

    def size(self, r: float) -> float:
        """Bound of the norm of E, |h| <= r."""
        return float(r ** np.arange(1, TERMS + 1) @ self.norms) + self.rest(r)

    def slack(self, r: float) -> float:
        """Largest error of the predicted phase, |h| <= r."""
        F = self.size(r)
        return float(-np.log1p(-F) - F + np.sqrt(len(self.scale)) * self.rest(r)) if F < 1 else np.inf

    def turn(self, h: complex) -> float:
        """Predicted change of the phase, Im tr E(h)."""
        traces = np.trace(self.E, axis1=1, axis2=2)
        return float((h ** np.arange(1, TERMS + 1) @ traces).imag)


@dataclass(frozen=True)
class Network:
    """A system divided into fronts."""

    groups: list[Units]
    areas: list[Area]
    Y: np.ndarray  # constant admittances of the separators, areas eliminated where they are constant
    members: list[Member]  # units at the separators

    def fronts(self, s: complex) -> list[Front]:
        """All fronts at a point s (1/s)."""
        seen = [series(u, s) for u in self.groups]
        rest = cache(lambda r: [group.rest(r) for group in seen])
        whole = np.zeros((TERMS + 1, *self.Y.shape), complex)
        whole[0] = self.Y
        found, rests = [], []
        for area in self.areas:
            N = np.zeros((TERMS + 1, *area.Y.shape), complex)
            N[0] = area.Y
            _add(N, area.members, seen)
            found.append(front := _front(N, _tail(area.members, rest)))
            if len(area.edge):
                rests.append((area, front, _eliminate(whole, area, front)))
        if len(self.Y):
            _add(whole, self.members, seen)
            own, through = _tail(self.members, rest), _through(rests)
            found.append(_front(whole, lambda G, T, r: own(G, T, r) + through(G, T, r)))
        return found


def reach(fronts: list[Front]) -> float:
    """Distance (1/s) within which every front is regular and its phase is known to `SLACK`."""
    far = 1 / max(float(front.norms[0]) for front in fronts)
    for front in fronts:
        if front.slack(far) > SLACK:
            low, high = 0.0, far
            for _ in range(HALVINGS):
                r = (low + high) / 2
                low, high = (r, high) if front.slack(r) <= SLACK else (low, r)
            far = low
    return far


def _add(N: np.ndarray, members: list[Member], seen: list[Series]) -> None:
    for group, rows, at in members:
        np.add.at(N, (slice(None), at[:, :, None], at[:, None, :]), seen[group].terms[:, rows])  # type: ignore[arg-type]  # the stubs lack slices


def _front(N: np.ndarray, tail: Callable[[np.ndarray, np.ndarray, float], float]) -> Front:
    if not np.isfinite(N).all():
        raise np.linalg.LinAlgError("a pole of a unit")
    factors, pivots = sl.lu_factor(N[0], check_finite=False)
    if not factors.diagonal().all():
        raise np.linalg.LinAlgError("an eigenvalue")
    phase = np.angle(factors.diagonal()).sum() + np.pi * (np.count_nonzero(pivots != np.arange(len(pivots))) % 2)
    G = sl.lu_solve((factors, pivots), np.eye(len(pivots)), check_finite=False)
    E = G @ N[1:]
    scale = np.diag(sl.matrix_balance(np.abs(E[0]), permute=False)[1])
    norms = np.linalg.norm(E * scale / scale[:, None], axis=(1, 2))
    return Front(float(phase), G, E, scale, norms, cache(lambda r: tail(G, scale, r)))


def _tail(
    members: list[Member], rest: Callable[[float], list[np.ndarray]]
) -> Callable[[np.ndarray, np.ndarray, float], float]:
    """Bound of the norm of what the series of the units leave out; `rest` gives the bounds of each group of units."""
    weights: list[np.ndarray] = []

    def bound(G: np.ndarray, T: np.ndarray, r: float) -> float:
        if not weights:
            columns = np.square(np.abs(G / T[:, None])).sum(axis=0)
            weights.extend(np.sqrt(columns[at].sum(axis=1)) * T[at].max(axis=1) for _, _, at in members)
        parts = zip(weights, members, strict=True)
        return float(sum(w @ rest(r)[m.group][m.rows] for w, m in parts))

    return bound


def _eliminate(whole: np.ndarray, area: Area, front: Front) -> np.ndarray:
    """Add -into N(s)^-1 out to the separators; returns the terms x0, x1, ... of N(s)^-1 out."""
    x = [front.inverse @ area.out]
    for j in range(TERMS):
        x.append(-sum(front.E[i] @ x[j - i] for i in range(j + 1)))
    terms = np.array(x)
    whole[:, area.edge[:, None], area.edge] -= area.into @ terms
    return terms


def _through(rests: list[tuple[Area, Front, np.ndarray]]) -> Callable[[np.ndarray, np.ndarray, float], float]:
    """Bound of the norm of what the series of the eliminated areas leave out.

    x_j = -(E1 x_(j-1) + E2 x_(j-2) + ...), so with the norms X of all terms left out, x of the terms known and F of E,
    X <= F X + (the products of E and x known that are of higher order).
    """
    weights: list[tuple[Front, float, np.ndarray]] = []

    def bound(G: np.ndarray, T: np.ndarray, r: float) -> float:
        if not weights:
            for area, front, x in rests:
                outer = np.linalg.norm((G[:, area.edge] / T[:, None]) @ (area.into * front.scale))
                inner = np.linalg.norm(x / front.scale[:, None] * T[area.edge], axis=(1, 2))
                weights.append((front, float(outer), inner))
        total, power = 0.0, r ** np.arange(TERMS + 1)
        for front, through, known in weights:
            F = front.size(r)
            if F >= 1:
                return np.inf
            later = np.cumsum((power * known)[::-1])  # of the last, the last two, ... terms known
            higher = float((power[1:] * front.norms) @ later[:TERMS] + front.rest(r) * later[TERMS])
            total += through * higher / (1 - F)
        return total

    return bound
