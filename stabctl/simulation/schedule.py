"""Orders of storage devices laid down in advance, played back at frames; then a law may take over."""

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.controllers import BangBang, Controller

if TYPE_CHECKING:
    from stabctl.dynamics.operating_point import OperatingPoint
    from stabctl.model.tables import Storage

    from .simulation import Simulation


@dataclass(frozen=True, eq=False)
class Schedule:
    """Orders of the storage devices by time: an open-loop control.

    Parameters
    ----------
    orders : (frames, devices) array
        Orders in ratings, -1 to 1, positive to absorb; each is held for a frame.
    rate : float, 1/s
        Frames per second.
    start : float, s
        Instant of the first frame. Before it the devices are idle.
    min_voltage : float, pu
        Voltage below which a device is idle, as under the laws; 0 for none.
    law : BangBang, optional
        Law that takes over after the last frame, with its own deadband; by default the devices are then idle.

    Raises
    ------
    StudyError
        If an order is not between -1 and 1.
    """

    orders: np.ndarray
    _: KW_ONLY
    rate: float = 60
    start: float = 0.0
    min_voltage: float = 0.8
    law: BangBang | None = None
    controllers: ClassVar[tuple[Controller, ...]] = ()
    timed: ClassVar[bool] = True

    def __post_init__(self) -> None:
        orders = np.array(self.orders, float)
        if orders.ndim != 2 or not (np.abs(orders) <= 1 + 1e-9).all():
            raise StudyError("A schedule is a table of orders from -1 to 1: a row per frame, a column per device.")
        orders.setflags(write=False)
        object.__setattr__(self, "orders", orders)

    def pilot(self, simulations: "Sequence[Simulation]") -> Callable[[], None]:
        """The function that sets the orders at every frame."""
        point = simulations[0].point
        if self.orders.shape[1] != len(point.case.storage):
            raise StudyError(
                f"The schedule has orders for {self.orders.shape[1]} devices, but {point.case.name} has "
                f"{len(point.case.storage)}."
            )
        bus = [point.net.place[s.bus] for s in point.case.storage]
        own = [_rotor(point, s) for s in point.case.storage] if self.law else []

        def frame() -> None:
            for one in simulations:
                k = int(np.floor((one.time - self.start) * self.rate + 1e-6))
                wanted = self._orders(k, one, own)
                one.orders[:] = np.where(np.abs(one.V[bus]) < self.min_voltage, 0.0, wanted)

        return frame

    def _orders(self, k: int, simulation: "Simulation", own: Sequence[int]) -> np.ndarray:
        idle = np.zeros(self.orders.shape[1])
        if 0 <= k < len(self.orders):
            return self.orders[k]
        if k < 0 or self.law is None:
            return idle
        rotors, w = simulation.point.rotors, simulation.speed
        island = simulation.island[rotors.unit]
        for j, i in enumerate(own):
            rest = (island == island[i]) & (np.arange(len(w)) != i)
            if island[i] >= 0 and rest.any():
                deviation = w[i] - rotors.inertia[rest] @ w[rest] / rotors.inertia[rest].sum()
                if abs(deviation) > self.law.deadband / simulation.point.case.frequency_hz:
                    idle[j] = np.sign(deviation)
        return idle


def _rotor(point: "OperatingPoint", device: "Storage") -> int:
    """The number of the rotor whose speed the law reads."""
    if device.machine not in point.rotor_numbers:
        called = point.case.called[device.machine]
        raise StudyError(
            f"The storage at bus {device.bus} belongs to {called}, which has no rotor in {point.case.name}, so "
            "no law can take over after the schedule; give law=None."
        )
    return point.rotor_numbers.index(device.machine)
