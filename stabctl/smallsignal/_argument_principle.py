"""How many eigenvalues lie in a sector of the s-plane, by the argument principle on fronts of the divided network.

The states of the devices fall into units that share no equation, such as a machine with its controls. With the states
eliminated, the currents of a unit are D(s) v, D(s) = -C (F - s)^-1 B, in terms of its voltages v. Around a point s0,
with R = (F - s0)^-1,

    D(s0 + h) = -C (R + h R^2 + h^2 R^3 + ...) B.

A front is a matrix N(s): the nodal admittances of an area with its devices, or those of the separators with all areas
eliminated. Its series around a point has only the blocks of the devices after the first term, except at the separators.
Around s0, N(s0 + h) = N0 (1 + E(h)), E(h) = h E1 + h^2 E2 + ... While the Frobenius norm of E (after any scaling) is at
most F < 1, N is regular, and

    |log det(1 + E) - tr E| <= -log(1 - F) - F

because the eigenvalues e of E satisfy sum |e|^2 <= F^2. This limits the phase of det N between points.

The determinant of the pencil is the product of those of all units (F - s) and of all fronts N(s) of the network. Along
the boundary the phase of each det N is followed from point to point. It is computed at each point from the factors, and
between two points it is known from their series to less than half a turn, so no turn can be lost: there are as many
points as that takes. What remains is rounding: the number of turns comes out as a whole number.
Source of the principle: L. Ahlfors, Complex Analysis, 3rd ed. 1979, ch. 4, section 5.2.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgebal, zgetrf, zgetrs

NEAR = 1e-6  # reach, relative to |s|, below which an eigenvalue lies on the boundary
WHOLE = 1e-3  # turns   largest rounding error
AHEAD = 0.75  # of the reach of a point, expected of the next one
SLACK = 1.5  # rad   largest error of the predicted phase, below pi / 2
HALVINGS = 8  # of the interval in which the reach is sought
HUGE = 1e200  # in place of an infinite bound, so that it times 0 is 0
WEAK = 1e-4  # coupling, relative to the largest, below which a front need not be balanced
WORSE = 1.5  # norm, relative to that balanced in full, with which it need not be
DOUBLINGS = 3
TERMS = ROOT = 2**DOUBLINGS  # terms of a series after the first; power of R whose norm bounds what is left out
Said = Callable[[float], None]  # called with the part of the work done, 0 to 1


class Sector(NamedTuple):
    """Frequencies low to high (rad/s) with slopes least <= Re/Im <= most."""

    low: float
    high: float
    least: float
    most: float

    def corners(self) -> list[complex]:
        """Its corners (1/s), counterclockwise from the lower left."""
        ends = ((self.least, self.low), (self.most, self.low), (self.most, self.high), (self.least, self.high))
        return [complex(slope * w, w) for slope, w in ends]

    def holds(self, s: np.ndarray) -> np.ndarray:
        """Which of the values (1/s) lie in it."""
        steep = (s.real >= self.least * s.imag) & (s.real <= self.most * s.imag)
        return (s.imag >= self.low) & (s.imag <= self.high) & steep

    def wider(self, part: float) -> "Sector":
        """A sector with every edge moved outward by a part of the frequency there."""
        return Sector(self.low * (1 - part), self.high * (1 + part), self.least - part, self.most + part)


class OnBoundaryError(Exception):
    """An eigenvalue lies on the boundary, as far as can be told."""


class Units(NamedTuple):
    """Units with the same numbers of states and voltages; x' = F x + B v, currents C x."""

    F: np.ndarray  # (units, n, n)
    B: np.ndarray  # (units, n, m)
    C: np.ndarray  # (units, m, n)
    at: np.ndarray  # (units, m) their voltages

    def poles(self) -> np.ndarray:
        """Eigenvalues of all F."""
        return np.linalg.eigvals(self.F).ravel()


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


