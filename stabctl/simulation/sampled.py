"""Controllers outside the compiled loop: they see the system at frames and hold their orders in between."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from .simulation import Simulation


@runtime_checkable
class Sampled(Protocol):
    """A controller with a frame rate. `stabctl.estimate` has those that use PMU signals."""

    @property
    def rate(self) -> int:
        """Frames per second."""
        ...

    def pilot(self, simulations: "Sequence[Simulation]") -> Callable[[], None]:
        """What is called at every frame, the first one included, to set the orders of these simulations."""
        ...


def carry(simulations: "Sequence[Simulation]", pilot: Callable[[], None], rate: int, until: float) -> None:
    """Advance simulations at the same instant to `until` (s), a frame at a time, while any is running."""
    start, k = simulations[0].time, 0
    while start + k / rate < until - 1e-9 and any(s.outcome is None for s in simulations):
        pilot()
        k += 1
        for simulation in simulations:
            simulation.advance(min(start + k / rate, until))
