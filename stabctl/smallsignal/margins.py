"""Margins of a closed loop: delay and gain of all controllers together, and classical margins of its single loops.

Those of all controllers together follow from the eigenvalues of the closed loop. Those of a single loop, with one
output opened and all others closed, follow from its loop gain L(jw), sign of negative feedback. The loop is unstable
where (1 + L) turns to zero:

    gain margins     k = 1 / |L| where L < 0: the smallest above 1 and the largest below
    phase margin     smallest angle of -L where |L| = 1
    delay margin     smallest angle of -L, from 0 to 360 deg, over w where |L| = 1; 0 if |L| >= 1 for w = inf
    disk margin      smallest 2 |1 + L| / |1 - L|: gain and phase may change together inside a disk

The disk margin a is the symmetric one, 1 / max |S - T| / 2: gains from (2 - a)/(2 + a) to (2 + a)/(2 - a) or phases up
to 2 atan(a/2) leave the loop stable.

Source: P. Seiler, A. Packard, P. Gahinet, An introduction to disk margins, IEEE Control Systems Magazine 40, 2020.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from stabctl._util import process
from stabctl._util.errors import StudyError
from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb
from stabctl.controllers.controller import Controller
from stabctl.controllers.law import Law
from stabctl.dynamics.named import Named, all_named
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from ._characteristic import Characteristic, growing
from .closed_loop import joined
from .delayed_loop import DelayedLoop
from .eigen import GROWING
from .interconnection import common_period, plant_of
from .model import grid, resonances
from .opened_loop import alone, linear_loop

if TYPE_CHECKING:
    import pandas as pd


# all controllers together
LATEST = 2.0  # s   largest delay that is tried
GAINS = (1e-3, 1e3)  # smallest and largest factor of the gains that is tried
LEAST = 1e-9  # s   difference of delays that is told apart
STEPS = 2e-4, 0.02  # s   smallest and largest step of the delays that are tried
SLOW = 0.01  # s   delay margins beyond this are found to 0.01 ms, smaller ones to 0.1 %
BESIDE = 1e-3  # of a delay: where roots are counted on both sides of it
POINTS = 1500  # frequencies between which an eigenvalue of magnitude 1 is looked for, and
HALVINGS = 50  # of the distance between two of them
TURNS = 20  # of the eigenvalue by a delay, at most
LATER = 1.0  # s   added to all delays while a loop is taken apart, so that no output is without

# single loops
BAND = (1e-3, 100.0)  # Hz   sampled loops: to half of the rate
FASTEST = 1e4  # Hz
LARGEST = 1e3  # largest factor of a gain that is reported, and its inverse the smallest
REST, FAST = 1e-4, 1e9  # 1/s   real s at which L stands for that at rest, and at infinite frequency
AROUND = np.tan(np.linspace(-1.2, 1.2, 7))  # points around each resonance, in widths
TURN = 0.3  # rad   largest turn of L or 1 + L between two frequencies
ROUNDS = 12  # of halving the intervals that turn more


@dataclass(frozen=True)
class LoopMargins:
    """Margins of the loop through one output, all others closed; frequencies in Hz, nan where there is no margin.

    Attributes
    ----------
    name
        Controller and input that it drives: "pod: order:1@5".
    gain_up, gain_up_hz
        Smallest factor above 1 of this output at which the loop becomes unstable, and the frequency that it then has;
        inf if there is none up to 1000.
    gain_down, gain_down_hz
        Largest factor below 1; 0 if there is none.
    phase_deg, phase_hz
        Phase margin, and the gain crossover where it is; inf if the gain is never 1.
    delay, delay_hz
        Delay margin (s), of sampled controllers too as if it could be any part of a frame, and its gain crossover.
    disk, disk_hz
        Symmetric disk margin; 2 without a loop gain, and at most if it is continuous.
    distance, distance_hz
        Least distance of L(jw) from -1, 1 / max |S|: the smallest change of L that makes the loop unstable.
    """

    name: str
    gain_up: float
    gain_up_hz: float
    gain_down: float
    gain_down_hz: float
    phase_deg: float
    phase_hz: float
    delay: float
    delay_hz: float
    disk: float
    disk_hz: float
    distance: float
    distance_hz: float

    @property
    def disk_gain(self) -> float:
        """Factor by which the gain may rise or fall inside the disk."""
        return (2 + self.disk) / (2 - self.disk) if self.disk < 2 else np.inf

    @property
    def disk_phase_deg(self) -> float:
        """Angle (deg) by which the phase may change inside the disk."""
        return float(np.rad2deg(2 * np.arctan(self.disk / 2)))

    def __str__(self) -> str:
        down, up = _decibels(self.gain_down, self.gain_down_hz), _decibels(self.gain_up, self.gain_up_hz)
        if np.isinf(self.phase_deg):
            phase = "any phase and delay"
        else:
            phase = f"phase {self.phase_deg:.1f} deg ({self.phase_hz:.3g} Hz), delay {1e3 * self.delay:.4g} ms"
        return f"{self.name}: gain {down} to {up}, {phase}, disk {self.disk:.3g}"


def _decibels(gain: float, hz: float) -> str:
    if gain == 0 or np.isinf(gain):
        return "0" if gain == 0 else "any"
    return f"{gain:.3g} ({20 * np.log10(gain):.1f} dB, {hz:.3g} Hz)"


@dataclass(frozen=True, repr=False)
class Margins(Tabular):
    """Margins of the controllers of a closed loop, changed together, and of its single loops.

    Attributes
    ----------
    delay
        Smallest further delay (s) with which the loop is unstable; inf if it is stable up to 2 s. Sampled controllers
        are delayed by whole common periods of their frames.
    gain_up, gain_down
        Factors of all gains at which the loop becomes unstable: the smallest above 1, and the largest below 1; inf and
        0 if there are none.
    loops
        Classical margins of the loop through each output, all others closed. None next to sampled controllers for the
        outputs of continuous ones, and none at all if there are several rates: the loop is not time-invariant then.
    hz, gain
        Frequencies (points), and the loop gains there with the sign of negative feedback (points, loops), complex.

    Examples
    --------
    >>> found = st.load("two_area").margins(st.Feedback(10.0), storage="1=50MW")
    >>> round(found.delay, 4), found.gain_up, found.gain_down
    (0.0127, inf, 0.0)
    """

    delay: float
    gain_up: float
    gain_down: float
    loops: tuple[LoopMargins, ...] = ()
    hz: np.ndarray = field(default_factory=lambda: np.empty(0), compare=False)
    gain: np.ndarray = field(default_factory=lambda: np.empty((0, 0), complex), compare=False)

    plot = verb("stabctl.view.figures.bode:plot_margins")

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
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.

    Returns
    -------
    Margins

    Raises
    ------
    StudyError
        If the loop is unstable as it is.

    Examples
    --------
    >>> print(st.load("two_area").margins(st.Feedback(10.0), storage="1=50MW"))
    stable with less than 12.73 ms more delay, and with 0 to inf times the gains
      law 1@5: order:1@5: gain 0 to any, phase 90.9 deg (19.8 Hz), delay 12.73 ms, disk 2
    """
    point = operating_point(base, storage)
    own = all_named(point, controllers)
    if (law := next((n for n in own if n.controller.law), None)) is not None:
        raise StudyError(
            f"{law.controller.name} is a Python function; margins need matrices; closed_loop(...).modes() takes one."
        )
    with process.one_thread():
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
        return Margins(_first(float(common_period(rates)), lambda more: stable(1.0, more)), up, down, *loops)
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
    while high - low > max(1e-5 * min(1, high / SLOW), LEAST):
        middle = (low + high) / 2
        low, high = (middle, high) if good(middle) else (low, middle)
    return high


