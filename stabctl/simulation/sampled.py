"""Controllers outside the compiled loop: they are called at a fixed rate and their orders are held in between."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from .simulation import Simulation


@runtime_checkable
class Sampled(Protocol):
    """A controller with a frame rate. Those that use PMU signals are in `stabctl.estimation`."""

    @property
    def rate(self) -> int:
        """Frames per second."""
        ...

    def pilot(self, simulations: "Sequence[Simulation]") -> Callable[[], None]:
        """The function called at every frame, including the first, to set the orders of these simulations."""
        ...


def carry(simulations: "Sequence[Simulation]", pilot: Callable[[], None], rate: int, until: float) -> None:
    """Advance simulations at the same instant to `until` (s), a frame at a time, while any is running."""
    for simulation in simulations:
        simulation.affordable(until)
    start, k = simulations[0].time, 0
    while start + k / rate < until - 1e-9 and any(s.outcome is None for s in simulations):
        pilot()
        k += 1
        for simulation in simulations:
            simulation.advance(min(start + k / rate, until))
