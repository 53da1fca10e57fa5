"""Gradients of the boundary of survival: how much a megawatt at each candidate helps to survive a contingency.

A gradient d (candidates, 1/MW) at a fleet s on the boundary is scaled to d . s = 1, so that its cut is d . s' >= 1.
"""

import numpy as np

from .scaling import COARSE, FINE, along, bisect
from .trials import Trials

INSIDE = (1.04, 1.08, 1.16, 1.02)  # multiples of the boundary fleet at which nearby fleets are simulated
OUTSIDE = (2 * FINE, COARSE, 2 * COARSE)  # parts of the boundary fleet left out to see what is lost
STEP = 0.03  # first change of one size, relative to the whole fleet
HALVINGS = 8
AFTER = 0.25  # s   simulated beyond the instant of the largest angle


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


def by_scaling(trials: Trials, mw: np.ndarray, k: int, fine: float = 1e-4) -> np.ndarray | None:
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
        return 1 / bisect(survives, low, high, fine)

    step = 2 * STEP * mw.sum()
    here = inverse(mw)
    unit = np.eye(len(mw))
    slopes = trials.each(lambda i: (inverse(mw + step * unit[i]) - here) / step, range(len(mw)))
    return _scaled(np.array(slopes), mw)


def by_swept_angle(trials: Trials, mw: np.ndarray, k: int, J: np.ndarray) -> np.ndarray | None:
    """Equal-area gradient from one simulation: work of each MW on the advanced machines, from clearing to the peak.

    d_i = integral from clearing to the first peak of sgn_i gate_i sum_j w_j J_ji d(theta), theta the angle of the
    advanced machines C relative to the others N, w the shares of their one-machine equivalent: M_N / M on C, -M_C / M
    on N.

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
