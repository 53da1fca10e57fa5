"""The network with its devices at a point of the s-plane, divided into fronts.

A front is a matrix N(s): the nodal admittances of an area with its devices, or those of the separators with all areas
eliminated. Its series around a point has only the blocks of the devices after the first term, except at the separators.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgebal, zgetrf, zgetrs

from .reach import Front, Fronts, Through
from .units import TERMS, Series, Units, series

WEAK = 1e-4  # coupling, relative to the largest, below which a front need not be balanced
WORSE = 1.5  # norm, relative to that balanced in full, with which it need not be


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
