"""Fleets whose sizes have a tolerance: any one device alone may be a little smaller or larger.

Survival is not monotone in the size of one device. Every scenario is therefore simulated with every device smaller and
larger; those that are lost become scenarios of the search.
"""

import numpy as np

from stabctl import units
from stabctl.errors import StudyError, shown

from .cutting_planes import CuttingPlanes
from .scenario import scaled
from .siting_rows import label
from .trials import Trials

USUAL = 0.1  # of a size, in the evidence of every fleet


def share(tolerance: str | float | None) -> float | None:
    """A tolerance of sizes as a share: "10%" or 0.1; None for none. Raises `StudyError`."""
    if tolerance is None:
        return None
    value = units.quantity(tolerance, "-")
    if not 0 < value < 1:
        raise StudyError(f"The tolerance {shown(tolerance)} is not allowed; give a share of a size, such as 10%.")
    return value


def lost(trials: Trials, mw: np.ndarray, tolerance: float) -> Trials:
    """The scenarios with any one device of a fleet (candidates, MW) smaller or larger that it does not survive."""
    built = [len(trials.existing) + int(i) for i in np.flatnonzero(mw)]
    multiples = 1 - tolerance, 1 + tolerance
    every = trials.among(one for row in built for a in multiples for one in scaled(trials.scenarios, row, a))
    return every.only(every.lost(mw))


def hold(planes: CuttingPlanes, tolerance: float) -> None:
    """Search again with what the best fleet does not survive within the tolerance, until nothing is left.

    Each search adds at least one of finitely many scenarios. Raises `StudyError` if one finds no fleet.
    """
    given, best = planes.trials, planes.best
    while planes.best is not None and (missing := lost(given, planes.best, tolerance)).scenarios:
        best, left = planes.best, missing
        planes.require(missing.scenarios)
        planes.run()
    if best is not None and planes.best is None:
        raise StudyError(
            f"No fleet within the caps was found that survives every contingency also with any one site "
            f"{100 * tolerance:g} % smaller or larger. The last one, {best.sum():.1f} MW, loses {_named(left, 0)}. "
            "Raise the caps or the number of sites, shorten the clearing times, or reduce the tolerance."
        )


def _named(trials: Trials, k: int) -> str:
    """Scenario k with the device that has another size."""
    one = trials.scenarios[k]
    row, multiple = one.scaled or (0, 1.0)
    size = f"{trials.site(row - len(trials.existing))} x{multiple:g}"
    return f"{label(one.contingency, *trials.named(k))} with {size}"
