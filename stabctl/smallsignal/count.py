"""How many eigenvalues lie in a sector of the s-plane, by the argument principle.

The determinant of the pencil is the product of those of all units (F - s) and of all fronts N(s) of the network. Along
the boundary the phase of each det N is followed from point to point. It is computed at each point from the factors, and
between two points it is known from their series to less than half a turn, so no turn can be lost: there are as many
points as that takes. What remains is rounding: the number of turns comes out as a whole number.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from .fronts import Network
from .reach import Fronts

NEAR = 1e-6  # reach, relative to |s|, below which an eigenvalue lies on the boundary
WHOLE = 1e-3  # turns   largest rounding error
AHEAD = 0.75  # of the reach of a point, expected of the next one

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


class Point(NamedTuple):
    """The fronts at a point of the boundary."""

    s: complex
    fronts: Fronts
    reach: float


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
