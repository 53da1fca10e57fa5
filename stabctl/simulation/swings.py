"""The last swings of a run: whether they decay, which tells what comes after its end.

If synchronism was lost, the machines on one side of the widest gap between the rotor angles have lost it together.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

SPAN = 5.0  # s   judged at the end of a run, in two halves
LEAST = 2.5  # s   since the last event, below which nothing is said
SHARE = 0.5  # of the largest swing: rotors that swing less are not judged
FAINT = np.deg2rad(1.0)  # swings below are not judged
SMALL = np.deg2rad(60.0)  # swings below are far from the limit
VERY_SMALL = np.deg2rad(30.0)
STEADY, GROWTH = 0.95, 1.05  # ratios of two swings: from the first on they do not decay, from the second on they grow


class Swings(NamedTuple):
    """The largest swings of rotor angles against the center of inertia of their island, toward the end of a run.

    A swing is the difference between the largest and the smallest angle within half of the time judged, which is the
    last 5 s, or the time since the last event if that is shorter. A machine is judged if its last swing is at least
    half of the largest one.

    One machine at 40 degrees on an infinite bus loses synchronism at 140 degrees. If it swings by 60 degrees, from 10
    to 70, its energy is an eighth of the critical one: such a swing is small.
    """

    machine: int | str  # whose swings decay least, of those judged
    last: float  # rad   its swing in the last half
    before: float  # rad   and in the half before
    widest: int | str  # machine of the largest swing in the last half
    largest: float  # rad   this swing
    largest_before: float  # rad   largest swing of any machine in the half before
    half_s: float  # s   length of a half
    limit: float  # ratio of the two swings of a machine below which they decay

    @property
    def decaying(self) -> bool:
        """Whether the swings of every machine judged fall below the limit, or there are hardly any."""
        return self.largest < FAINT or self.last < self.limit * self.before

    @property
    def growing(self) -> bool:
        """Whether the largest swing of all grows."""
        return not self.decaying and self.largest > GROWTH * self.largest_before

    @property
    def lasting(self) -> bool:
        """Whether the swings neither grow nor decay, or decay hardly."""
        return not self.decaying and not self.growing and self.last > STEADY * self.before

    @property
    def settled(self) -> bool:
        """Whether a longer run would not show more: the swings decay, or are small and do not grow."""
        return self._decaying_or_below(SMALL)

    @property
    def calm(self) -> bool:
        """Whether a slightly shorter fault would not show more: the swings decay, or are very small and do not grow."""
        return self._decaying_or_below(VERY_SMALL)

    def _decaying_or_below(self, size: float) -> bool:
        """Whether the swings decay, or are below a size (rad) and do not grow."""
        return self.decaying or (self.largest < size and not self.growing)

    def __str__(self) -> str:
        span = f"degrees in the last {self.half_s:.2g} s"
        if self.growing:
            now, before = np.rad2deg((self.largest, self.largest_before))
            return f"The swings grow: the largest is {now:.3g} {span}, {before:.3g} before."
        if self.lasting:
            now, before = np.rad2deg((self.last, self.before))
            return (
                f"The swings do not decay: machine {self.machine} swings by {now:.3g} {span}, by {before:.3g} before."
            )
        return ""


def judged(
    angle: np.ndarray,
    middle: int,
    island: np.ndarray,
    inertia: np.ndarray,
    names: Sequence[int | str],
    half_s: float,
    limit: float,
) -> Swings | None:
    """The swings of rotors in two halves of equal length.

    Parameters
    ----------
    angle : (rows, rotors) array, rad
        Rotor angles.
    middle : int
        Row in which the halves meet.
    island : (rotors,) array of int
        Their islands, -1 for those disconnected.
    inertia : (rotors,) array, s
        Inertia constants on the system base.
    names
        Names or numbers of the machines.
    half_s : float, s
        Length of a half.
    limit : float
        Ratio below which swings decay; 0 judges nothing.

    Returns
    -------
    Swings or None
        None if fewer than two machines are connected, or nothing is judged.
    """
    on = np.flatnonzero(island >= 0)
    if len(on) < 2 or not limit:
        return None
    moved, H, island = angle[:, on], inertia[on], island[on]
    for k in np.unique(island):
        mine = slice(None) if (island == k).all() else island == k  # all: without a copy
        moved[:, mine] -= (moved[:, mine] @ H[mine] / H[mine].sum())[:, None]
    last, before = (half.max(axis=0) - half.min(axis=0) for half in (moved[middle:], moved[: middle + 1]))
    ratio = np.where(last >= SHARE * last.max(), last / np.maximum(before, 1e-12), 0.0)
    one = int(ratio.argmax())
    of_one, of_all = (float(last[one]), float(before[one])), (float(last.max()), float(before.max()))
    return Swings(names[on[one]], *of_one, names[on[int(last.argmax())]], *of_all, half_s, limit)


def group(moved: np.ndarray, lost: int, together: np.ndarray) -> np.ndarray:
    """The rotors on the same side as one that has lost synchronism, among those of its island.

    Parameters
    ----------
    moved : (rotors,) array, rad
        Changes of their angles.
    lost : int
        Row of the rotor that has lost synchronism.
    together : (rotors,) array of bool
        Which rotors are in its island, itself included.

    Returns
    -------
    (rotors,) array of bool
    """
    rows, found = np.flatnonzero(together), np.zeros(len(moved), bool)
    if len(rows) < 2:
        found[lost] = True
        return found
    side = ahead(moved[rows])
    found[rows] = side == side[rows == lost][0]
    return found


def ahead(moved: np.ndarray) -> np.ndarray:
    """Which rotors are ahead of the widest gap.

    Parameters
    ----------
    moved : (rotors,) array, rad
        Changes of their angles; at least two.

    Returns
    -------
    (rotors,) array of bool
    """
    order, found = np.argsort(moved), np.zeros(len(moved), bool)
    found[order[np.argmax(np.diff(moved[order])) + 1 :]] = True
    return found
