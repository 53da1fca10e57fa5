"""Limit cycles of a closed loop with deadbands, limits or relays, by harmonic balance.

A swing of one frequency is sustained if u = G(jw) N(|u|) u for what the outputs are asked for, u (outputs), complex.
One output: G(jw) is real and positive, and N(A) = 1/G gives its amplitude. Several: with equal gains, a characteristic
locus of G(jw) crosses the positive real axis; from there Newton's method (MINPACK) finds the amplitude and phase of
each. Source: A. Gelb, W. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq, fsolve, linear_sum_assignment

from stabctl._util import process, units
from stabctl._util.errors import StudyError
from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.controllers.controller import Controller
from stabctl.controllers.law import Law
from stabctl.dynamics.named import Named, all_named
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.dynamics.signals import OUTPUTS, SPEEDS, Signal, chosen
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from .closed_loop import joined
from .eigen import GROWING
from .interconnection import plant_of
from .model import grid
from .opened_loop import Nonlinearity, OpenedLoop, alone, nonlinearity

if TYPE_CHECKING:
    import pandas as pd

BAND = (0.1, 10.0)  # Hz
FEWEST = 6  # frames in a cycle
MOST = 3  # signals named in the sentence

EXACT = 1e-8  # residual of a solution, relative to the largest amplitude
SAME = 1e-4  # relative difference in frequency and amplitudes of one solution found twice
NONE = 1e-9  # size of a characteristic value, relative to the largest entry of G, below which it is zero
FAR = 20.0  # bound of the unknowns, logarithms and ratios
CALLS = 300  # of the loop gain, in the search for one solution
NUDGE = 1e-4  # relative change of the amplitude that shows whether the swing returns


@dataclass(frozen=True)
class Component:
    """The fundamental of one signal in a limit cycle."""

    signal: str
    amplitude: float
    angle_deg: float
    unit: str = ""

    def __str__(self) -> str:
        return f"{self.signal} {self.amplitude:.4g}{' ' if self.unit else ''}{self.unit}"


@dataclass(frozen=True)
class LimitCycle:
    """One limit cycle.

    Attributes
    ----------
    frequency_hz
        Frequency, Hz.
    stable
        Whether the system returns to it: a larger swing decays and a smaller one grows (Loeb's criterion), and no other
        mode of the loop with the gains N(A) grows.
    wanted
        What each output with a deadband, limits or relay is asked for, before they act; in the unit of the output.
    signals
        The signals asked for, or the inputs of these controllers; speeds and frequencies in mHz.
    third_harmonic
        Estimate of the third harmonic of what is wanted over its fundamental. The method takes it for zero.
    inverse
        -1/N(A) of the output with the largest amplitude, where the Nyquist curve meets it.
    """

    frequency_hz: float
    stable: bool
    wanted: tuple[Component, ...]
    signals: tuple[Component, ...]
    third_harmonic: float
    inverse: float

    def __getitem__(self, signal: str) -> Component:
        """The component of one signal, by name."""
        return {c.signal: c for c in (*self.wanted, *self.signals)}[signal]

    def __str__(self) -> str:
        shown = sorted(self.signals or self.wanted, key=lambda c: -c.amplitude)[:MOST]
        kind = "stable" if self.stable else "unstable"
        return f"{self.frequency_hz:.4f} Hz, {kind}, {', '.join(map(str, shown))}"


@dataclass(frozen=True)
class Nyquist:
    """The loop gain L(jw), sign of negative feedback, and what limits act on it: a cycle is where L = -1/N(A)."""

    name: str
    hz: np.ndarray
    gain: np.ndarray
    acts: Nonlinearity


@dataclass(frozen=True, repr=False)
class LimitCycles(Tabular):
    """The limit cycles of a closed loop, by frequency.

    Attributes
    ----------
    name : str
        Name of the case.
    band : pair of float, Hz
        Frequencies that were searched.
    cycles : tuple of LimitCycle
        The limit cycles.
    curves : tuple of Nyquist
        Loop gains of the figure: of the only output, or for each limit cycle of the output with the largest
        oscillation, with the others as gains.

    Examples
    --------
    >>> options = {"rate": 60, "delay": "200ms", "relay": True, "deadband": 2e-5, "limits": 1}
    >>> relay = st.Controller("deviation:1", "order:1@5", [], [], [], [[1.0]], **options)
    >>> found = st.load("two_area").limit_cycles(relay, storage="100MW")
    >>> [(round(cycle.frequency_hz, 2), cycle.stable) for cycle in found.cycles]
    [(1.58, False), (1.58, True), (6.03, False), (6.03, False)]
    """

    name: str
    band: tuple[float, float]
    cycles: tuple[LimitCycle, ...]
    curves: tuple[Nyquist, ...]

    plot = verb("stabctl.view.figures.limit_cycles:plot")

    @property
    def df(self) -> "pd.DataFrame":
        """One row per limit cycle; amplitudes by signal."""
        import pandas as pd

        rows = [
            {"frequency_hz": c.frequency_hz, "stable": c.stable, "third_harmonic": c.third_harmonic}
            | {f"{k.signal}{f' ({k.unit})' if k.unit else ''}": k.amplitude for k in (*c.wanted, *c.signals)}
            for c in self.cycles
        ]
        return pd.DataFrame(rows)

    def __len__(self) -> int:
        return len(self.cycles)

    def __str__(self) -> str:
        low, high = self.band
        found = counted(len(self), "limit cycle") if self.cycles else "no limit cycle"
        text = f"{self.name}: {found} from {low:g} to {high:g} Hz"
        return "\n".join([text + (":" if self.cycles else ""), *(f"  {c}" for c in self.cycles)])


def limit_cycles(
    base: Case | OperatingPoint,
    *controllers: Controller | Law,
    signals: str | Iterable[str | Signal] = (),
    band: str | tuple[float, float] = BAND,
    storage: "Fleet | None" = None,
) -> LimitCycles:
    r"""Find steady oscillations that deadbands, limits or relays of controllers sustain.

    Harmonic balance with the describing functions $N(A)$ of the outputs (`opened_loop`), for a single output

    $$ L(j\omega) = -\frac{1}{N(A)}; $$

    several swing at one frequency, each with its own amplitude. The loop gain is exact, with delays, and with the
    outputs of sampled controllers held. Gates are taken as open.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    *controllers : Controller or Law
        The controllers; a law of storage devices acts as its `controllers`. Those with deadband, limits or relay
        must have one rate, or be continuous.
    signals : str or iterable, optional
        Signals whose amplitudes are reported, as in `linearize`; by default the inputs of these controllers.
    band : str or pair, Hz
        Frequencies: "0.1..10Hz". Cycles of less than 6 frames are left out.
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.

    Returns
    -------
    LimitCycles

    Raises
    ------
    StudyError
        If no controller is nonlinear, one is a Python function, rates differ, limits differ in the two directions, or
        an output has a ramp limit.

    Examples
    --------
    >>> print(st.load("two_area").limit_cycles(st.BangBang().sampled(60, "200ms"), storage="100MW"))
    two_area: no limit cycle from 0.1 to 10 Hz
    """
    point = operating_point(base, storage)
    own = all_named(point, controllers)
    acts = [nonlinearity(c) for c in own]
    bent = [c for c, a in zip(own, acts, strict=True) if not a.gentle]
    if not bent:
        raise StudyError(
            "No controller has a deadband, limits or a relay, so the loop is linear and has no limit cycles; see "
            "closed_loop."
        )
    shown = chosen(point.case, signals, OUTPUTS) or tuple(dict.fromkeys(s for c in bent for s in c.inputs))
    low, high = units.band(band)
    with process.one_thread():
        loop = OpenedLoop(point, own, [None if a.gentle else a for a in acts], shown)
        high = min(high, loop.rate / FEWEST) if loop.rate else high
        if not 0 < low < high:
            raise StudyError(f"The band must begin above 0 Hz and below {high:g} Hz; it begins at {low:g} Hz.")
        hz, G = sampled(loop, low, high)
        found = balances(loop, hz, G)
        cycles = tuple(_cycle(point, own, loop, one, shown) for one in found)
        drawn = curves(found, G)
    return LimitCycles(
        point.case.name,
        (low, high),
        cycles,
        tuple(Nyquist(loop.names[r], hz, gain, loop.parts[r]) for r, gain in drawn),
    )


def sampled(loop: OpenedLoop, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (Hz) between two, and G there (frequencies, outputs, outputs)."""
    hz = grid(loop.poles, low, high)
    return hz, np.array([loop(2j * np.pi * f)[0] for f in hz])


@dataclass(frozen=True, eq=False)
class Balance:
    """A swing that the loop sustains."""

    hz: float
    wanted: np.ndarray  # (outputs) complex; the largest is real
    gains: np.ndarray  # (outputs) N(|u|)

    @property
    def largest(self) -> int:
        """The output that is asked for most."""
        return int(np.abs(self.wanted).argmax())


def balances(loop: OpenedLoop, hz: np.ndarray, G: np.ndarray) -> list[Balance]:
    """All that were found between frequencies (Hz) at which G is given, the slowest first."""
    found = _single(loop, hz, G[:, 0, 0]) if len(loop.parts) == 1 else _several(loop, hz, G)
    return sorted(found, key=lambda b: (b.hz, abs(b.wanted[b.largest])))


def _single(loop: OpenedLoop, hz: np.ndarray, G: np.ndarray) -> list[Balance]:
    def imaginary(f: float) -> float:
        return float(loop(2j * np.pi * f)[0][0, 0].imag)

    found = []
    for k in np.flatnonzero(G.imag[:-1] * G.imag[1:] < 0):
        f = float(brentq(imaginary, hz[k], hz[k + 1], rtol=1e-12))
        gain = 1 / loop(2j * np.pi * f)[0][0, 0].real
        if gain > 0:
            found += [Balance(f, np.array([A + 0j]), np.array([gain])) for A in loop.parts[0].amplitudes(gain)]
    return found


def _several(loop: OpenedLoop, hz: np.ndarray, G: np.ndarray) -> list[Balance]:
    found: list[Balance] = []
    for f, gain, shape in _crossings(hz, G):
        r = int(np.abs(shape).argmax())
        for A in loop.parts[r].amplitudes(gain):
            one = _solved(loop, f, A * shape / shape[r])
            if one and hz[0] <= one.hz <= hz[-1] and not any(_same(one, b) for b in found):
                found.append(one)
    return found


def _crossings(hz: np.ndarray, G: np.ndarray) -> list[tuple[float, float, np.ndarray]]:
    """Frequency (Hz), gain and shape where a characteristic locus of G(jw) crosses the positive real axis."""
    values, vectors = np.linalg.eig(G)
    least = NONE * np.abs(G).max(axis=(1, 2))
    found = []
    for k in range(1, len(hz)):
        order = linear_sum_assignment(np.abs(values[k - 1][:, None] - values[k]))[1]
        values[k], vectors[k] = values[k][order], vectors[k][:, order]
        a, b = values[k - 1], values[k]
        for j in np.flatnonzero((a.imag * b.imag < 0) & (a.real > least[k]) & (b.real > least[k])):
            part = a.imag[j] / (a.imag[j] - b.imag[j])
            gain = 1 / (a.real[j] + part * (b.real[j] - a.real[j]))
            found.append((hz[k - 1] + part * (hz[k] - hz[k - 1]), gain, vectors[k][:, j]))
    return found


def _solved(loop: OpenedLoop, hz: float, u: np.ndarray) -> Balance | None:
    """Newton's method from a frequency and a swing; the largest output keeps its phase."""
    r = int(np.abs(u).argmax())
    rest = np.delete(np.arange(len(u)), r)

    def swing(x: np.ndarray) -> np.ndarray:
        out = np.empty(len(u), complex)
        out[r], out[rest] = 1.0, x[2 : 2 + len(rest)] + 1j * x[2 + len(rest) :]
        return np.abs(u[r]) * np.exp(x[1]) * out

    def missing(x: np.ndarray) -> np.ndarray:
        v = swing(np.clip(x, -FAR, FAR))
        left = (loop(2j * np.pi * hz * np.exp(x[0]))[0] @ (gains(loop, v) * v) - v) / np.abs(v[r])
        return np.r_[left.real, left.imag]

    start = u[rest] / u[r]
    x = _zero(missing, np.r_[0.0, 0.0, start.real, start.imag])
    return None if x is None else Balance(hz * float(np.exp(x[0])), swing(x), gains(loop, swing(x)))


def gains(loop: OpenedLoop, u: np.ndarray) -> np.ndarray:
    """N(|u|) of every output."""
    size = np.maximum(np.abs(u), 1e-12 * np.abs(u).max())
    return np.array([float(part.gain(A)) for part, A in zip(loop.parts, size, strict=True)])


def _same(a: Balance, b: Balance) -> bool:
    far = np.abs(np.abs(a.wanted) - np.abs(b.wanted)).max() / np.abs(a.wanted).max()
    return bool(abs(a.hz / b.hz - 1) < SAME and far < SAME)


def _cycle(
    point: OperatingPoint, own: list[Named], loop: OpenedLoop, one: Balance, signals: tuple[Signal, ...]
) -> LimitCycle:
    """The record of a harmonic balance."""
    s = 2j * np.pi * one.hz
    given = one.gains * one.wanted
    y = loop(s)[1] @ given
    hertz = 1e3 * point.case.frequency_hz
    scale = [(hertz, "mHz") if k.kind in SPEEDS else (1.0, k.unit) for k in signals]
    shown = [_component(k.name, c * value, unit) for k, value, (c, unit) in zip(signals, y, scale, strict=True)]
    wanted = [_component(name, value) for name, value in zip(loop.names, one.wanted, strict=True)]
    swing = zip(loop.parts, np.abs(one.wanted), one.gains, strict=True)
    thirds = np.array([part.third(A) if gain else 0.0 for part, A, gain in swing])
    third = np.abs(loop(3 * s)[0] @ (thirds * given)).max() / np.abs(one.wanted).max()
    stable = returns(loop, one) and not _others_grow(point, own, one)
    return LimitCycle(one.hz, stable, tuple(wanted), tuple(shown), float(third), -1 / float(one.gains[one.largest]))


def _component(name: str, value: complex, unit: str = "") -> Component:
    return Component(name, float(abs(value)), float(np.angle(value, deg=True)), unit)


def returns(loop: OpenedLoop, one: Balance) -> bool:
    """Loeb's criterion: a swing that is a little larger decays.

    With the largest amplitude raised, the balance holds at s with Re(s) < 0. For one output, ds/dA = -N'/N^2 / G'(s).
    """
    s, r = 2j * np.pi * one.hz, one.largest
    if len(one.wanted) == 1:
        h = 1e-6 * s
        slope = (loop(s + h)[0][0, 0] - loop(s - h)[0][0, 0]) / (2 * h)
        return bool((loop.parts[0].slope(abs(one.wanted[0])) / slope).real > 0)
    rest = np.delete(np.arange(len(one.wanted)), r)
    raised = (1 + NUDGE) * one.wanted

    def missing(x: np.ndarray) -> np.ndarray:
        u = raised.copy()
        u[rest] = u[rest] * (1 + x[2 : 2 + len(rest)] + 1j * x[2 + len(rest) :])
        left = (loop(s + abs(s) * (x[0] + 1j * x[1]))[0] @ (gains(loop, u) * u) - u) / np.abs(one.wanted)
        return np.r_[left.real, left.imag]

    x = _zero(missing, np.zeros(2 * len(one.wanted)))
    return x is not None and bool(x[0] < 0)


def _zero(missing: Callable[[np.ndarray], np.ndarray], start: np.ndarray) -> np.ndarray | None:
    """A zero near a start; None if none was found."""
    x, information, *_ = fsolve(missing, start, full_output=True, xtol=1e-12, maxfev=CALLS)
    return x if np.abs(information["fvec"]).max() < EXACT else None


def _others_grow(point: OperatingPoint, own: list[Named], one: Balance) -> bool:
    """Whether a mode other than the cycle itself grows in the loop with the gains N(A)."""
    left, linear = list(one.gains), []
    for c in own:
        bent = not nonlinearity(c).gentle
        linear.append(replace(c, equivalent=tuple(left.pop(0) for _ in c.outputs)) if bent else c)
    values = joined(plant_of(point, linear), linear).eigenvalues()
    upper = values[values.imag >= 0]
    others = np.delete(upper, np.abs(upper - 2j * np.pi * one.hz).argmin())
    return bool(others.real.max() > GROWING)


def curves(found: Sequence[Balance], G: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """An output and its loop gain -G(jw) at the frequencies of G: of one output, or for each balance.

    Of several outputs, it is that of the largest, the others replaced by their gains N.
    """
    if G.shape[1] == 1:
        return [(0, -G[:, 0, 0])]
    return [(one.largest, -alone(G, one.gains, one.largest)) for one in found]
