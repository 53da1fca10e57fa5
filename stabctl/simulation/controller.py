"""A storage control law written in Python: a function called at a fixed rate that returns the storage orders."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError

if TYPE_CHECKING:
    from .simulation import Simulation

FASTEST = 10_000  # frames per second


class Snapshot(NamedTuple):
    """The system at one frame; devices, machines (those with a rotor) and buses in the order of the case's tables."""

    time: float  # s
    deviation: np.ndarray  # (devices) pu   speed of its machine minus the COI speed of the others; nan without a rotor
    voltage: np.ndarray  # (devices) pu   magnitude at the device
    speed: np.ndarray  # (machines) pu
    angle: np.ndarray  # (machines) rad
    V: np.ndarray  # (buses) complex, pu


@dataclass(frozen=True)
class Controller:
    """A control law of the storage devices, called `rate` times per second; its orders are held in between.

    Parameters
    ----------
    law : callable, or class of callables
        Takes a `Snapshot` and returns the orders of the devices, or one for all, in per unit of the ratings: 1 absorbs
        the full rating, -1 injects it, and values beyond are clipped. A law with memory is a class; every run creates
        its own instance.
    rate : int, 1/s
        Frames per second.

    Examples
    --------
    >>> damper = Controller(lambda seen: 100 * seen.deviation, rate=60)
    """

    law: Callable[[Snapshot], Any] | type
    rate: int = 60

    def __post_init__(self) -> None:
        if not callable(self.law):
            raise StudyError(
                f"{self.law!r} is not a control law; give a function of a snapshot, such as "
                "lambda seen: 100 * seen.deviation."
            )
        if isinstance(self.rate, bool) or not isinstance(self.rate, int) or not 1 <= self.rate <= FASTEST:
            raise StudyError(f"The rate of {self.rate!r} frames a second is not allowed; give 1 to {FASTEST}.")

    def pilot(self, simulations: "Sequence[Simulation]") -> Callable[[], None]:
        """The function called at every frame to set the orders of these simulations."""
        laws = [self.law() if isinstance(self.law, type) else self.law for _ in simulations]
        watch = _Watch(simulations[0].point)

        def frame() -> None:
            for law, simulation in zip(laws, simulations, strict=True):
                if simulation.outcome is None:
                    simulation.orders[:] = _orders(law(watch.snapshot(simulation)), simulation)

        return frame


class _Watch:
    """Where the devices of an operating point are."""

    def __init__(self, point: OperatingPoint) -> None:
        rows = {m.machine: i for i, m in enumerate(point.case.machines)}
        self.unit = np.array([rows[s.machine] for s in point.case.storage], int)
        self.bus = np.array([point.net.place[s.bus] for s in point.case.storage], int)
        self.rotors, self.inertia = point.rotors.unit, point.inertia
        self.own = self.unit[:, None] == self.rotors  # (devices, rotor units) is it the device's?

    def snapshot(self, now: "Simulation") -> Snapshot:
        """The system as it is now."""
        V, speed, island = now.V, now.speed, now.island
        others = (island[self.unit, None] == island[self.rotors]) & (island[self.rotors] >= 0) & ~self.own
        own = np.where(self.own.any(axis=1), self.own @ speed, np.nan)
        weight = others @ self.inertia
        rest = np.divide(others @ (self.inertia * speed), weight, out=own.copy(), where=weight > 0)
        return Snapshot(now.time, own - rest, np.abs(V[self.bus]), speed, now.angle, V)


def _orders(given: Any, simulation: "Simulation") -> np.ndarray:
    """The orders as numbers within -1 to 1."""
    try:
        orders = np.broadcast_to(np.asarray(given, float), simulation.orders.shape)
    except (TypeError, ValueError):
        orders = np.array([np.nan])
    if not np.isfinite(orders).all():
        raise StudyError(
            f"The law gave {given!r} at {simulation.time:.3f} s; it must give a number for every storage device "
            f"({len(simulation.orders)}), or one for all."
        )
    return np.clip(orders, -1, 1)
