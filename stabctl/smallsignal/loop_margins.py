"""Classical margins of the single loops of a closed loop: one output opened, all others closed.

With the loop gain L(jw), sign of negative feedback, the loop is unstable where (1 + L) turns to zero:

    gain margins     k = 1 / |L| where L < 0: the smallest above 1 and the largest below
    phase margin     smallest angle of -L where |L| = 1
    delay margin     smallest angle of -L, from 0 to 360 deg, over w where |L| = 1; 0 if |L| >= 1 for w = inf
    disk margin      smallest 2 |1 + L| / |1 - L|: gain and phase may change together inside a disk

The disk margin a is the symmetric one, 1 / max |S - T| / 2: gains from (2 - a)/(2 + a) to (2 + a)/(2 - a) or phases up
to 2 atan(a/2) leave the loop stable.

Source: P. Seiler, A. Packard, P. Gahinet, An introduction to disk margins, IEEE Control Systems Magazine 40, 2020.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from stabctl.dynamics.named import Named
from stabctl.dynamics.operating_point import OperatingPoint

from .opened_loop import alone, linear_loop
from .response import grid

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


class Loops(NamedTuple):
    """The single loops: margins, frequencies (points) in Hz, and L there (points, loops)."""

    margins: tuple[LoopMargins, ...]
    hz: np.ndarray
    gain: np.ndarray


def single_loops(point: OperatingPoint, own: Sequence[Named], poles: np.ndarray, fast: float = 0.0) -> Loops:
    """The loops through each output of `linear_loop`; `poles` (1/s) are those of the stable closed loop.

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
    return LoopMargins(
        name,
        *min((one for one in factors if one[0] > 1), default=(np.inf, np.nan)),
        *max((one for one in factors if one[0] < 1), default=(0.0, np.nan)),
        *(phase or (np.inf, np.nan)),
        *(late or (np.inf, np.nan)),
        *_disk(given, np.r_[hz, list(ends)], np.r_[L, list(ends.values())]),
    )


def _zeros(value: Callable[[float], float], hz: np.ndarray, sampled: np.ndarray) -> list[float]:
    """Frequencies (Hz) where a function with these samples changes its sign."""
    changes = np.flatnonzero(sampled[:-1] * sampled[1:] < 0)
    return [float(brentq(value, hz[k], hz[k + 1], rtol=1e-12)) for k in changes]


def _disk(given: Callable[[float], complex], hz: np.ndarray, L: np.ndarray) -> tuple[float, float]:
    """The disk margin and its frequency (Hz)."""

    def size(L: np.ndarray | complex) -> np.ndarray:
        with np.errstate(divide="ignore"):
            found: np.ndarray = 2 * np.abs(1 + L) / np.abs(1 - L)
        return found

    order = np.argsort(hz)
    hz, L = hz[order], L[order]
    k = int(size(L).argmin())
    found = float(size(L)[k]), float(hz[k])
    if not 0 < k < len(hz) - 1:
        return found
    near = hz[k - 1], min(hz[k + 1], 2 * hz[k])
    best = minimize_scalar(lambda f: float(size(given(f))), bounds=near, method="bounded", options={"xatol": 1e-9})
    return min((float(best.fun), float(best.x)), found)


def _decibels(gain: float, hz: float) -> str:
    if gain == 0 or np.isinf(gain):
        return "0" if gain == 0 else "any"
    return f"{gain:.3g} ({20 * np.log10(gain):.1f} dB, {hz:.3g} Hz)"
