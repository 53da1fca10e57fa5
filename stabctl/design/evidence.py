"""Evidence for a design: root locus, loop gains, margins, step responses, and clearing times without and with it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stabctl._util.wording import counted
from stabctl.clearing import ClearingTime, clearing_time
from stabctl.controllers.controller import Controller
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError, shown
from stabctl.simulation.contingency import Contingency
from stabctl.smallsignal.margins import Margins, margins

from .loop import Loop
from .loop_gain import LoopGain, loop_gains
from .result import Design
from .step_responses import StepResponses, step_responses

FACTORS = np.linspace(0.0, 2.0, 41)  # of the gains, along the root locus


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
        """Cycles gained against the stabilizers of the case or, without any, against none; an unstable case has 0."""
        return (self.after.cycles or 0.0) - ((self.replaced or self.before).cycles or 0.0)


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
        if not self.checks:
            return ""
        changes = np.array([c.change for c in self.checks])
        worst = self.checks[int(changes.argmin())]
        other = "with the stabilizers of the case" if self.design.given else "without the controllers"
        return (
            f"Compared with those {other}, {(changes < 0).sum()} of {counted(len(changes), 'clearing time')} are "
            f"shorter and {(changes > 0).sum()} longer: median {np.median(changes):+g} cycles, worst "
            f"{worst.change:+g} cycles ({worst.label})."
        )

    __repr__ = __str__


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
    """
    if not isinstance(design, Design):
        raise StudyError(
            f"{shown(design)} is not a design; give the result of st.design.pod or of another design function."
        )
    point, controllers = design.base, design.controllers
    for c in controllers:
        if c.law is not None:
            raise StudyError(f"{c.name} is a Python function, which has no gain to vary; report a linear controller.")
    wanted = [c if isinstance(c, Contingency) else Contingency(c) for c in checks]
    for contingency in wanted:
        contingency.with_clear("1cyc").check(point.case)
    return Evidence(
        design,
        _locus(point, controllers),
        loop_gains(point, controllers),
        margins(point, *controllers) if design.after[0].stable else None,
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


def _check(c: Check) -> str:
    own = f", {_cycles(c.replaced)} with the stabilizers of the case" if c.replaced else ""
    return f"{_cycles(c.before)} without, {_cycles(c.after)} with{own}"


def _cycles(found: ClearingTime) -> str:
    return "none" if found.cycles is None else f"{found.cycles:g} cycles"