class Series(NamedTuple):
    """Taylor coefficients of the admittances of some units, and what bounds the rest."""

    terms: np.ndarray  # (TERMS + 1, units, m, m)
    beyond: np.ndarray  # (ROOT, units)  bounds of the first terms left out
    root: np.ndarray  # (units)  norm of R^ROOT

    def rest(self, r: float) -> np.ndarray:
        """Bounds (units) of the norm of all terms left out, |h| <= r; infinite where the series may diverge."""
        with np.errstate(over="ignore", invalid="ignore"):
            ratio = r**ROOT * self.root
            first = r ** np.arange(TERMS + 1, TERMS + 1 + ROOT) @ self.beyond
            return np.where(ratio < 1, first / np.where(ratio < 1, 1 - ratio, 1), np.inf)


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
            blocks = [_blocks(member, seen) for member in area.members]
            front = _of_area(area, seen, blocks)
            found.append(front)
            if len(area.edge):
                edges.append((k, area, front, _eliminate(whole, area, front, blocks)))
        through = None
        if len(self.Y):
            for group, rows, at in self.members:
                whole[:, at[:, :, None], at[:, None, :]] += seen[group].terms[:, rows]
            phase, inverse = _inverse(whole[0])
            front = _front(phase, inverse, inverse @ whole[1:], self.members, seen)
            found.append(front)
            through = _through(edges, front)
        return Fronts(found, seen, through)


def count(system: Network, sector: Sector, said: Said = lambda _: None) -> int:
    """Number of eigenvalues in a sector. Raises `OnBoundaryError` if one lies on its boundary."""
    corners = sector.corners()
    sides = list(pairwise([*corners, corners[0]]))
    length, done, turns = sum(abs(b - a) for a, b in sides), 0.0, 0.0
    first = last = _point(system, corners[0])
    for k, (_, end) in enumerate(sides):
        final = first if k == len(sides) - 1 else _point(system, end)
        ahead = [final]
        while ahead:
            a, b = last, ahead[-1]
            gap = abs(b.s - a.s) - a.reach - b.reach
            if gap <= 0:
                turns += _turned(a, b)
                done += abs(b.s - a.s)
                said(done / length)
                last = ahead.pop()
            else:
                step = a.reach + min(gap / 2, AHEAD * a.reach)
                ahead.append(_point(system, a.s + (b.s - a.s) * step / abs(b.s - a.s)))
    turns /= 2 * np.pi
    if abs(turns - round(turns)) > WHOLE:
        raise OnBoundaryError
    poles = np.concatenate([group.poles() for group in system.groups])
    return round(turns) + int(sector.holds(poles).sum())


class Point(NamedTuple):
    """The fronts at a point of the boundary."""

    s: complex
    fronts: Fronts
    reach: float


def _point(system: Network, s: complex) -> Point:
    try:
        fronts = system.fronts(s)
    except np.linalg.LinAlgError:
        raise OnBoundaryError from None
    far = fronts.reach()
    if not far > NEAR * abs(s):
        raise OnBoundaryError
    return Point(s, fronts, far)


def _turned(a: Point, b: Point) -> float:
    """Change of the phase of all fronts from one point to the next: the prediction, made exact by whole turns."""
    middle = a.s + (b.s - a.s) * a.reach / (a.reach + b.reach)
    expected = a.fronts.turn(middle - a.s) - b.fronts.turn(middle - b.s)
    turned = b.fronts.phase - a.fronts.phase
    return float((expected + (turned - expected + np.pi) % (2 * np.pi) - np.pi).sum())


def series(u: Units, s: complex) -> Series:
    """The admittances of some units around a point s (1/s)."""
    R, (count, n, m) = np.linalg.inv(u.F - s * np.eye(u.F.shape[1])), u.B.shape
    X = R @ u.B
    for _ in range(DOUBLINGS):  # R B, R^2 B, ..., side by side
        X, R = np.concatenate([X, R @ X], axis=2), R @ R
    later = R @ X
    terms = -u.C @ np.concatenate([X, later[:, :, :m]], axis=2)
    left_out = np.concatenate([later[:, :, m:], R @ later[:, :, :m]], axis=2)
    beyond = (
        np.linalg.norm(left_out.reshape(count, n, ROOT, m), axis=(1, 3)) * np.linalg.norm(u.C, axis=(1, 2))[:, None]
    )
    return Series(terms.reshape(count, m, TERMS + 1, m).transpose(2, 0, 1, 3), beyond.T, np.linalg.norm(R, axis=(1, 2)))


