"""Loop gains: each controller output opened in turn, all others closed, sampling and delay exact."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stabctl.controllers.controller import Controller
from stabctl.dynamics.named import named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.smallsignal.opened_loop import alone, linear_loop

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
    """The loop gains of the first 12 outputs, as if without deadband or relay; see `linear_loop`."""
    loop = linear_loop(point, [named(point, replace(c, deadband=0.0, relay=False)) for c in controllers])
    if loop is None:
        return ()
    hz = HZ[loop.rate / 2 > HZ] if loop.rate else HZ
    G = np.array([loop(2j * np.pi * f)[0] for f in hz])
    return tuple(LoopGain(name, hz, -alone(G, np.ones(len(loop.names)), r)) for r, name in enumerate(loop.names[:MOST]))
