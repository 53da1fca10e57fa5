"""All roots of a loop with delays in a region: counted by the argument principle, then found until as many are known.

Region: |s| < radius with Re s > -left, and every s with Re s > edge, edge <= 0. Beyond a bound no root has Re s > edge
(`Characteristic.bound`), so the path around the region runs from there down along Re s = edge and around the circle.
Starting values are corrected by Newton's method; of those that meet, a small circle tells how many roots they are. What
is then still missing is enclosed by rectangles that are counted, halved, and searched with the known roots divided out
(H. Maehly). Source: L. Delves, J. Lyness, A numerical method for locating the zeros of an analytic function,
Mathematics of Computation 21, 1967. E and H are those of `_characteristic`.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from ._argument_principle import OnBoundaryError
from ._characteristic import Characteristic, Path, whole

ITERATIONS = 40
CONVERGED, LOOSE = 1e-9, 1e-5  # last correction of a simple root, and of one of several that meet, relative to 1 + |s|
MEET, AROUND = 1e-7, 1e-3  # distances within which the former and the latter may be the same, relative to 1 + |s|
ASIDE = 1e-11  # relative to 1 + |s|, so that Newton's method is never exactly at a pole
CIRCLE = 1e-2  # largest radius of the circle around them
PART = 0.4  # of the distance to the next root
SMALLEST = 1e-6  # size of a rectangle that is not divided further, relative to 1 + |s|
CUTS = (0.5, 0.46, 0.55, 0.41, 0.6)  # where a rectangle may be divided
HIDDEN = 1e-2  # largest size of what rounding leaves where 1 - E H is 1
BOXES = 400  # rectangles at most
BELOW = 0.05  # of the radius, by which rectangles reach below the real axis


class Region(NamedTuple):
    """|s| < radius with Re s > -left, and Re s > edge, where |s - edge| < far holds all roots; 1/s."""

    radius: float
    left: float
    edge: float
    far: float

    def holds(self, s: np.ndarray) -> np.ndarray:
        """Which of the values (1/s) lie in it."""
        return (np.abs(s) < self.radius) & (s.real > -self.left) | (s.real > self.edge)

    def paths(self) -> list[Path]:
        """Its boundary in the upper half-plane, from right to left."""
        top = self.edge + 1j * np.sqrt(self.radius**2 - self.edge**2)
        inner = self.far**2 < self.radius**2 - self.edge**2
        first, last = 0.0 if inner else float(np.angle(top)), np.pi
        found = [] if inner else [_line(self.edge + 1j * self.far, top)]
        if self.left < self.radius:
            last = float(np.arccos(-self.left / self.radius))
        middle = (first + last) / 2
        found += [_arc(0, self.radius, first, middle), _arc(0, self.radius, middle, last)]
        if self.left < self.radius:
            found.append(_line(self.radius * np.exp(1j * last), -self.left))
        return found


class Box(NamedTuple):
    """A rectangle by its lower left and upper right corner."""

    low: complex
    high: complex

    def holds(self, s: np.ndarray) -> np.ndarray:
        """Which of the values (1/s) lie in it."""
        across = (s.real > self.low.real) & (s.real < self.high.real)
        return across & (s.imag > self.low.imag) & (s.imag < self.high.imag)

    def paths(self) -> list[Path]:
        """Its sides, counterclockwise."""
        corners = (
            self.low,
            complex(self.high.real, self.low.imag),
            self.high,
            complex(self.low.real, self.high.imag),
        )
        return [_line(a, b) for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)]

    def cut(self, part: float) -> "tuple[Box, Box]":
        """Its parts along the longer side."""
        size = self.high - self.low
        if size.real > size.imag:
            x = self.low.real + part * size.real
            return self._replace(high=complex(x, self.high.imag)), self._replace(low=complex(x, self.low.imag))
        y = self.low.imag + part * size.imag
        return self._replace(high=complex(self.high.real, y)), self._replace(low=complex(self.low.real, y))


def count(f: Characteristic, region: Region) -> int:
    """Number of roots in a region. Raises `OnBoundaryError` if one lies on its boundary, or rounding hides it."""
    left = min(region.left, region.radius)
    if np.isinf(region.far) or f.neglected * np.exp(min(left * f.delays.max(initial=0.0), 700)) > HIDDEN:
        raise OnBoundaryError
    beyond = region.far**2 >= region.radius**2 - region.edge**2
    turned = f.far(region.edge + 1j * region.far) if beyond else 0.0
    turned += sum(f.turn(path) for path in region.paths())
    return whole(turned / np.pi) + int(region.holds(f.poles).sum())


def find(f: Characteristic, region: Region, counted: int, seeds: np.ndarray) -> np.ndarray:
    """Roots in a region with Im s >= 0, each as often as it counts; `seeds` are starting values (1/s)."""
    hits, sure = newton(f, seeds[seeds.imag >= -ASIDE])
    found = _distinct(f, _folded(hits), sure)
    missing = counted - int(region.holds(both(found)).sum())
    if missing > 0:
        found = _searched(f, region, found)
    inside = found[region.holds(found)]
    return inside[np.lexsort((inside.real, inside.imag))]


def newton(f: Characteristic, s: np.ndarray, known: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Roots near starting values (1/s), other than those known, without those that lead nowhere; which are simple."""
    s, size = s.astype(complex), np.full(len(s), np.inf)
    for _ in range(ITERATIONS):
        moving = np.flatnonzero(size > CONVERGED * (1 + np.abs(s)))
        if not len(moving):
            break
        at = s[moving] + ASIDE * (1 + 1j) * (1 + np.abs(s[moving]))  # never exactly at a pole
        try:
            slope = f.at(at).slope + (1 / (at[:, None] - f.poles)).sum(axis=1)
        except OnBoundaryError:
            break
        if known is not None:
            slope -= (1 / (at[:, None] - known)).sum(axis=1)
        step = np.divide(1, slope, out=np.full(len(at), np.nan, complex), where=slope != 0)
        step *= np.minimum(1, (1 + np.abs(at)) / np.maximum(np.abs(step), 1e-300))
        s[moving], size[moving] = at - step, np.where(np.isfinite(step), np.abs(step), 0)
    good = np.isfinite(s) & (size <= LOOSE * (1 + np.abs(s)))
    return s[good], size[good] <= CONVERGED * (1 + np.abs(s[good]))


