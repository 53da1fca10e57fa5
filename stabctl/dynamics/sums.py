"""Sums of the signals that drive one summing port."""

import numpy as np

from stabctl.devices.device import of

from . import adder
from .rows import NO_UNIT
from .tables import Family


class Sums:
    """Assigns a place to every sum, once.

    Parameters
    ----------
    zero
        Place of the constant 0, the sum of nothing.
    end
        Place of the next output.
    """

    def __init__(self, zero: int, end: int) -> None:
        self._zero, self.end = zero, end
        self.places: dict[tuple[int, ...], int] = {}  # places that are added up -> place of their sum

    def of(self, places: list[int]) -> int:
        """Place of the sum of the signals at these places."""
        if len(places) < 2:
            return places[0] if places else self._zero
        if tuple(places) not in self.places:
            self.places[tuple(places)] = self.end
            self.end += 1
        return self.places[tuple(places)]

    def families(self) -> list[Family]:
        """The devices that add, two signals at a time."""
        rows = []
        for places, out in self.places.items():
            left = places[0]
            for i, right in enumerate(places[1:]):
                last = i == len(places) - 2
                here = out if last else self.end
                self.end += not last
                rows.append([0, 0, 0, NO_UNIT, left, right, here])
                left = here
        if not rows:
            return []
        w = np.array(rows, np.int64)
        return [Family("adder", of(adder), w, np.zeros((len(rows), 0)), ("a summing port",) * len(rows))]
