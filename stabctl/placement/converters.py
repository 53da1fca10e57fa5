"""How far the contingencies use the converters of a fleet, and what sets their MVA."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stabctl.dynamics.storage import current_limits
from stabctl.model import fleet

from .siting_rows import label
from .trials import Trials

DIGITS = 3  # of a current; those that agree to so many are the same


class Used(NamedTuple):
    """The largest current of a converter in any contingency."""

    current: float  # pu on its MVA
    limit: float  # pu on its MVA
    voltage: float  # pu   of its bus at that current, the lowest if several
    worst: str  # the contingency


def mva(trials: Trials, mw: np.ndarray) -> np.ndarray:
    """MVA (candidates) of a fleet (candidates, MW): in the proportion to the MW that the devices were given."""
    rows = trials.point.case.storage[len(trials.existing) :]
    sized = (fleet.resized(row, float(size)) for row, size in zip(rows, mw, strict=True))
    return np.array([row.mva or row.rating for row in sized])


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