def _folded(s: np.ndarray) -> np.ndarray:
    """In the upper half-plane, real if nearly so."""
    return np.where(np.abs(s.imag) <= 1e-9 * (1 + np.abs(s)), s.real + 0j, s.real + 1j * np.abs(s.imag))


def both(s: np.ndarray) -> np.ndarray:
    """Roots in the upper half-plane with their complex conjugates."""
    return np.r_[s, s[s.imag > 0].conj()]


def _distinct(f: Characteristic, hits: np.ndarray, sure: np.ndarray) -> np.ndarray:
    """Roots, each as often as it counts, from values that may be the same root."""
    if not len(hits):
        return hits
    size = np.where(sure, MEET, AROUND) * (1 + np.abs(hits))
    near = np.abs(hits[:, None] - hits) <= np.maximum(size[:, None], size)
    label = connected_components(near, directed=False)[1]
    groups = [hits[label == k] for k in range(label.max() + 1)]
    middles = np.array([group.mean() for group in groups])
    everything = both(middles)
    found: list[complex] = []
    for k, (group, middle) in enumerate(zip(groups, middles, strict=True)):
        if len(group) == 1 and sure[label == k].all():
            found += [complex(middle)]
            continue
        away = np.abs(everything - middle)
        extent = float(np.abs(group - middle).max())
        radius = min(CIRCLE * (1 + abs(middle)), PART * float(np.min(away[away > 0], initial=np.inf)))
        times = _around(f, middle, radius) if radius > 2 * extent else 0
        apart = np.unique(np.round(group / (1e-8 * (1 + abs(middle)))), return_index=True)[1]
        found += list(group[apart]) if len(apart) == times else [complex(middle)] * times
    return np.array(found, complex)


def _around(f: Characteristic, middle: complex, radius: float) -> int:
    """Number of roots in a circle; 0 if it cannot be counted."""
    try:
        turned = sum(f.turn(_arc(middle, radius, k * np.pi / 2, (k + 1) * np.pi / 2)) for k in range(4))
        return whole(turned / (2 * np.pi)) + int((np.abs(f.poles - middle) < radius).sum())
    except OnBoundaryError:
        return 0


def _searched(f: Characteristic, region: Region, found: np.ndarray) -> np.ndarray:
    """The roots known and those found in rectangles in which there are more."""
    far, left, down = max(region.radius, region.far), min(region.left, region.radius), BELOW * region.radius
    waiting = [Box(complex(-1.0001 * left, -down), complex(region.radius, 1.0001 * region.radius))]
    if far > region.radius:
        waiting.append(Box(complex(region.edge, -down), complex(1.0001 * far, 1.0001 * far)))
    for _ in range(BOXES):
        if not waiting:
            break
        box = waiting.pop()
        if box.high.real <= region.edge and abs(box.low.imag) > region.radius:
            continue
        known = both(found)
        missing = _inside(f, box) - int(box.holds(known).sum())
        if missing <= 0:
            continue
        size = box.high - box.low
        starts = box.low + np.array(
            [complex(x * size.real, y * size.imag) for x in (0.2, 0.5, 0.8) for y in (0.3, 0.7)]
        )
        for s in starts:
            more, _ = newton(f, np.array([s]), both(found))
            if len(more) and region.holds(more)[0]:
                # the last one that is missing close to the real axis is no pair
                last = missing == 1 and abs(more[0].imag) <= LOOSE * (1 + abs(more[0]))
                more = more.real + 0j if last else _folded(more)
                found, missing = np.r_[found, more], missing - int(box.holds(both(more)).sum())
        if missing > 0 and abs(size) > SMALLEST * (1 + abs(box.low)):
            waiting += box.cut(next((c for c in CUTS if _clear(f, box, c)), CUTS[0]))
    return found


def _clear(f: Characteristic, box: Box, part: float) -> bool:
    """Whether the parts of a rectangle can be counted."""
    try:
        _counted(f, box.cut(part)[0])
    except OnBoundaryError:
        return False
    return True


def _inside(f: Characteristic, box: Box) -> int:
    """Number of roots in a rectangle; many if it cannot be counted."""
    try:
        return _counted(f, box)
    except OnBoundaryError:
        return 10**6


def _counted(f: Characteristic, box: Box) -> int:
    return whole(sum(f.turn(path) for path in box.paths()) / (2 * np.pi)) + int(box.holds(f.poles).sum())


def _line(a: complex, b: complex) -> Path:
    return lambda t: a + (b - a) * t


def _arc(middle: complex, radius: float, first: float, last: float) -> Path:
    return lambda t: middle + radius * np.exp(1j * (first + (last - first) * t))
