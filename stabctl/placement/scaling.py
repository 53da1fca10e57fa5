"""Critical scalings: the least multiple of a fleet that survives one contingency, or all of them."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from .trials import Trials

SCAN = 1.25  # ratio of neighboring multiples of a scan
FINE = 1e-3  # relative width of the final bracket
LITTLE = 1e-3  # multiple below which nothing at all is tried
FAR = 0.85  # of the scaling of a fleet, at which other contingencies are looked at


class Scaled(NamedTuple):
    """The least multiple of a fleet that survives every contingency."""

    scaling: float
    near: dict[int, float]  # contingencies whose own critical scalings are not far below -> those


def critical_scaling(
    survives: Callable[[float], bool], most: float, low: float = 0.0, near: float = 1.0, fine: float = FINE
) -> float | None:
    """The least a in [low, most] such that the fleet times a survives, to the relative width `fine`; None: none does.

    Survival is not monotone in size: the scan goes upward, and the first change from lost to survived is bisected.
    """
    if survives(low):
        return low
    high = min(max(near / 4, SCAN * low), most)
    while not survives(high):
        if high >= most:
            return None
        low, high = high, min(SCAN * high, most)
    return bisect(survives, low, high, fine)


def bisect(survives: Callable[[float], bool], low: float, high: float, fine: float = FINE) -> float:
    """The survived end of a bracket whose low end is lost, once it is narrower than `fine` times itself."""
    while high - low > fine * high:
        middle = (low + high) / 2
        low, high = (low, middle) if survives(middle) else (middle, high)
    return high


def reach(trials: Trials, mw: np.ndarray) -> float:
    """The multiple at which every device of a fleet has come to its cap."""
    return float((trials.cap[mw > 0] / mw[mw > 0]).max(initial=0.0))


def least(trials: Trials, mw: np.ndarray, fine: float = FINE) -> Scaled | None:
    """The least multiple near 1 of a fleet (candidates, MW) that survives everything, and what binds; None: none does.

    Contingencies lost at 1 are scanned upward; where none is, all are scanned downward together. What a fleet `FAR`
    times as large does not survive either is near.
    """
    most = reach(trials, mw)
    if most == 0:
        return None if trials.lost(mw) else Scaled(0.0, {})
    high = low = min(1.0, most)
    while not (lost := trials.lost(low * mw)):
        if low == 0:
            return Scaled(0.0, {})
        high, low = low, low / SCAN if low > LITTLE else 0.0
    near: dict[int, float] = {}
    while lost:
        found = trials.each(partial(_above, trials, mw, low, high, most, fine), lost)
        if None in found:
            return None
        near |= dict(zip(lost, found, strict=True))
        low = high = max(near.values())
        lost = trials.lost(high * mw)
    under = [k for k in trials.lost(FAR * high * mw) if k not in near]
    found = trials.each(lambda k: bisect(lambda a: trials.survives(a * mw, k), FAR * high, high, 10 * fine), under)
    return Scaled(high, near | dict(zip(under, found, strict=True)))


def _above(trials: Trials, mw: np.ndarray, low: float, high: float, most: float, fine: float, k: int) -> float | None:
    """Critical scaling of contingency k, which is lost at `low`."""

    def survives(a: float) -> bool:
        return trials.survives(a * mw, k)

    if high > low and survives(high):
        return bisect(survives, low, high, fine)
    return critical_scaling(survives, most, low, low, fine)
