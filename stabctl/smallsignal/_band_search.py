"""All modes of a band: found around shifts, and counted.

The modes of the band are counted first (`argument_principle`). Then they are searched for around shifts, most where
they are dense, each time without those known, until as many are known as were counted. If the shifts do not find them
all, smaller and smaller parts of the band are counted and searched, with as many vectors as modes are missing. What is
not complete even then is named.

In a large system modes are counted and searched for at the same time, in two threads; the result is the same.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from heapq import heappop, heappush
from threading import Event
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from scipy.sparse.csgraph import connected_components

from stabctl._util import process
from stabctl._util.errors import StudyError

from . import eigen
from ._argument_principle import Network, OnBoundaryError, Said, Sector, count
from ._dissection import network
from .descriptor import Descriptor
from .eigen import Eigen

BLOCK, VECTORS = 4, 160  # vectors in a block, and in all, of the first search around a shift
MORE, DEPTH = 2, 4  # vectors in a block beyond the number of modes that are missing; blocks
LEAST = 1e-3  # smallest part of a band, relative to its frequency
MARGIN = 1e-3  # step by which the band is made wider while a mode lies on its edge
TRIES = 5
TOGETHER = 1e-6  # modes this close (relative) nearly coincide
COUNTING = 0.5  # part of the work, for those who wait
TWO_THREADS = 1000  # states from which modes are counted and searched for at the same time
CUTS = np.linspace(0.35, 0.65, 13)  # where a part of the band may be divided
Result = TypeVar("Result")


class Found(NamedTuple):
    """Modes of a band, one of each pair, by frequency; how many there are; parts with more than were found."""

    modes: Eigen
    counted: int
    incomplete: tuple[Sector, ...]


def band(
    d: Descriptor, low_hz: float, high_hz: float, damping: tuple[float, float], said: Said = lambda _: None
) -> Found:
    """Every mode in a band of frequencies (Hz) and damping ratios; w^H v = 1. `said` is told the part of the work done.

    Raises `StudyError` if the band or the damping ratios are not possible.
    """
    if not 0 < low_hz < high_hz < np.inf:
        raise StudyError(
            f"The band from {low_hz:g} to {high_hz:g} Hz is not allowed; it must begin above 0 and not be empty."
        )
    if not -1 < damping[0] < damping[1] < 1:
        raise StudyError(
            f"The damping ratios {damping[0]:g} to {damping[1]:g} are not allowed; give -1 < lowest < highest < 1."
        )
    slopes = (float(-ratio / np.sqrt(1 - ratio**2)) for ratio in reversed(damping))
    asked = Sector(2 * np.pi * low_hz, 2 * np.pi * high_hz, *slopes)
    with process.one_thread():
        return _found(d, asked, said)


def _found(d: Descriptor, asked: Sector, said: Said) -> Found:
    system = network(d)
    at_once = len(d.rows) >= TWO_THREADS and process.available() > 1
    search, sector, counted = (_at_once if at_once else _in_turn)(d, system, asked, said)
    search.complete(sector, counted)
    known = _paired(search.known)
    inside = np.flatnonzero(asked.holds(known.values))
    order = inside[np.lexsort((known.values.real[inside], known.values.imag[inside]))]
    return Found(known.some(order), counted - (len(known.values) - len(inside)), tuple(search.incomplete))


def _in_turn(d: Descriptor, system: Network, asked: Sector, said: Said) -> "tuple[_Search, Sector, int]":
    """Count the modes, then search along the band."""
    sector, counted = _counted(system, asked, lambda done: said(COUNTING * done))
    search = _Search(d, system, sector)
    search.along(sector, lambda: counted, lambda done: said(COUNTING + (1 - COUNTING) * done))
    return search, sector, counted


def _at_once(d: Descriptor, system: Network, asked: Sector, said: Said) -> "tuple[_Search, Sector, int]":
    """Search along the band while a second thread counts; what is found and kept is the same as in turn."""
    with Background(lambda done: _counted(system, asked, done)) as count:
        search = _Search(d, system, asked)
        search.along(
            asked,
            lambda: count.result()[1] if count.ended() else None,
            lambda done: said(max(COUNTING * count.part, done)),
        )
        sector, counted = count.result()
    if sector != asked:  # a mode lies on the edge of the band asked for
        search = _Search(d, system, sector)
        search.along(sector, lambda: counted, said)
    search.until(sector, counted)
    return search, sector, counted


class Background(AbstractContextManager["Background[Result]"], Generic[Result]):
    """A computation in a thread. On leaving the context it ends the next time it tells how far it is.

    Parameters
    ----------
    work : callable
        Given a function that it calls with the part of the work done, from 0 to 1; what it raises, `result` raises.
    """

    def __init__(self, work: Callable[[Callable[[float], None]], Result]) -> None:
        self.part = 0.0
        self._left = Event()
        self._pool = ThreadPoolExecutor(1)
        self._result = self._pool.submit(work, self._said)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._left.set()
        self._pool.shutdown(wait=kind is not KeyboardInterrupt)

    def ended(self) -> bool:
        """Whether it has ended."""
        return self._result.done()

    def result(self) -> Result:
        """What it returns; waits until it has ended."""
        return self._result.result()

    def _said(self, part: float) -> None:
        if self._left.is_set():
            raise LeftError
        self.part = part


class LeftError(Exception):
    """The computation is no longer needed."""


def _counted(system: Network, asked: Sector, said: Said) -> tuple[Sector, int]:
    """The number of modes in a sector, or in one slightly wider if a mode lies on its edge."""
    for k in range(TRIES):
        sector = asked.wider(k * MARGIN)
        try:
            return sector, count(system, sector, said)
        except OnBoundaryError:
            continue
    raise StudyError("Modes lie along the edges of the band, so they cannot be counted; choose another band.")


class _Search:
    """The modes of a sector known so far, and its parts that remain incomplete."""

    def __init__(self, d: Descriptor, system: Network, whole: Sector) -> None:
        none = np.zeros((len(d.rows), 0), complex)
        self.d, self.system, self.whole = d, system, whole
        self.known = Eigen(np.zeros(0, complex), none, none)
        self.incomplete: list[Sector] = []
        self.sizes: list[int] = []  # how many modes were known after every shift

    def missing(self, sector: Sector, counted: int) -> int:
        """How many of the modes counted in a sector are not known."""
        return counted - int(np.count_nonzero(sector.holds(self.known.values)))

    def near(self, shift: complex, steps: tuple[int, int]) -> eigen.Near:
        """Search around a shift (1/s) and keep what is found."""
        found = eigen.near(self.d, shift, steps, self.known)
        self.known = self.known.joined(found.modes.some(self.whole.holds(found.modes.values)))
        self.sizes.append(len(self.known.values))
        return found

    def along(self, sector: Sector, counted: Callable[[], int | None], said: Said) -> None:
        """Search around shifts, most where modes are dense, until all modes of a sector are known or it is covered.

        `counted` gives their number, or None as long as it is not known.
        """
        discs: list[eigen.Near] = []
        boxes = [(0.0, Box(-np.inf, np.inf, sector.low, sector.high))]
        while boxes:
            total = counted()
            if total is None:
                said(0.0)
            elif (missing := self.missing(sector, total)) > 0:
                said(1 - missing / total)
            else:
                return
            _, whole = heappop(boxes)
            box = whole.fitted(sector.least, sector.most)
            if box is None or any(box.within(disc) for disc in discs) or whole.top < (1 + LEAST) * whole.bottom:
                continue
            discs.append(self.near(box.middle(), (BLOCK, VECTORS)))
            if not box.within(discs[-1]):
                for half in box.halves():
                    heappush(boxes, (discs[-1].radius, half))

    def until(self, sector: Sector, counted: int) -> None:
        """Forget what was found after all modes of a sector were known."""
        known = np.cumsum(sector.holds(self.known.values))
        enough = [size for size in self.sizes if size and known[size - 1] >= counted]
        if enough:
            self.known = self.known.some(np.arange(enough[0]))

    def complete(self, sector: Sector, counted: int) -> None:
        """Search in ever smaller parts of a sector, counted one by one, until all its modes are known."""
        if (missing := self.missing(sector, counted)) > 0:
            middle = complex((sector.least + sector.most) / 2, 1) * (sector.low + sector.high) / 2
            self.near(middle, (missing + MORE, max(VECTORS, DEPTH * (missing + MORE))))
            missing = self.missing(sector, counted)
        if missing == 0:
            return
        heights = sector.low + CUTS * (sector.high - sector.low)
        clear = np.abs(heights[:, None] - np.r_[self.known.values.imag, sector.low]).min(axis=1)
        for cut in heights[np.argsort(-clear, kind="stable")] if sector.high > (1 + LEAST) * sector.low else ():
            lower, upper = sector._replace(high=float(cut)), sector._replace(low=float(cut))
            try:
                below = count(self.system, lower)
            except OnBoundaryError:
                continue
            self.complete(lower, below)
            self.complete(upper, counted - below)
            return
        self.incomplete.append(sector)


class Round(Protocol):
    """A disc of the s-plane."""

    @property
    def shift(self) -> complex:
        """Its middle, 1/s."""
        ...

    @property
    def radius(self) -> float:
        """Its radius, 1/s."""
        ...


class Box(NamedTuple):
    """A rectangle of the s-plane, closed on the left and at the bottom, 1/s."""

    left: float
    right: float
    bottom: float
    top: float

    def middle(self) -> complex:
        """Its middle."""
        return complex((self.left + self.right) / 2, (self.bottom + self.top) / 2)

    def reach(self) -> float:
        """Half of its diagonal."""
        return float(np.hypot(self.right - self.left, self.top - self.bottom)) / 2

    def fitted(self, least: float, most: float) -> "Box | None":
        """As wide as the cone least <= Re/Im <= most requires; None if it lies outside. `bottom` must be above 0."""
        left = max(self.left, min(least * self.top, least * self.bottom))
        right = min(self.right, max(most * self.top, most * self.bottom))
        return self._replace(left=left, right=right) if left < right else None

    def within(self, disc: Round) -> bool:
        """Whether a disc covers it."""
        corners = (complex(x, y) for x in (self.left, self.right) for y in (self.bottom, self.top))
        return all(abs(corner - disc.shift) < disc.radius for corner in corners)

    def holds(self, s: np.ndarray) -> np.ndarray:
        """Which of the values (1/s) lie in it."""
        return (s.real >= self.left) & (s.real < self.right) & (s.imag >= self.bottom) & (s.imag < self.top)

    def halves(self) -> "tuple[Box, Box]":
        """Its halves along the longer side."""
        s = self.middle()
        if self.right - self.left > self.top - self.bottom:
            return self._replace(right=s.real), self._replace(left=s.real)
        return self._replace(top=s.imag), self._replace(bottom=s.imag)


def _paired(known: Eigen) -> Eigen:
    """Left vectors scaled to W^H V = 1 among modes that nearly coincide, which separate searches leave inexact."""
    values = known.values
    if len(values) < 2:
        return known
    near = np.abs(values[:, None] - values) <= TOGETHER * np.abs(values)
    label = connected_components(near, directed=False)[1]
    left = known.left.copy()
    for group in (np.flatnonzero(label == k) for k in np.flatnonzero(np.bincount(label) > 1)):
        V, W = known.right[:, group], left[:, group]
        left[:, group] = W @ np.linalg.pinv(V.conj().T @ W)
    return known._replace(left=left)
