"""A controller with the signals that its names mean in a case."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.controllers.controller import Controller
from stabctl.controllers.law import Law
from stabctl.controllers.realization import Matrices, realized
from stabctl.model import naming
from stabctl.model.case import Case

from . import outputs
from .inputs import extended
from .operating_point import OperatingPoint
from .signals import INPUTS, OUTPUTS, Signal, chosen


@dataclass(frozen=True)
class Named:
    """A controller with the signals that its names mean in a case."""

    controller: Controller
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    names: tuple[str, ...]  # of the inputs, each with its place
    rest: np.ndarray  # values of the inputs at the operating point
    machine: int | None  # to which all inputs that it drives belong; None if there are several, or none
    equivalent: tuple[float, ...] | None = None  # gains of the outputs for a given amplitude, in place of `gains`

    @property
    def gains(self) -> np.ndarray:
        """Gains of the outputs (outputs): 1, or 0 with a deadband or relay, which gives nothing if swings are small."""
        if self.equivalent is not None:
            return np.array(self.equivalent)
        return np.full(len(self.outputs), float(self.controller.linear))

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest output; storage orders never leave -1 to 1."""
        low, high = self.controller.limits
        return (max(low, -1.0), min(high, 1.0)) if any(s.kind == "order" for s in self.outputs) else (low, high)

    @property
    def matrices(self) -> Matrices:
        """Its matrices at the operating point."""
        return realized(self.controller, self.names, self.rest, len(self.outputs))

    @property
    def undelayed(self) -> Matrices:
        """The same without the approximation of a continuous delay."""
        what = self.controller
        return self.matrices if what.rate else replace(self, controller=what.delayed(0.0)).matrices


def named(point: OperatingPoint, c: Controller) -> Named:
    """The signals of a controller in a case.

    Raises `StudyError` if one does not exist, the matrices do not fit, or nothing limits what an anti-windup compares.
    """
    case = point.case
    reads, drives = chosen(case, c.inputs, OUTPUTS), chosen(case, c.outputs, INPUTS)
    for signals, names in ((reads, c.inputs), (drives, c.outputs)):
        if not signals:
            raise StudyError(f"{case.name} has no signal {', '.join(names)} for {c.name}; choose another.")
    if c.law is None and (c.B.shape[1], c.C.shape[0]) != (len(reads), len(drives)):
        raise StudyError(
            f"{c.name} has matrices for {c.B.shape[1]} inputs and {c.C.shape[0]} outputs, but its "
            "signal names stand for "
            f"{len(reads)} inputs and {len(drives)} outputs in {case.name}."
        )
    seen = extended(point, (), reads)
    rest = np.array([0.0 if s.kind == "frequency" else outputs.value(seen, s)(seen.s) for s in reads])
    names = tuple(s.name for s in reads)
    driven = {driven_machine(case, s) for s in drives}
    found = Named(c, reads, drives, names, rest, driven.pop() if len(driven) == 1 else None)
    if c.tracking is not None and not (np.isfinite(found.limits).any() or c.deadband or c.ramp):
        raise StudyError(f"{c.name}: tracking acts at the limits of the outputs; give limits, such as limits=0.1.")
    return found


def driven_machine(case: Case, signal: Signal) -> int | None:
    """Number of the machine that an input belongs to, or whose storage device it drives."""
    match INPUTS[signal.kind].place:
        case "machine":
            return signal.number
        case "device":
            return case.storage[naming.row(case, "storage", str(signal.place))].machine
        case _:
            return None


def all_named(point: OperatingPoint, given: Iterable[Controller | Law]) -> list[Named]:
    """Controllers with their signals; a law of storage devices acts as its `controllers`.

    Raises `StudyError` as `named`, or if one is neither a controller nor a law.
    """
    every = [one for c in given for one in (c.controllers(point.case) if isinstance(c, Law) else (c,))]
    for c in every:
        if not isinstance(c, Controller):
            raise StudyError(
                f"{c!r} is not a Controller, so it has no linear model; give Controller.from_control(...)."
            )
    return [named(point, c) for c in every]