def _crossings(f: Characteristic, bound: float) -> list[tuple[float, float]]:
    """Frequencies (rad/s) at which an eigenvalue of E H(j w) has magnitude 1, and its angle (rad)."""
    near = resonances(f.poles, np.linspace(-3, 3, 7))
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


def _delays(w: float, turn: float) -> list[float]:
    """The delays (s) after which an eigenvalue at the frequency w (rad/s), of this angle (rad), is 1."""
    first = turn % (2 * np.pi) / w
    return [T for k in range(TURNS) if 0 < (T := first + 2 * np.pi * k / w) <= LATEST]


# The single loops.


class Loops(NamedTuple):
    """The single loops: margins, frequencies (points) in Hz, and L there (points, loops)."""

    margins: tuple[LoopMargins, ...]
    hz: np.ndarray
    gain: np.ndarray


def single_loops(point: OperatingPoint, own: Sequence[Named], poles: np.ndarray, fast: float = 0.0) -> Loops:
    """The loops through each output of `linear_loop`; `poles` (1/s) are those of the closed loop.

    Beyond a frequency `fast` (Hz) the loop gains are too small for margins.
    """
    loop = linear_loop(point, own)
    if loop is None:
        return Loops((), np.empty(0), np.empty((0, 0), complex))
    gains = np.concatenate([c.gains for c in own if c.controller.rate or not loop.rate])
    low, high = BAND[0], loop.rate / 2 if loop.rate else float(np.clip(fast, BAND[1], FASTEST))

    def given(s: complex) -> np.ndarray:
        """L(s) of every output."""
        G = loop(s)[0][None]
        return np.array([-gain * alone(G, gains, r)[0] for r, gain in enumerate(gains)])

    hz = grid(poles[np.abs(poles.real) < poles.imag], low, high, AROUND)
    L = np.array([given(2j * np.pi * f) for f in hz])
    hz, L = _refined(lambda f: given(2j * np.pi * f), hz, L)
    ends = {0.0: given(REST + 0j)}
    ends |= {high: given(2j * np.pi * high)} if loop.rate else {np.inf: given(FAST + 0j)}
    found = tuple(
        _margins(
            name,
            lambda f, r=r: complex(given(2j * np.pi * f)[r]),  # type: ignore[misc]
            hz,
            L[:, r],
            {f: float(value[r].real) for f, value in ends.items()},
        )
        for r, name in enumerate(loop.names)
    )
    return Loops(found, hz, L)


