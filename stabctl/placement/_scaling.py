"""Critical scalings of a fleet: the smallest multiple that survives, and the gradient of that boundary.

The gradient tells how much a megawatt at each candidate helps to survive a contingency. A gradient d (candidates, 1/MW)
at a fleet s on the boundary is scaled to d . s = 1, so that its cut is d . s' >= 1.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .trials import Trials

SCAN = 1.25  # ratio of neighboring multiples of a scan
FIRST = 0.25  # multiple of a scan from 0
FINE = 2e-3  # relative width of the final bracket
FINEST = 1e-4  # the same for differences of scalings
COARSE = 1e-2  # the same for contingencies that are not binding
SMALL = 1e-3  # multiple below which the empty fleet is tried
NEAR = 0.85  # of the scaling of a fleet: contingencies lost there are nearly binding
INSIDE = (1.04, 1.08, 1.16, 1.02)  # multiples of the boundary fleet at which nearby fleets are simulated
OUTSIDE = (2 * FINE, COARSE, 2 * COARSE)  # parts of the boundary fleet left out to see what is lost
STEP = 0.03  # first change of one size, relative to the whole fleet
HALVINGS = 8
AFTER = 0.25  # s   simulated beyond the instant of the largest angle


class Bracket(NamedTuple):
    """Two multiples of a fleet: the larger one survives, the smaller one does not."""

    low: float
    high: float


class Scaled(NamedTuple):
    """The smallest multiple of a fleet that survives every contingency."""

    scaling: float
    near: dict[int, float]  # contingencies that are binding or nearly so -> their own critical scalings


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
        return first_bracket(survives, most, low)

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


def largest_scaling(trials: Trials, mw: np.ndarray) -> float:
    """The multiple at which every device of a fleet has reached its cap."""
    return float((trials.cap[mw > 0] / mw[mw > 0]).max(initial=0.0))


def along(trials: Trials, mw: np.ndarray, k: int) -> Callable[[float], bool]:
    """Whether a multiple of a fleet (candidates, MW) survives scenario k."""
    return lambda a: trials.survives(a * mw, k)


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


def critical_scaling(survives: Callable[[float], bool], most: float) -> float | None:
    """The smallest multiple up to `most` with which a fleet survives; None if there is none.

    Survival is not monotone in size: the multiples are scanned upward, and the first change from lost to survived is
    bisected.
    """
    found = first_bracket(survives, most)
    return found and bisect(survives, found.low, found.high)


def first_bracket(survives: Callable[[float], bool], most: float, low: float = 0.0) -> Bracket | None:
    """The first neighbors of an upward scan from `low` between which survival begins.

    None if nothing survives; without width if `low` survives.
    """
    if survives(low):
        return Bracket(low, low)
    high = min(SCAN * low or FIRST, most)
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


def by_peak(trials: Trials, mw: np.ndarray, k: int) -> np.ndarray | None:
    """Forward differences of the largest angle of the machine that loses synchronism first; None if they fail.

    The sets of fleets with equal largest angle approach the boundary as the angle grows. Slightly inside the boundary,
    each size is raised by a few per cent of the fleet, or less if that fleet is not stable. One simulation per
    candidate, until shortly after the largest angle.
    """
    lost = _lost_first(trials, mw, k)
    for inside in INSIDE:
        base = trials.fleet(inside * mw)
        run = trials.peaks(base, k)
        if run.stable:
            break
    else:
        return None
    names = trials.point.rotor_names
    machine = names.index(lost) if lost in names else int(run.angle.argmax())
    until = run.time[machine] + AFTER

    def slope(i: int) -> float:
        if not trials.multiple(i, k):
            return 0.0
        step = STEP * base.sum()
        for _ in range(HALVINGS):
            tried = base.copy()
            tried[i] += step
            changed = trials.outcome(tried, k, until)
            if changed.stable:
                return (run.angle[machine] - changed.peak[machine]) / step
            step /= 2
        return np.nan

    return _scaled(np.array(trials.each(slope, range(len(mw)))), mw)


def _lost_first(trials: Trials, mw: np.ndarray, k: int) -> int | str | None:
    """The machine that loses synchronism first with a fleet just outside the boundary; None if none is found."""
    runs = (trials.outcome((1 - less) * mw, k) for less in OUTSIDE)
    return next((run.machine for run in runs if not run.stable), None)


def by_scaling(trials: Trials, mw: np.ndarray, k: int) -> np.ndarray | None:
    """Forward differences of 1/alpha_k, one bisection per candidate: the gradient by definition; None if they fail."""

    def inverse(tried: np.ndarray) -> float:
        survives = along(trials, tried, k)
        low, high = 0.8, 1.25
        while survives(low):
            low *= 0.8
            if low < 0.1:
                return np.nan
        while not survives(high):
            high *= 1.25
            if high > 10:
                return np.nan
        return 1 / bisect(survives, low, high, FINEST)

    step = 2 * STEP * mw.sum()
    here = inverse(mw)
    unit = np.eye(len(mw))
    slopes = trials.each(lambda i: (inverse(mw + step * unit[i]) - here) / step, range(len(mw)))
    return _scaled(np.array(slopes), mw)


def by_swept_angle(trials: Trials, mw: np.ndarray, k: int, J: np.ndarray) -> np.ndarray | None:
    """Equal-area gradient from one simulation: work of each MW on the advanced machines, from clearing to the peak.

    d_i = integral from clearing to the largest theta of order_i sum_j w_j J_ji d(theta), theta the angle of the
    advanced machines C relative to the others N, and w the shares of their one-machine equivalent with the inertia
    M = M_C + M_N: M_N / M on C, -M_C / M on N. C and N are on either side of the widest gap of the angles at the
    instant at which they are farthest apart.

    Parameters
    ----------
    trials : Trials
        The simulations.
    mw : (candidates,) array, MW
        A fleet slightly inside the boundary.
    k : int
        The contingency.
    J : (machines, candidates) array
        Power that a MW at a candidate takes from each machine.

    Returns
    -------
    (candidates,) array or None
        None if no MW helps.
    """
    run = trials.simulate(mw, k)
    H = trials.at(k).inertia
    change = run.arrays.swing
    first = int(np.argmax(run.time >= trials.disturbed(k) - 1e-9))
    widest = first + int(np.argmax(np.ptp(change[first:], axis=1)))
    ranked = np.argsort(change[widest])
    split = int(np.argmax(np.diff(change[widest][ranked]))) + 1
    C = np.zeros(len(H), bool)
    C[ranked[split:]] = True
    M_C, M_N = H[C].sum(), H[~C].sum()
    theta = change @ np.where(C, H / M_C, -H / M_N)
    peak = first + int(np.argmax(theta[first:]))
    shares = np.where(C, M_N, -M_C) / H.sum()
    order = run.arrays.order[:, len(trials.existing) :]
    multiples = np.array([trials.multiple(i, k) for i in range(len(mw))])
    work = multiples * (order[first:peak] * np.diff(theta)[first:peak, None]).sum(0)
    return _scaled(work * (shares @ J), mw)


def _scaled(d: np.ndarray, mw: np.ndarray) -> np.ndarray | None:
    whole = float(d @ mw)
    return d / whole if np.isfinite(d).all() and whole > 0 else None
