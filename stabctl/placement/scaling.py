"""Critical scalings: the smallest multiple of a fleet that survives one contingency, or all of them."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .trials import Trials

SCAN = 1.25  # ratio of neighboring multiples of a scan
FINE = 2e-3  # relative width of the final bracket
COARSE = 1e-2  # the same for contingencies that are not binding
SMALL = 1e-3  # multiple below which the empty fleet is tried
NEAR = 0.85  # of the scaling of a fleet: contingencies lost there are nearly binding


class Bracket(NamedTuple):
    """Two multiples of a fleet: the larger one survives, the smaller one does not."""

    low: float
    high: float


class Scaled(NamedTuple):
    """The smallest multiple of a fleet that survives every contingency."""

    scaling: float
    near: dict[int, float]  # contingencies that are binding or nearly so -> their own critical scalings


def critical_scaling(
    survives: Callable[[float], bool], most: float, *, low: float = 0.0, near: float = 1.0, fine: float = FINE
) -> float | None:
    """The smallest a in [low, most] such that the fleet times a survives; None if none does.

    Survival is not monotone in size: the multiples are scanned upward, and the first change from lost to survived is
    bisected.

    Parameters
    ----------
    survives : callable
        Whether the fleet times a survives.
    most, low : float
        Range of multiples.
    near : float
        A guess of the result.
    fine : float
        Relative width of the final bracket.
    """
    found = first_bracket(survives, most, low=low, near=near)
    return found and bisect(survives, found.low, found.high, fine)


def first_bracket(
    survives: Callable[[float], bool], most: float, *, low: float = 0.0, near: float = 1.0
) -> Bracket | None:
    """The first neighbors of the upward scan of `critical_scaling` between which survival begins.

    None if nothing survives; without width if `low` survives.
    """
    if survives(low):
        return Bracket(low, low)
    high = min(max(near / 4, SCAN * low), most)
    while not survives(high):
        if high >= most:
            return None
        low, high = high, min(SCAN * high, most)
    return Bracket(low, high)


def bisect(survives: Callable[[float], bool], low: float, high: float, fine: float = FINE) -> float:
    """The survived end of a bracket that is lost at its low end, once it is narrower than `fine` times itself."""
    while high - low > fine * high:
        low, high = halved(survives, Bracket(low, high))
    return high


def halved(survives: Callable[[float], bool], bracket: Bracket) -> Bracket:
    """The half of a bracket in which survival begins."""
    low, high = bracket
    middle = (low + high) / 2
    return Bracket(low, middle) if survives(middle) else Bracket(middle, high)


def along(trials: Trials, mw: np.ndarray, k: int) -> Callable[[float], bool]:
    """Whether a multiple of a fleet (candidates, MW) survives scenario k."""
    return lambda a: trials.survives(a * mw, k)


def largest_scaling(trials: Trials, mw: np.ndarray) -> float:
    """The multiple at which every device of a fleet has reached its cap."""
    return float((trials.cap[mw > 0] / mw[mw > 0]).max(initial=0.0))


def least_scaling(trials: Trials, mw: np.ndarray, fine: float = FINE) -> Scaled | None:
    """The smallest multiple near 1 of a fleet (candidates, MW) that survives everything; None if none does.

    Contingencies lost at 1 are scanned upward; if none is, all are scanned downward together.
    """
    most = largest_scaling(trials, mw)
    if most == 0:
        return None if trials.lost(mw) else Scaled(0.0, {})
    high = low = min(1.0, most)
    while not (lost := trials.lost(low * mw)):
        if low == 0:
            return Scaled(0.0, {})
        high, low = low, low / SCAN if low > SMALL else 0.0

    def above(k: int) -> Bracket | None:
        """Where survival of contingency k begins, which is lost at `low`."""
        survives = along(trials, mw, k)
        if high > low and survives(high):
            return Bracket(low, high)
        return first_bracket(survives, most, low=low, near=low)

    near: dict[int, float] = {}
    while lost:
        found = trials.each(above, lost)
        brackets = {k: b for k, b in zip(lost, found, strict=True) if b is not None}
        if len(brackets) < len(lost):
            return None
        near |= _narrowed(trials, mw, brackets, fine)
        low = high = max(near.values())
        lost = trials.lost(high * mw)
    under = [k for k in trials.lost(NEAR * high * mw) if k not in near]
    below = trials.each(lambda k: bisect(along(trials, mw, k), NEAR * high, high, max(fine, COARSE)), under)
    return Scaled(high, near | dict(zip(under, below, strict=True)))


def _narrowed(trials: Trials, mw: np.ndarray, brackets: dict[int, Bracket], fine: float) -> dict[int, float]:
    """The critical scalings of contingencies with a bracket each: of the binding ones, and of those nearly so.

    The others are not worth more simulations.
    """
    while True:
        top = max(b.low for b in brackets.values())
        brackets = {k: b for k, b in brackets.items() if b.high >= NEAR * top}
        wide = [
            k for k, b in brackets.items() if b.high - b.low > (fine if b.high > top else max(fine, COARSE)) * b.high
        ]
        if not wide:
            return {k: b.high for k, b in brackets.items()}
        brackets |= _halved(trials, mw, {k: brackets[k] for k in wide})


def _halved(trials: Trials, mw: np.ndarray, brackets: dict[int, Bracket]) -> dict[int, Bracket]:
    """The halves of the brackets of some contingencies in which survival begins."""
    halves = trials.each(lambda k: halved(along(trials, mw, k), brackets[k]), brackets)
    return dict(zip(brackets, halves, strict=True))