def _of_area(area: Area, seen: list[Series], blocks: list[np.ndarray]) -> Front:
    """The front of an area, whose terms E_j = N0^-1 D_j have only the blocks of its units in D_j."""
    N = area.Y.astype(complex)
    for group, rows, at in area.members:
        N[at[:, :, None], at[:, None, :]] += seen[group].terms[0, rows]
    phase, inverse = _inverse(N)
    E = np.zeros((TERMS, *N.shape), complex)
    for (_, _, at), own in zip(area.members, blocks, strict=True):
        product = inverse[:, at].transpose(1, 0, 2) @ own
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
    scale = _balance(size)
    norms = np.sqrt(size @ scale**2 @ scale**-2)
    columns = scale**-2 @ _squared(inverse)
    weights = [np.zeros(len(group.root)) for group in seen]
    for group, rows, at in members:
        weights[group][rows] += np.sqrt(columns[at].sum(axis=1)) * scale[at].max(axis=1)
    return Front(phase, inverse, np.trace(E, axis1=1, axis2=2), scale, norms, weights)


def _balance(size: np.ndarray) -> np.ndarray:
    """Scales of the voltages of a front, from the squares of the magnitudes of its terms.

    Couplings that grow weaker from device to device in one direction have scales of any size, which would enlarge those
    with the separators. They are used only where the norm of the first term requires it.
    """
    first = np.sqrt(size[0])
    mild, full = (dgebal(first + k * first.max(), scale=1, permute=0)[3] for k in (WEAK, 0.0))
    norm = [float(size[0] @ scale**2 @ scale**-2) for scale in (mild, full)]
    found: np.ndarray = mild if norm[0] <= WORSE**2 * norm[1] else full
    return found


def _squared(values: np.ndarray) -> np.ndarray:
    return values.real**2 + values.imag**2


def _eliminate(whole: np.ndarray, area: Area, front: Front, blocks: list[np.ndarray]) -> np.ndarray:
    """Add -into N(s)^-1 out to the separators; returns the terms x0, x1, ... of N(s)^-1 out.

    x_j = -N0^-1 (D1 x_(j-1) + D2 x_(j-2) + ...).
    """
    x = np.zeros((TERMS + 1, *area.out.shape), complex)
    x[0] = front.inverse @ area.out
    earlier = [np.zeros((len(rows), TERMS * at.shape[1], x.shape[2]), complex) for _, rows, at in area.members]
    for j in range(1, TERMS + 1):
        right = np.zeros(area.out.shape, complex)
        for (_, _, at), own, before in zip(area.members, blocks, earlier, strict=True):
            m = at.shape[1]
            last = before[:, m * (TERMS - j) :]  # x_(j-1), x_(j-2), ... at the units, one below the other
            last[:, :m] = x[j - 1, at]
            right[at] += own[:, :, : m * j] @ last
        x[j] = -(front.inverse @ right)
    whole[:, area.edge[:, None], area.edge] -= area.into @ x
    return x


def _through(edges: list[tuple[int, Area, Front, np.ndarray]], separators: Front) -> Through:
    inverse, scale = separators.inverse / separators.scale[:, None], separators.scale
    outer = [np.linalg.norm(inverse[:, area.edge] @ (area.into * front.scale)) for _, area, front, _ in edges]
    inner = [np.sqrt(front.scale**-2 @ _squared(x) @ scale[area.edge] ** 2) for _, area, front, x in edges]
    return Through(np.array([k for k, *_ in edges], int), np.array(outer), np.array(inner).reshape(-1, TERMS + 1))
