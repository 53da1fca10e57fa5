"""Margins of a closed loop: how much later, and with how much more or less gain, its controllers may act.

All of them together, by the eigenvalues of the closed loop, and each output alone, by its loop gain (`loop_margins`).
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from stabctl._util import cores
from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb
from stabctl.controllers.controller import Controller
from stabctl.controllers.law import Law
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.named import Named, all_named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from .characteristic import Characteristic, growing
from .closed_loop import joined
from .delayed_loop import DelayedLoop
from .eigen import GROWING
from .interconnection import plant_of
from .loop_margins import LoopMargins, single_loops

if TYPE_CHECKING:
    import pandas as pd

LATEST = 2.0  # s   largest delay that is tried
GAINS = (1e-3, 1e3)  # smallest and largest factor of the gains that is tried
STEPS = 2e-4, 0.02  # s   smallest and largest step of the delays that are tried
SLOW = 0.01  # s   delay margins beyond this are found to 0.01 ms, smaller ones to 0.1 %
BESIDE = 1e-3  # of a delay: where roots are counted on both sides of it
POINTS = 1500  # frequencies between which an eigenvalue of magnitude 1 is looked for, and
HALVINGS = 50  # of the distance between two of them
TURNS = 20  # of the eigenvalue by a delay, at most
LATER = 1.0  # s   added to all delays while a loop is taken apart, so that no output is without


@dataclass(frozen=True, repr=False)
class Margins(Tabular):
    """Margins of the controllers of a closed loop, changed together, and of its single loops.

    Attributes
    ----------
    delay
        Smallest further delay (s) with which the loop is unstable; inf if it is stable up to 2 s. Sampled controllers
        are delayed by whole frames of the slowest rate.
    gain_up, gain_down
        Factors of all gains at which the loop becomes unstable: the smallest above 1, and the largest below 1; inf and
        0 if there are none.
    loops
        Classical margins of the loop through each output, all others closed. None next to sampled controllers for the
        outputs of continuous ones, and none at all if there are several rates: the loop is not time-invariant then.
    hz, gain
        Frequencies (points), and the loop gains there with the sign of negative feedback (points, loops), complex.
    """

    delay: float
    gain_up: float
    gain_down: float
    loops: tuple[LoopMargins, ...] = ()
    hz: np.ndarray = field(default_factory=lambda: np.empty(0), compare=False)
    gain: np.ndarray = field(default_factory=lambda: np.empty((0, 0), complex), compare=False)

    plot = verb("stabctl.plotting.margins:plot")

    @property
    def df(self) -> "pd.DataFrame":
        """One row per output: gain margins as factors, phase margin (deg), delay margin (s), disk margin."""
        import pandas as pd

        return pd.DataFrame([asdict(loop) for loop in self.loops], columns=list(LoopMargins.__dataclass_fields__))

    def __str__(self) -> str:
        return "\n".join([self.together, *(f"  {loop}" for loop in self.loops)])

    def _head(self) -> str:
        return self.together

    @property
    def together(self) -> str:
        """What all controllers together may change, as a sentence."""
        late = "any delay up to 2 s" if np.isinf(self.delay) else f"less than {1e3 * self.delay:.4g} ms more delay"
        return f"stable with {late}, and with {self.gain_down:.3g} to {self.gain_up:.3g} times the gains"


def margins(base: Case | OperatingPoint, *controllers: Controller | Law, storage: "Fleet | None" = None) -> Margins:
    """Delay and gain margins of a closed loop, and the classical margins of its single loops.

    As in `closed_loop`, deadbands and relays give nothing, limits do not act, and gates are open.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    *controllers : Controller or Law
        The controllers, with which it must be stable; no Python functions. A law of storage devices acts as its
        `controllers`.
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
    own = all_named(point, controllers)
    with cores.one_thread():
        return _found(point, own)


