"""Rectangles of the s-plane, and the discs that cover them."""

from typing import NamedTuple, Protocol

import numpy as np


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
