"""What the program begins with: what is curable at all, the smallest uniform fleet, that of the linear stage."""

from collections.abc import Sequence
from typing import NamedTuple, get_args

import numpy as np

from stabctl.errors import StudyError

from .allocation import Criterion, allocate
from .evidence import critical
from .gramians import gramians
from .program import Search
from .scaling import critical_scaling, least, reach
from .siting import Incurable
from .trials import Trials

BUDGET = 0.5  # of the uniform fleet, for the linear stage to share out


class Cure(NamedTuple):
    """A fleet on the border of a contingency: `scaling` times `mw` (candidates, MW) just survives it."""

    mw: np.ndarray
    scaling: float


def curable(trials: Trials, uniform: np.ndarray) -> tuple[Trials, list[Cure], tuple[Incurable, ...]]:
    """The trials without what no fleet survives; a cure of each of the others; what is left out.

    Tried are the uniform fleet (candidates, MW) and each candidate alone, from small to the caps. `StudyError` where
    nothing is curable.
    """
    alone = [np.where(np.arange(len(uniform)) == i, trials.cap / 4, 0.0) for i in range(len(uniform))]
    cures = trials.each(lambda k: _cure(trials, [uniform, *alone], k))
    kept = [k for k, cured in enumerate(cures) if cured is not None]
    incurable = tuple(_incurable(trials, k) for k in range(len(cures)) if cures[k] is None)
    if not kept:
        found = " ".join(map(str, incurable))
        raise StudyError(
            f"No contingency is survived by any fleet within the caps: {found} Raise the caps or ask for less."
        )
    return trials.only(kept), [cures[k] for k in kept], incurable


def _cure(trials: Trials, fleets: Sequence[np.ndarray], k: int) -> Cure | None:
    def scaling(mw: np.ndarray) -> float | None:
        most = reach(trials, mw)
        return critical_scaling(lambda a: trials.survives(a * mw, k), most) if most else None

    found = ((mw, scaling(mw)) for mw in fleets)
    return next((Cure(mw, a) for mw, a in found if a is not None), None)


def _incurable(trials: Trials, k: int) -> Incurable:
    one = trials.contingencies[k]
    fleets = trials.fleets(k)
    without = critical(trials, np.zeros_like(trials.cap), k).cycles
    return Incurable(one, one.clear * trials.point.case.frequency_hz, without, fleets)


def uniform_fleet(search: Search, uniform: np.ndarray, cures: Sequence[Cure]) -> np.ndarray | None:
    """Cuts at the cures; the smallest multiple of the uniform fleet (candidates, MW) that survives all, or None."""
    for k, cure in enumerate(cures):
        if cure.scaling:
            search.cut(cure.scaling * cure.mw, k)
    largest = max(cure.scaling for cure in cures)
    if not largest:
        return np.zeros_like(uniform)
    if any(cure.mw is not uniform for cure in cures):
        return None
    scaled = least(search.trials, largest * uniform)
    return None if scaled is None else search.trials.fleet(scaled.scaling * largest * uniform)


def linear_fleet(search: Search, uniform: np.ndarray) -> np.ndarray | None:
    """The cheapest allocation of the linear stage, scaled until it survives all, with cuts there, or None."""
    trials, out = search.trials, None
    places = [(s.machine, s.bus) for s in trials.point.case.storage]
    budget = BUDGET * trials.fleet(uniform).sum()
    try:
        swings = gramians(trials.point, places)
    except StudyError:
        return None
    for criterion in get_args(Criterion):
        try:
            mw = allocate(swings, budget, trials.cap, criterion).sizes
        except StudyError:
            continue
        scaled = least(trials, mw)
        if scaled:
            search.cut_near(mw, scaled)
            fleet = trials.fleet(scaled.scaling * mw)
            out = fleet if out is None or search.master.cost(fleet) < search.master.cost(out) else out
    return out