def _refined(given: Callable[[float], np.ndarray], hz: np.ndarray, L: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (Hz) and L (frequencies, outputs) with points between those where L or 1 + L turns much."""
    for _ in range(ROUNDS):
        small = np.maximum(np.abs(L[1:]), np.abs(L[:-1])) < 1 / LARGEST
        turns = [np.where(small, 0, np.abs(np.angle(x[1:] * x[:-1].conj()))) for x in (L, 1 + L)]
        wide = np.flatnonzero((np.maximum(*turns) > TURN).any(axis=1))
        if not len(wide):
            break
        new = (hz[wide] + hz[wide + 1]) / 2
        hz = np.insert(hz, wide + 1, new)
        L = np.insert(L, wide + 1, np.array([given(f) for f in new]), axis=0)
    return hz, L


def _margins(
    name: str, given: Callable[[float], complex], hz: np.ndarray, L: np.ndarray, ends: dict[float, float]
) -> LoopMargins:
    """The record of one loop gain; `ends` are the frequencies (Hz) where it is real anyway, and its values."""
    factors = [(-1 / value, f) for f, value in ends.items() if value < 0]
    for f in _zeros(lambda f: given(f).imag, hz, L.imag):
        value = given(f).real
        if value < 0:
            factors.append((-1 / value, f))
    factors = [(k, f) for k, f in factors if 1 / LARGEST <= k <= LARGEST]
    crossings = _zeros(lambda f: abs(given(f)) - 1, hz, np.abs(L) - 1)
    angles = [float(np.angle(-given(f))) for f in crossings]
    phase = min(((float(np.rad2deg(abs(a))), f) for a, f in zip(angles, crossings, strict=True)), default=None)
    late = min(((a % (2 * np.pi) / (2 * np.pi * f), f) for a, f in zip(angles, crossings, strict=True)), default=None)
    if abs(ends.get(np.inf, 0.0)) >= 1:
        late = 0.0, np.inf  # without a lag: any delay turns a gain above 1 around at some frequency
    whole = given, np.r_[hz, list(ends)], np.r_[L, list(ends.values())]
    return LoopMargins(
        name,
        *min((one for one in factors if one[0] > 1), default=(np.inf, np.nan)),
        *max((one for one in factors if one[0] < 1), default=(0.0, np.nan)),
        *(phase or (np.inf, np.nan)),
        *(late or (np.inf, np.nan)),
        *_least(_disk, *whole),
        *_least(lambda L: np.abs(1 + L), *whole),
    )


def _zeros(value: Callable[[float], float], hz: np.ndarray, sampled: np.ndarray) -> list[float]:
    """Frequencies (Hz) where a function with these samples changes its sign."""
    changes = np.flatnonzero(sampled[:-1] * sampled[1:] < 0)
    return [float(brentq(value, hz[k], hz[k + 1], rtol=1e-12)) for k in changes]


def _disk(L: Any) -> Any:
    """The disk margin at values of L."""
    with np.errstate(divide="ignore"):
        return 2 * np.abs(1 + L) / np.abs(1 - L)


def _least(size: Callable[[Any], Any], given: Any, hz: np.ndarray, L: np.ndarray) -> tuple[float, float]:
    """The least size of L, which `given` finds at a frequency, and its frequency (Hz)."""
    order = np.argsort(hz)
    hz, L = hz[order], L[order]
    k = int(size(L).argmin())
    found = float(size(L)[k]), float(hz[k])
    if not 0 < k < len(hz) - 1:
        return found
    near = hz[k - 1], min(hz[k + 1], 2 * hz[k])
    best = minimize_scalar(lambda f: float(size(given(f))), bounds=near, method="bounded", options={"xatol": 1e-9})
    return min((float(best.fun), float(best.x)), found)
