"""Evidence for a design: root locus, loop gains, margins, step responses, clearing times.

Every controller output is opened in turn for its loop gain, with all others closed; sampling and delay are exact.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stabctl._util.errors import StudyError
from stabctl._util.validation import checks_arguments
from stabctl._util.wording import counted
from stabctl.clearing import ClearingTime, clearing_time
from stabctl.controllers.controller import Controller
from stabctl.dynamics.named import all_named, named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.simulation.contingency import Contingency
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.interconnection import held
from stabctl.smallsignal.margins import Margins, margins, single_loops

from ._tuning import Loop
from .result import Design

FACTORS = np.linspace(0.0, 2.0, 41)  # of the gains, along the root locus
LOW, HIGH = 0.05, 10.0  # Hz   of the loop gains shown
MOST = 12  # loops whose gain is shown
SECONDS = 10.0  # of the step responses
RATE, FINEST = 60, 600  # 1/s   of continuous step responses; the inverse of the shortest time constant in between
SHARE = 0.01  # of the largest load, that is switched on
INPUTS = 12  # of a controller, up to which its own step is shown


@dataclass(frozen=True, repr=False)
class RootLocus:
    """Eigenvalues of a closed loop with other gains.

    Attributes
    ----------
    factors
        Factors of all gains (factors).
    eigenvalues
        Eigenvalues with each of them (factors, modes), 1/s.
    """

    factors: np.ndarray
    eigenvalues: tuple[np.ndarray, ...]


@dataclass(frozen=True, repr=False)
class LoopGain:
    """The loop gain at one output, with the sign of a negative feedback: stability is lost where it is -1.

    Attributes
    ----------
    name
        Controller and input that it drives.
    hz
        Frequencies (frequencies), dense around resonances.
    response
        L(jw) (frequencies), complex.
    distance
        Least distance of L(jw) from -1: the smallest change of the loop gain that makes it unstable.
    phase_margin
        Smallest angle (deg) between L(jw) and -1 where its size is 1; inf if it never is.
    """

    name: str
    hz: np.ndarray
    response: np.ndarray
    distance: float
    phase_margin: float


@dataclass(frozen=True, repr=False)
class StepResponses:
    """Step responses.

    Attributes
    ----------
    bus, mw
        Where load is switched on, and how much.
    machines
        Names of the machines.
    before, after
        Times (s) and speed deviations from the COI of the others (times, machines), pu, without and with the
        controllers.
    own
        Name of every controller and its input, times (s), and the outputs (times, outputs) after a unit step of it.
    """

    bus: int
    mw: float
    machines: tuple[str, ...]
    before: tuple[np.ndarray, np.ndarray]
    after: tuple[np.ndarray, np.ndarray]
    own: tuple[tuple[str, np.ndarray, np.ndarray], ...]


@dataclass(frozen=True)
class Check:
    """Critical clearing times of a contingency without and with the controllers, and with those that they replace."""

    before: ClearingTime
    after: ClearingTime
    replaced: ClearingTime | None = None  # with the stabilizers of the case; None if it has none that are replaced

    @property
    def label(self) -> str:
        """The contingency."""
        return self.after.contingency.label

    @property
    def change(self) -> float:
        """Cycles gained against the stabilizers of the case, or none; from 0 if unstable to the longest time tried."""
        return self.after.reach_cycles - (self.replaced or self.before).reach_cycles

    @property
    def gained(self) -> str:
        """The change in words: `-0.5 cycles`, or `+3.625 cycles or more` where the search ends."""
        ends = {one.status == "stable_at_limit" for one in (self.after, self.replaced or self.before)}
        return f"{self.change:+g} cycles" + " or more" * (len(ends) > 1)


@dataclass(frozen=True, repr=False)
class Evidence:
    """What speaks for a design, at its first operating point.

    Attributes
    ----------
    design
        The design.
    locus
        Eigenvalues with 0 to 2 times the gains.
    loops
        Loop gains, each opened at one output with all others closed.
    margins
        Delay and gain margins of all controllers together; None if the closed loop is unstable.
    steps
        Step responses of the closed loop, and of every controller alone.
    checks
        Nonlinear checks: clearing times.

    Examples
    --------
    >>> base = st.load("two_area_thyristor").initialize(storage="3@11=50MW")
    >>> found = st.design.evidence(st.design.pod(base, "deviation:3", "order:3@11", damping=0.05))
    >>> round(found.margins.delay, 2), found.margins.gain_up
    (0.35, inf)
    """

    design: Design
    locus: RootLocus
    loops: tuple[LoopGain, ...]
    margins: Margins | None
    steps: StepResponses
    checks: tuple[Check, ...]

    def __str__(self) -> str:
        lines = [str(self.design)]
        lines += [self.margins.together] if self.margins else ["the closed loop is unstable"]
        lines += [f"{c.label}: {_check(c)}" for c in self.checks]
        lines += [self.summary] if self.checks else []
        return "\n".join(lines)

    @property
    def summary(self) -> str:
        """How the controllers change the clearing times of the checks, as a sentence; empty without checks."""
        return compared(self.checks)

    __repr__ = __str__


def _check(c: Check) -> str:
    own = f", {c.replaced.shown} cycles with the stabilizers of the case" if c.replaced else ""
    return f"{c.before.shown} cycles without, {c.after.shown} cycles with{own}"


def compared(checks: Sequence[Check]) -> str:
    """How controllers change clearing times, as a sentence; empty without any."""
    if not checks:
        return ""
    changes = np.array([c.change for c in checks])
    worst = checks[int(changes.argmin())]
    other = "with the stabilizers of the case" if checks[0].replaced else "without the controllers"
    return (
        f"Compared with those {other}, {(changes < 0).sum()} of {counted(len(changes), 'clearing time')} are "
        f"shorter and {(changes > 0).sum()} longer: median {np.median(changes):+g} cycles, worst "
        f"{worst.gained} ({worst.label})."
    )


@checks_arguments
def evidence(design: Design, checks: Iterable[Contingency | str] = ()) -> Evidence:
    """Compute the evidence for a design: root locus, loop gains, margins, step responses and clearing times.

    Parameters
    ----------
    design : Design
        The design; its controllers must have matrices.
    checks : iterable of Contingency or str
        Contingencies whose critical clearing times are found without and with the controllers, and with the stabilizers
        of the case that they replace.

    Returns
    -------
    Evidence

    Raises
    ------
    StudyError
        If it is not a design, a controller is a Python function, or a contingency does not fit the case.

    Examples
    --------
    >>> base = st.load("two_area_thyristor").initialize(storage="3@11=50MW")
    >>> found = st.design.pod(base, "deviation:3", "order:3@11", damping=0.05)
    >>> print(st.design.evidence(found))
    1 controller: smallest damping ratio of 0.1 to 3 Hz: -0.0087 without, 0.0500 with.
    stable with less than 353.3 ms more delay, and with 0.148 to inf times the gains
    """
    point, controllers = design.base, design.controllers
    for c in controllers:
        if c.law is not None:
            raise StudyError(f"{c.name} is a Python function, which has no gain to vary; report a linear controller.")
    wanted = [c if isinstance(c, Contingency) else Contingency(c) for c in checks]
    for contingency in wanted:
        contingency.with_clear("1cyc").check(point.case)
    whole = margins(point, *controllers) if design.after[0].stable else None
    return Evidence(
        design,
        _locus(point, controllers),
        loop_gains(design, whole),
        whole,
        step_responses(point, controllers),
        tuple(
            Check(
                clearing_time(point, c),
                clearing_time(point, c, control=list(controllers)),
                clearing_time(design.given, c) if design.given else None,
            )
            for c in (replace(c, clear=None) for c in wanted)
        ),
    )


def _locus(point: OperatingPoint, controllers: Sequence[Controller]) -> RootLocus:
    loop = Loop(point, controllers)
    return RootLocus(FACTORS, tuple(loop.eigenvalues([c.scaled(float(k)) for c in controllers]) for k in FACTORS))


def loop_gains(design: Design, stable: Margins | None) -> tuple[LoopGain, ...]:
    """The loop gains of the first 12 outputs, from the margins of a stable closed loop."""
    own, poles = all_named(design.base, design.controllers), design.after[0].eigenvalues
    known = (stable.loops, stable.hz, stable.gain) if stable else single_loops(design.base, own, poles)
    each, hz, gain = known
    shown = (hz > LOW) & (hz < HIGH)
    pairs = zip(each[:MOST], gain.T, strict=False)
    return tuple(LoopGain(m.name, hz[shown], L[shown], m.distance, m.phase_deg) for m, L in pairs)


def step_responses(point: OperatingPoint, controllers: Sequence[Controller]) -> StepResponses:
    """The step responses of a closed loop and of its controllers."""
    case = point.case
    if not case.loads:
        raise StudyError(f"{case.name} has no load, so there is no load step to show.")
    load = max(case.loads, key=lambda one: one.p)
    mw = SHARE * load.p

    without, with_them = (load_step(point, own, load.bus, mw) for own in ((), controllers))
    machines = tuple(str(name) for name in point.rotor_names)
    each = [one for c in controllers for one in _own(point, c)]
    return StepResponses(load.bus, mw, machines, without, with_them, tuple(each))


def load_step(
    point: OperatingPoint, controllers: Sequence[Controller], bus: int, mw: float, rate: int = RATE
) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and speed deviations (times, machines), pu, after a step of load, by the linear model.

    `rate` are the times per second of a model without sampled controllers.
    """
    m, base = closed_loop(point, *controllers, inputs=f"load_p:{bus}", outputs="deviation"), point.case.base_mva
    A, B, T = m.transition()
    if not T:
        T = 1 / rate
        A, B = held(A, B, T)
    return _step(A, B * mw / base, m.C, m.D * mw / base, T)


def _own(point: OperatingPoint, c: Controller) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """The outputs of a controller after a step of each of its inputs, with its delay; exact if it is continuous."""
    names = named(point, c).names
    if len(names) > INPUTS:
        return []
    T = 1 / (c.rate or np.clip(np.abs(np.linalg.eigvals(c.A)).max(initial=0.0), RATE, FINEST))
    A, B = (c.A, c.B) if c.rate else held(c.A, c.B, T)
    found = []
    for j, name in enumerate(names):
        t, y = _step(A, B[:, [j]], c.C, c.D[:, [j]], T)
        if c.delay:  # nothing until then
            t, y = np.r_[0.0, c.delay, c.delay + t], np.vstack([np.zeros((2, y.shape[1])), y])
        found.append((f"{c.name}: {name}", t, y))
    return found


def _step(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, T: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and outputs of x+ = A x + B, y = C x + D from rest."""
    count = int(SECONDS / T) + 1
    x, y = np.zeros(len(A)), np.empty((count, len(C)))
    for k in range(count):
        y[k] = C @ x + D[:, 0]
        x = A @ x + B[:, 0]
    return T * np.arange(count), y
