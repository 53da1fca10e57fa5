"""Evidence: clearing times of a fleet and its variants, and how far the contingencies use its converters.

Clearing times are critical by the criterion of `clearing_time`.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from stabctl.dynamics.storage import current_limits
from stabctl.model import fleet
from stabctl.model.tables import Storage
from stabctl.simulation.control import Control, Sampled

from ._simulated import CriticalTime
from .contingencies import scaled
from .siting import Evidence
from .siting_rows import label
from .trials import Trials

MARGINS = 1.0, 1.02, 1.03, 1.05, 1.1  # multiples of the fleet tried in refined simulations and with other controllers
DIGITS = 3  # of a current of a converter; those that agree to so many are the same


def table(
    trials: Trials, mw: np.ndarray, found: Sequence[CriticalTime], controls: Mapping[str, Sampled], tolerance: float
) -> tuple[Evidence, ...]:
    """The fleet, 0.9 of it, with each site removed, smaller or larger, longer and refined, under other controllers.

    If the fleet does not survive longer or refined simulations or another controller, the first of `MARGINS` that does
    is shown too, or the last one if none does. Where caps lessen it, its scale is the multiple of the MW that is left;
    where they leave the fleet itself, there is none.

    Parameters
    ----------
    trials : Trials
        The simulations.
    mw : (candidates,) array, MW
        The fleet.
    found : sequence of CriticalTime
        Critical clearing times with the fleet.
    controls : mapping
        Other controllers by name.
    tolerance : float
        Share by which each site alone is smaller or larger; such fleets are simulated at the targets only.
    """
    rows = [_row(mw, found), _row(0.9 * mw, critical_times(trials, 0.9 * mw), scale=0.9)]
    built = [int(i) for i in np.argsort(-mw) if mw[i] > 0]
    for i in built:
        rest = np.where(np.arange(len(mw)) == i, 0.0, mw)
        rows.append(_row(rest, critical_times(trials, rest), without=trials.site(i)))
    rows += [_scaled(trials, mw, i, multiple) for i in built for multiple in (1 - tolerance, 1 + tolerance)]
    larger = {_multiple(sized, mw, m): sized for m in MARGINS for sized in (trials.fleet(m * mw),)}
    longer, refined, last = trials.longer(), trials.refined(), max(larger)
    enough = _enough(longer, larger)
    rows += [_at_targets(longer, larger[m], scale=m, longer=True) for m in dict.fromkeys((1.0, enough))]
    enough = _enough(refined, larger)
    if enough != 1:
        rows.append(_at_targets(refined, mw, refined=True))
    rows.append(_row(larger[enough], critical_times(refined, larger[enough]), scale=enough, refined=True))
    for name, control in controls.items():
        for scale, sized in larger.items():
            row = _row(sized, critical_times(trials, sized, control), scale=scale, control=name)
            if scale in (1, last) or not row.lost:
                rows.append(row)
            if not row.lost:
                break
    return tuple(rows)


def _enough(trials: Trials, larger: Mapping[float, np.ndarray]) -> float:
    """The first multiple of a fleet whose MW (candidates) survive everything; if none does, the last."""
    return next((scale for scale, sized in larger.items() if trials.all_survived(sized)), max(larger))


def critical_times(trials: Trials, mw: np.ndarray, control: Control = None) -> list[CriticalTime]:
    """The critical clearing time of every scenario with a fleet (candidates, MW)."""
    return trials.each(lambda k: trials.critical_time(mw, k, control))


def _scaled(trials: Trials, mw: np.ndarray, i: int, multiple: float) -> Evidence:
    """The fleet (candidates, MW) with another size at candidate i, also above its cap, simulated at the targets."""
    changed = trials.among(scaled(trials.scenarios, len(trials.existing) + i, multiple))
    found = _at_targets(changed, mw, scale=multiple, site=trials.site(i))
    return found._replace(mw=float(mw.sum() + (multiple - 1) * mw[i]))


def _at_targets(trials: Trials, mw: np.ndarray, **variant: Any) -> Evidence:
    """A fleet (candidates, MW) simulated at the targets only."""
    lost = trials.lost(mw)
    return Evidence(float(mw.sum()), (), tuple(k not in lost for k in range(len(trials.scenarios))), **variant)


def _multiple(fleet: np.ndarray, mw: np.ndarray, asked: float) -> float:
    """How many times the MW of a fleet another one has that is a multiple of it within the caps."""
    if not (fleet > mw).any():
        return 1.0
    return float(fleet.sum() / mw.sum()) if (fleet < asked * mw).any() else asked


def _row(mw: np.ndarray, found: Sequence[CriticalTime], **variant: Any) -> Evidence:
    return Evidence(float(mw.sum()), tuple(c.cycles for c in found), tuple(c.stable for c in found), **variant)


def energies(trials: Trials, mw: np.ndarray) -> np.ndarray:
    """Energy capacity (candidates, MWh) that every device needs: the largest range of its charge in any contingency."""
    return np.max(trials.each(lambda k: trials.energy(mw, k)), axis=0)


def devices(trials: Trials, mw: np.ndarray) -> list[Storage]:
    """The devices of a fleet (candidates, MW), with MVA in the proportion to the MW that they were given."""
    rows = trials.point.case.storage[len(trials.existing) :]
    return [fleet.resized(row, float(size)) for row, size in zip(rows, mw, strict=True)]


class Used(NamedTuple):
    """The largest current of a converter in any contingency."""

    current: float  # pu on its MVA
    limit: float  # pu on its MVA
    voltage: float  # pu   of its bus at that current, the lowest if several
    worst: str  # the contingency


def used(trials: Trials, mw: np.ndarray) -> list[Used | None]:
    """How far the contingencies use the converters of a fleet (candidates, MW); None for ideal devices."""
    limits = current_limits(trials.point.system, trials.point.case)[len(trials.existing) :]
    if np.isinf(limits).all():
        return [None] * len(mw)
    every = trials.each(lambda k: trials.currents(mw, k))
    return [None if np.isinf(limit) else _worst(trials, every, i, float(limit)) for i, limit in enumerate(limits)]


def _worst(trials: Trials, every: Sequence[np.ndarray], i: int, limit: float) -> Used:
    """The largest current of candidate i, in service; of equal ones that at the lowest voltage."""
    k = min(
        (k for k in range(len(every)) if trials.multiple(i, k)),
        key=lambda k: (-round(every[k][0, i], DIGITS), every[k][1, i]),
    )
    current, voltage = map(float, every[k][:, i])
    return Used(current, limit, voltage, label(trials.contingencies[k], *trials.named(k)))
