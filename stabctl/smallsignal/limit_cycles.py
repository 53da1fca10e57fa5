"""Limit cycles of a closed loop with deadbands, limits or relays, by describing functions."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stabctl import units
from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.controllers.controller import Controller
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.named import Named, named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import OUTPUTS, Signal, chosen
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from .closed_loop import joined
from .describing import Nonlinearity, nonlinearity
from .harmonic_balance import Balance, balances, curve, returns
from .interconnection import plant_of
from .margins import GROWING
from .opened_loop import OpenedLoop

if TYPE_CHECKING:
    import pandas as pd

BAND = (0.1, 10.0)  # Hz
FEWEST = 6  # frames in a cycle
MOST = 3  # signals named in the sentence
SPEEDS = ("speed", "coi_speed", "rest_speed", "deviation", "frequency", "bus_frequency")


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
    """The limit cycles of a closed loop, by frequency."""

    name: str
    band: tuple[float, float]  # Hz
    cycles: tuple[LimitCycle, ...]
    curves: tuple[Nyquist, ...]  # of one output, or for each cycle, of the largest with the others as gains

    plot = verb("stabctl.plotting.limit_cycles:plot")

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
    *controllers: Controller,
    signals: str | Iterable[str | Signal] = (),
    band: str | tuple[float, float] = BAND,
    storage: "Fleet | None" = None,
) -> LimitCycles:
    """Find steady oscillations that deadbands, limits or relays of controllers sustain.

    Harmonic balance with the describing functions N(A) of the outputs (`describing`): L(jw) = -1/N(A) for one of them;
    several swing at one frequency, each with its own amplitude. The loop gain is exact, with delays, and with the
    outputs of sampled controllers held (`opened_loop`). Gates are taken as open.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    *controllers : Controller
        The controllers. Those with deadband, limits or relay must have one rate, or be continuous.
    signals : str or iterable, optional
        Signals whose amplitudes are reported, as in `linearize`; by default the inputs of these controllers.
    band : str or pair, Hz
        Frequencies: "0.1..10Hz". Cycles of less than 6 frames are left out.
    storage : str, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.

    Returns
    -------
    LimitCycles

    Raises
    ------
    StudyError
        If no controller is nonlinear, rates differ, limits differ in the two directions, or an output has a ramp limit.
    """
    point = operating_point(base, storage)
    own = [named(point, c) for c in controllers]
    bent = [c for c in own if not nonlinearity(c).gentle]
    shown = chosen(point.case, signals, OUTPUTS) or tuple(dict.fromkeys(s for c in bent for s in c.inputs))
    loop = OpenedLoop(point, own, shown)
    low, high = units.band(band)
    high = min(high, loop.rate / FEWEST) if loop.rate else high
    found = balances(loop, low, high)
    cycles = tuple(_cycle(point, own, loop, one, shown) for one in found)
    names = loop.names
    curves = [curve(loop, one, low, high) for one in (found if len(names) > 1 else [None])]
    drawn = tuple(Nyquist(names[i], hz, gain, loop.parts[i]) for i, hz, gain in curves)
    return LimitCycles(point.case.name, (low, high), cycles, drawn)


def _cycle(
    point: OperatingPoint, own: list[Named], loop: OpenedLoop, one: Balance, signals: tuple[Signal, ...]
) -> LimitCycle:
    """The record of a harmonic balance."""
    s = 2j * np.pi * one.hz
    given = one.gains * one.wanted
    y = loop(s)[1] @ given
    hertz = 1e3 * point.case.frequency_hz
    scale = [(hertz, "mHz") if k.kind in SPEEDS else (1.0, k.unit) for k in signals]
    shown = [
        _component(f"{k.kind}:{k.place}" if k.place is not None else k.kind, c * value, unit)
        for k, value, (c, unit) in zip(signals, y, scale, strict=True)
    ]
    wanted = [_component(name, value) for name, value in zip(loop.names, one.wanted, strict=True)]
    swing = zip(loop.parts, np.abs(one.wanted), one.gains, strict=True)
    thirds = np.array([part.third(A) if gain else 0.0 for part, A, gain in swing])
    third = np.abs(loop(3 * s)[0] @ (thirds * given)).max() / np.abs(one.wanted).max()
    stable = returns(loop, one) and not _others_grow(point, own, one)
    return LimitCycle(one.hz, stable, tuple(wanted), tuple(shown), float(third), -1 / float(one.gains[one.largest]))


def _component(name: str, value: complex, unit: str = "") -> Component:
    return Component(name, float(abs(value)), float(np.angle(value, deg=True)), unit)


def _others_grow(point: OperatingPoint, own: list[Named], one: Balance) -> bool:
    """Whether a mode other than the cycle itself grows in the loop with the gains N(A)."""
    left, linear = list(one.gains), []
    for c in own:
        bent = not nonlinearity(c).gentle
        linear.append(replace(c, equivalent=tuple(left.pop(0) for _ in c.outputs)) if bent else c)
    values = joined(plant_of(point, linear), linear).modes().eigenvalues
    upper = values[values.imag >= 0]
    others = np.delete(upper, np.abs(upper - 2j * np.pi * one.hz).argmin())
    return bool(others.real.max() > GROWING)
