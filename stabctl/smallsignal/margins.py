"""Margins of a closed loop: how much later, and with how much more or less gain, its controllers may act."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stabctl.controllers.controller import Controller
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.named import named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from .closed_loop import joined
from .interconnection import plant_of

LATEST = 2.0  # s   largest delay that is tried
GAINS = (1e-3, 1e3)  # smallest and largest factor of the gains that is tried
GROWING = 1e-6  # 1/s   real part of an eigenvalue from which the loop counts as unstable


@dataclass(frozen=True)
class Margins:
    """Margins of the controllers of a closed loop, changed together.

    Attributes
    ----------
    delay
        Smallest further delay (s) with which the loop is unstable; inf if it is stable up to 2 s. Sampled controllers
        are delayed by whole frames of the slowest rate.
    gain_up, gain_down
        Factors of all gains at which the loop becomes unstable: the smallest above 1, and the largest below 1; inf and
        0 if there are none.
    """

    delay: float
    gain_up: float
    gain_down: float

    def __str__(self) -> str:
        late = "any delay up to 2 s" if np.isinf(self.delay) else f"less than {1e3 * self.delay:.4g} ms more delay"
        return f"stable with {late}, and with {self.gain_down:.3g} to {self.gain_up:.3g} times the gains"


def margins(base: Case | OperatingPoint, *controllers: Controller, storage: "Fleet | None" = None) -> Margins:
    """Delay and gain margins of a closed loop.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    *controllers : Controller
        The controllers, which must stabilize it; no Python functions.
    storage : str, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.

    Returns
    -------
    Margins

    Raises
    ------
    StudyError
        If the loop is unstable as it is.
    """
    point = operating_point(base, storage)
    own = [named(point, c) for c in controllers]
    plant = plant_of(point, own)

    def stable(changed: Sequence[Controller]) -> bool:
        """Whether no mode of the closed loop with changed controllers grows."""
        loop = joined(plant, [replace(n, controller=c) for n, c in zip(own, changed, strict=True)])
        return bool(loop.eigenvalues().real.max() <= GROWING)

    def gained(gain: float) -> bool:
        return stable([c.scaled(gain) for c in controllers])

    if not stable(controllers):
        raise StudyError(f"The closed loop of {point.case.name} is unstable, so it has no margins.")
    up = _edge(np.geomspace(1.0, GAINS[1], 61).tolist(), gained)
    down = _edge(np.geomspace(1.0, GAINS[0], 61).tolist(), gained)
    return Margins(_delay(controllers, stable), up or np.inf, down or 0.0)


def _edge(gains: Sequence[float], good: Callable[[float], bool]) -> float | None:
    """The first gain at which the loop is unstable, to 0.01 %; None if there is none."""
    low = gains[0]
    for gain in gains[1:]:
        if not good(gain):
            high = gain
            while abs(high / low - 1) > 1e-4:
                middle = float(np.sqrt(low * high))
                low, high = (middle, high) if good(middle) else (low, middle)
            return float(high)
        low = gain
    return None


def _delay(controllers: Sequence[Controller], stable: Callable[[Sequence[Controller]], bool]) -> float:
    """Smallest further delay with which the loop is unstable; stability is not monotone in it."""
    rates = [c.rate for c in controllers if c.rate]
    step = 1 / min(rates) if rates else 0.02
    for k in range(1, int(LATEST / step) + 1):
        if not stable([replace(c, delay=c.delay + k * step) for c in controllers]):
            if rates:
                return k * step
            low, high = (k - 1) * step, k * step
            while high - low > 1e-5:
                middle = (low + high) / 2
                good = stable([replace(c, delay=c.delay + middle) for c in controllers])
                low, high = (middle, high) if good else (low, middle)
            return high
    return float("inf")