def _found(point: OperatingPoint, own: list[Named]) -> Margins:
    acting = [n for n in own if n.controller.linear]
    plant = plant_of(point, acting)
    poles = joined(plant, acting).eigenvalues()
    if poles.real.max() > GROWING:
        raise StudyError(f"The closed loop of {point.case.name} is unstable, so it has no margins.")
    if not acting:
        return Margins(np.inf, np.inf, 0.0, *single_loops(point, own, poles))
    rates = [n.controller.rate for n in acting if n.controller.rate]
    f = None if rates else DelayedLoop.of(plant, acting).characteristic(joined(plant, acting).rotation(), LATER)

    def stable(gain: float, more: float) -> bool:
        """Whether no mode of the closed loop grows with a factor of all gains and more delay (s)."""
        delays = [n.controller.delay + more for n in acting]
        if f and all(delays):
            return growing(f.later(more - LATER).scaled(gain)) == 0
        changed = [n.controller.scaled(gain) for n in acting]
        every = [replace(n, controller=c.delayed(d)) for n, c, d in zip(acting, changed, delays, strict=True)]
        return bool(joined(plant, every).eigenvalues().real.max() <= GROWING)

    up = _edge(np.geomspace(1.0, GAINS[1], 61).tolist(), lambda gain: stable(gain, 0.0)) or np.inf
    down = _edge(np.geomspace(1.0, GAINS[0], 61).tolist(), lambda gain: stable(gain, 0.0)) or 0.0
    fast = f.later(-LATER).scaled(min(up, GAINS[1])).bound() / (2 * np.pi) if f else 0.0
    loops = single_loops(point, own, poles, fast)
    if rates:
        return Margins(_first(1 / min(rates), lambda more: stable(1.0, more)), up, down, *loops)
    assert f is not None  # without rates
    now = f.later(-LATER)
    bound = now.bound()
    late = _delay(now, bound, lambda more: stable(1.0, more)) if np.isfinite(bound) else 0.0
    return Margins(late, up, down, *loops)


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


def _first(step: float, good: Callable[[float], bool]) -> float:
    """The first multiple of a step with which the loop is unstable; stability is not monotone in the delay."""
    for k in range(1, int(LATEST / step) + 1):
        if not good(k * step):
            return k * step
    return float("inf")


def _delay(f: Characteristic, bound: float, good: Callable[[float], bool]) -> float:
    """Smallest further delay with which the loop is unstable.

    With the same further delay T in all loops, a root is at j w if exp(-j w T) l = 1 for an eigenvalue l of E H(j w),
    that is where |l| = 1, whatever the delay is. The first such delay beyond which roots grow is confirmed by counts
    beside it; if they do not confirm it, delays are tried one after the other.
    """
    for T in sorted(T for w, turn in _crossings(f, bound) for T in _delays(w, turn)):
        if not good((1 + BESIDE) * T):
            if good((1 - BESIDE) * T):
                return T
            break
    step = float(np.clip(1 / bound, *STEPS))
    high = _first(step, good)
    if np.isinf(high):
        return high
    low = high - step
    while high - low > 1e-5 * min(1, high / SLOW):
        middle = (low + high) / 2
        low, high = (middle, high) if good(middle) else (low, middle)
    return high


def _delays(w: float, turn: float) -> list[float]:
    """The delays (s) after which an eigenvalue at the frequency w (rad/s), of this angle (rad), is 1."""
    first = turn % (2 * np.pi) / w
    return [T for k in range(TURNS) if 0 < (T := first + 2 * np.pi * k / w) <= LATEST]


def _crossings(f: Characteristic, bound: float) -> list[tuple[float, float]]:
    """Frequencies (rad/s) at which an eigenvalue of E H(j w) has magnitude 1, and its angle (rad)."""
    near = np.abs(f.poles.imag)[:, None] + np.abs(f.poles.real)[:, None] * np.linspace(-3, 3, 7)
    w = np.unique(np.concatenate([np.geomspace(1e-2, bound, POINTS), near[(near > 1e-2) & (near < bound)]]))
    sizes = np.sort(np.abs(_loci(f, w)), axis=1)
    at, which = np.nonzero((sizes[:-1] > 1) != (sizes[1:] > 1))
    low, high, above = w[at], w[at + 1], sizes[at + 1, which] > 1
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        up = np.sort(np.abs(_loci(f, middle)), axis=1)[np.arange(len(at)), which] > 1
        low, high = np.where(up == above, low, middle), np.where(up == above, middle, high)
    found = _loci(f, high)
    of = np.argsort(np.abs(found), axis=1)[np.arange(len(at)), which]
    return list(zip(high.tolist(), np.angle(found[np.arange(len(at)), of]).tolist(), strict=True))


def _loci(f: Characteristic, w: np.ndarray) -> np.ndarray:
    """Eigenvalues (frequencies, channels) of E H(j w)."""
    found = [np.zeros((0, len(f.delays)), complex)]
    for part in np.array_split(1j * w, -(-len(w) // 200) or 1):
        H = f.D + (f.c / (part[:, None] - f.poles)[:, None, :]) @ f.b
        found.append(np.linalg.eigvals(np.exp(-part[:, None] * f.delays)[:, :, None] * H))
    return np.concatenate(found)
