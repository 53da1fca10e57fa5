"""How a tuning holds: with other gains, without a controller, in the nonlinear simulation.

The search does not see this, except for the factors of all gains that were asked for.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stabctl.clearing import clearing_time, screen
from stabctl.controllers.controller import Controller
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.simulation.events import LoadStep

from ..evidence import Check, load_step
from .parts import Parts
from .problem import LOW, Trial, spare

FACTORS = 0.7, 1.3, 2.0  # of all gains
DRAWS, SPREAD = 10, 0.3  # random gains, each its own, and how far they are from 1
PULSE, BEGIN, LASTS, SECONDS = 1e-3, 0.1, 0.1, 5.0  # of the largest load; s   of the ring-down
RATE = 240  # 1/s   of the linear response
SHORTER = 0.125  # cycles that a clearing time may fall without being named


@dataclass(frozen=True, repr=False, eq=False)
class RingDown:
    """Speeds after a small pulse of load: of the nonlinear simulation, and of the linear model.

    Attributes
    ----------
    bus, mw
        Where load is switched on for 0.1 s, and how much.
    machines
        Names of the machines.
    time
        Since the pulse begins (times), s.
    simulated, linear
        Speed deviations from the COI of the others (times, machines), pu.
    """

    bus: int
    mw: float
    machines: tuple[str, ...]
    time: np.ndarray
    simulated: np.ndarray
    linear: np.ndarray

    @property
    def difference(self) -> float:
        """Largest difference of the two, of the largest value; 0 where no speed deviates in the linear model."""
        return float(np.abs(self.simulated - self.linear).max() / (np.abs(self.linear).max() or np.inf))


@dataclass(frozen=True)
class Worst:
    """The least damping ratio of some networks, of every mode above 0.1 Hz, and of slower ones that grow.

    Attributes
    ----------
    damping
        Damping ratio.
    frequency_hz
        Frequency of the mode, Hz.
    name
        Network, and what is different.
    """

    damping: float
    frequency_hz: float
    name: str

    def __str__(self) -> str:
        return f"{self.damping:z.4f} at {self.frequency_hz:.3f} Hz ({self.name})"


def worst(trial: Trial, factors: np.ndarray, plants: Iterable[int] | None = None, more: str = "") -> Worst:
    """The least damping ratio of some plants with factors of the gains; of all by default."""
    every, found = trial.problem.plants, []
    for k in range(len(every)) if plants is None else plants:
        s = trial.loop(k, factors).eigenvalues
        value = spare(s)
        value = np.where((np.abs(s.imag) >= 2 * np.pi * LOW) | (value < 0), value, np.inf)
        i = int(value.argmin())
        found.append(Worst(float(value[i]), float(abs(s[i].imag) / (2 * np.pi)), f"{every[k].name}{more}"))
    return min(found, key=lambda one: one.damping)


def gains_and_outages(parts: Parts, trial: Trial, factors: Sequence[float], seed: int) -> Iterator[tuple[str, Worst]]:
    """What differs, and the worst: all gains, each gain at random, each controller out of service."""
    n = len(parts.tunables)
    if not n:
        return
    one = np.ones(n)
    for k in sorted({*FACTORS, *factors}):
        yield f"all gains x {k:g}", worst(trial, k * one)
    rng = np.random.default_rng(seed)
    draws = [worst(trial, rng.uniform(1 - SPREAD, 1 + SPREAD, n)) for _ in range(DRAWS)]
    yield f"each gain +-{100 * SPREAD:g} %, worst of {DRAWS} draws", min(draws, key=lambda w: w.damping)
    intact = [k for k, owner in enumerate(parts.owner) if parts.networks[owner].intact] or [0]
    out = [worst(trial, one - np.eye(n)[i], intact, f" without {t.name}") for i, t in enumerate(parts.tunables)]
    yield "one controller out, no other outage", min(out, key=lambda w: w.damping)


def ring_down(point: OperatingPoint, controllers: Sequence[Controller]) -> RingDown:
    """Simulate 5 s after a pulse of 0.1 % of the largest load, with the limits of the controllers."""
    load = max(point.case.loads, key=lambda one: one.p)
    mw = PULSE * load.p
    events = [LoadStep(load.bus, BEGIN, p=mw), LoadStep(load.bus, BEGIN + LASTS, p=-mw)]
    run = point.simulate(events, BEGIN + SECONDS, control=list(controllers) or None, step=0.5 / RATE)
    time, linear = (x[: round(SECONDS * RATE)] for x in load_step(point, controllers, load.bus, mw, RATE))
    late = round(LASTS * RATE)
    linear = linear - np.vstack([np.zeros_like(linear[:late]), linear[:-late]])  # the step back
    H = point.inertia
    whole = H @ point.members @ point.members.T  # of the island of each machine
    found = point.from_center(run.speed.values, H) * whole / np.maximum(whole - H, 1e-9)
    own = np.array([np.interp(BEGIN + time, run.time, column) for column in found.T]).T
    return RingDown(load.bus, mw, tuple(map(str, point.rotor_names)), time, own, linear)


def clearing(
    point: OperatingPoint, given: OperatingPoint | None, controllers: Sequence[Controller], number: int
) -> tuple[Check, ...]:
    """The most critical line faults of the given system, with their clearing times there and with the controllers."""
    if not number:
        return ()
    pairs = [one for one in screen(given or point).pairs if one.cycles is not None]
    found = []
    for own in sorted(pairs, key=lambda one: one.cycles or 0.0)[:number]:
        contingency = replace(own.contingency, clear=None)
        after = clearing_time(point, contingency, control=list(controllers) or None)
        found.append(Check(clearing_time(point, contingency), after, own) if given else Check(own, after))
    return tuple(found)


def shorter(checks: Sequence[Check]) -> list[Check]:
    """Those whose clearing time falls by more than 1/8 cycle."""
    return [c for c in checks if c.change < -SHORTER - 1e-9]
