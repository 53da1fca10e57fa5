"""Limit cycles of a closed loop with deadbands, limits or relays, by describing functions."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from stabctl import units
from stabctl._util import cores
from stabctl.controllers.controller import Controller
from stabctl.controllers.law import Law
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.named import Named, all_named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signal_kinds import OUTPUTS
from stabctl.dynamics.signals import Signal, chosen
from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from .closed_loop import joined
from .describing import nonlinearity
from .eigen import GROWING
from .harmonic_balance import Balance, balances, curves, returns, sampled
from .interconnection import plant_of
from .limit_cycle import Component, LimitCycle, LimitCycles, Nyquist
from .opened_loop import OpenedLoop

BAND = (0.1, 10.0)  # Hz
FEWEST = 6  # frames in a cycle
SPEEDS = ("speed", "coi_speed", "rest_speed", "deviation", "frequency", "bus_frequency")


def limit_cycles(
    base: Case | OperatingPoint,
    *controllers: Controller | Law,
    signals: str | Iterable[str | Signal] = (),
    band: str | tuple[float, float] = BAND,
    storage: "Fleet | None" = None,
) -> LimitCycles:
    r"""Find steady oscillations that deadbands, limits or relays of controllers sustain.

    Harmonic balance with the describing functions $N(A)$ of the outputs (`describing`), for a single output

    $$ L(j\omega) = -\frac{1}{N(A)}; $$

    several swing at one frequency, each with its own amplitude. The loop gain is exact, with delays, and with the
    outputs of sampled controllers held (`opened_loop`). Gates are taken as open.

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
    with cores.one_thread():
        loop = OpenedLoop(point, own, [None if a.gentle else a for a in acts], shown)
        high = min(high, loop.rate / FEWEST) if loop.rate else high
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
    values = joined(plant_of(point, linear), linear).eigenvalues()
    upper = values[values.imag >= 0]
    others = np.delete(upper, np.abs(upper - 2j * np.pi * one.hz).argmin())
    return bool(others.real.max() > GROWING)
