"""Initial fleets of the siting program: what is feasible, the smallest uniform fleet, the linear allocation."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, get_args

import numpy as np

from stabctl._util.errors import LinearizationError, StudyError

from ._allocation import Objective, allocate, gramians
from ._cutting_planes import CuttingPlanes, Master
from ._scaling import SCAN, along, critical_scaling, largest_scaling, least_scaling
from .contingencies import Scenario
from .site_options import Prices
from .siting import Infeasible
from .trials import Trials

BUDGET = 0.5  # of the uniform fleet, for the linear allocation
FINE = 1e-3  # relative width of the last scaling of the uniform fleet
PARTS = SCAN ** -np.arange(7.0)  # of a fleet: 1 to 0.26
SHOWN = 3  # contingencies that a message names


class BoundaryFleet(NamedTuple):
    """A fleet on the boundary of a contingency: `scaling` times `mw` (candidates, MW) just survives it."""

    mw: np.ndarray
    scaling: float


def feasible(trials: Trials, uniform: np.ndarray) -> tuple[Trials, list[BoundaryFleet], dict[Scenario, Infeasible]]:
    """The scenarios that some fleet survives, a boundary fleet of each, and the scenarios left out.

    The uniform fleet (candidates, MW) and each candidate alone are tried, from small sizes to the caps. Raises
    StudyError if no contingency is feasible.
    """
    found = trials.each(lambda k: _boundary(trials, [uniform, *np.diag(trials.cap / 4)], k))
    kept = [k for k, one in enumerate(found) if one is not None]
    infeasible = {trials.scenarios[k]: _infeasible(trials, k) for k, one in enumerate(found) if one is None}
    if not kept:
        listed = " ".join(map(str, list(infeasible.values())[:SHOWN]))
        more = len(infeasible) - SHOWN
        listed += f" The same holds for {more} more." if more > 0 else ""
        raise StudyError(
            f"No fleet within the caps survives any of the contingencies. {listed} Raise the caps or shorten the "
            "clearing times."
        )
    return trials.only(kept), [one for one in found if one is not None], infeasible


def _boundary(trials: Trials, fleets: Sequence[np.ndarray], k: int) -> BoundaryFleet | None:
    def scaling(mw: np.ndarray) -> float | None:
        most = largest_scaling(trials, mw)
        return critical_scaling(along(trials, mw, k), most) if most else None

    found = ((mw, scaling(mw)) for mw in fleets)
    return next((BoundaryFleet(mw, a) for mw, a in found if a is not None), None)


def _infeasible(trials: Trials, k: int) -> Infeasible:
    fleets = trials.fleets(k)
    without = trials.critical_time(np.zeros_like(trials.cap), k).cycles
    existing = len(trials.existing) > 0
    return Infeasible(trials.contingencies[k], trials.target(k), without, fleets, *trials.named(k), existing)


def uniform_fleet(search: CuttingPlanes, uniform: np.ndarray, boundary: Sequence[BoundaryFleet]) -> np.ndarray | None:
    """The smallest multiple of the uniform fleet (candidates, MW) that survives everything; None if none does.

    Adds cuts at the boundary fleets.
    """
    for k, one in enumerate(boundary):
        if one.scaling:
            search.cut(one.scaling * one.mw, k)
    largest = max(one.scaling for one in boundary)
    if not largest:
        return np.zeros_like(uniform)
    if any(one.mw is not uniform for one in boundary):
        return None
    scaled = least_scaling(search.trials, largest * uniform, FINE)
    return None if scaled is None else search.trials.fleet(scaled.scaling * largest * uniform)


def linear_fleet(search: CuttingPlanes, uniform: np.ndarray) -> np.ndarray | None:
    """The cheapest linear allocation, scaled until it survives everything; None if none does. Adds cuts there."""
    trials, out = search.trials, None
    candidates = [(s.machine, s.bus) for s in trials.point.case.storage[len(trials.existing) :]]
    budget = BUDGET * trials.fleet(uniform).sum()
    try:
        found = gramians(trials.point, candidates)
    except (StudyError, LinearizationError):
        return None
    for objective in get_args(Objective):
        try:
            mw = allocate(found, budget, trials.cap, objective).sizes
        except StudyError:
            continue
        fleet = _scaled_down(search, largest_scaling(trials, mw) * mw)
        if fleet is not None and (out is None or search.master.cost(fleet) < search.master.cost(out)):
            out = fleet
    return out


def single_fleets(search: CuttingPlanes) -> None:
    """Start from each candidate alone that survives everything at the cost so far or less. Adds cuts there.

    Nothing leads there from fleets at several sites where those between survive less.
    """
    for alone in np.diag(search.trials.cap):
        most = min(search.prices.affordable(alone, search.cost), 1.0)
        fleet = _scaled_down(search, most * alone)
        if fleet is not None and (whole := search.buildable(fleet)) is not None:
            search.accept(whole)


def _scaled_down(search: CuttingPlanes, mw: np.ndarray) -> np.ndarray | None:
    """The smallest multiple of a fleet (candidates, MW), at most itself, that survives everything. Adds cuts there.

    Survival is not monotone in size: from the first of some parts that survives. None if none does.
    """
    start = next((part * mw for part in PARTS if mw.any() and search.trials.all_survived(part * mw)), None)
    if start is None or (scaled := least_scaling(search.trials, start)) is None:
        return None
    search.cut_along(start, scaled)
    return search.trials.fleet(scaled.scaling * start)


def relaxed_fleets(search: CuttingPlanes) -> None:
    """Start from the fleet without costs of sites and MWh, limit and modules, and from its largest devices.

    Adds cuts there. Does nothing without a limit of sites and such costs: whole modules are found near the plans.
    """
    trials, master, prices = search.trials, search.master, search.prices
    if master.z is None and not prices.mwh.any():
        return
    none, per_mw = np.zeros(len(master.cap)), prices.per_mw(search.hours)
    relaxed = Master(master.cap, per_mw, none)
    free = replace(search, master=relaxed, prices=Prices(per_mw, none, none), best=None, cost=np.inf, history=[])
    for mw in list(search.survivors):
        free.accept(mw)
    free.approach()
    if free.best is None:
        return
    devices = [int(i) for i in np.argsort(-free.best) if free.best[i] > 0]
    for built in (devices[:n] for n in range(len(devices), 1, -1)):
        mw = np.where(np.isin(np.arange(len(none)), built), free.best, 0.0)
        mw *= free.best.sum() / mw.sum()
        most = prices.affordable(mw, search.cost)
        if not master.allows(mw) or (most < np.inf and not trials.all_survived(most * mw)):
            continue
        if (scaled := least_scaling(trials, mw)) is not None:
            search.cut_along(mw, scaled)
            if (fleet := search.buildable(scaled.scaling * mw)) is not None:
                search.accept(fleet)
