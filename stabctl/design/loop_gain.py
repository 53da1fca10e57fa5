"""Loop gains: each controller output opened in turn, all others closed, sampling and delay exact."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stabctl.controllers.controller import Controller
from stabctl.dynamics.named import Named, named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.smallsignal.opened_loop import OpenedLoop

HZ = np.geomspace(0.05, 10.0, 240)
MOST = 12  # loops that are shown


@dataclass(frozen=True, repr=False)
class LoopGain:
    """The loop gain at one output, with the sign of a negative feedback: stability is lost where it is -1.

    Attributes
    ----------
    name
        Controller and input that it drives.
    hz
        Frequencies (frequencies).
    response
        L(jw) (frequencies), complex.
    """

    name: str
    hz: np.ndarray
    response: np.ndarray

    @property
    def distance(self) -> float:
        """Least distance of L(jw) from -1: the smallest change of the loop gain that makes it unstable."""
        return float(np.abs(1 + self.response).min())

    @property
    def phase_margin(self) -> float:
        """Smallest angle (deg) between L(jw) and -1 where its size is 1; inf if it never is."""
        size = np.abs(self.response)
        crossing = np.flatnonzero((size[:-1] - 1) * (size[1:] - 1) < 0)
        angles = [np.angle(-self.response[k + (abs(size[k + 1] - 1) < abs(size[k] - 1))], deg=True) for k in crossing]
        return float(min(np.abs(angles), default=np.inf))


def loop_gains(point: OperatingPoint, controllers: Sequence[Controller]) -> tuple[LoopGain, ...]:
    """The loop gains of the first 12 outputs; none if sampled controllers have several rates."""
    parts = [part for c in controllers for part in _outputs(named(point, c))]
    if len({c.rate for c in parts if c.rate}) > 1:
        return ()
    found = []
    for k, part in enumerate(parts[:MOST]):
        if part.rate is None and any(c.rate for c in parts):
            continue  # seen from a continuous output, the other loops are not time-invariant
        opened = [replace(c, limits=(-1.0, 1.0) if j == k else (-np.inf, np.inf)) for j, c in enumerate(parts)]
        try:
            loop = OpenedLoop(point, [named(point, c) for c in opened], ())
        except StudyError:
            continue
        hz = HZ[part.rate / 2 > HZ] if part.rate else HZ
        response = np.array([-loop(2j * np.pi * f)[0][0, 0] for f in hz])
        found.append(LoopGain(f"{part.name}: {part.outputs[0]}", hz, response))
    return tuple(found)


def _outputs(c: Named) -> list[Controller]:
    """A controller as several with one output each, without what has no linear model."""
    what = replace(c.controller, deadband=0.0, relay=False, tracking=None, gate=None)
    names = [s.kind if s.place is None else f"{s.kind}:{s.place}" for s in c.outputs]
    return [replace(what, outputs=(name,), C=what.C[[j]], D=what.D[[j]]) for j, name in enumerate(names)]
