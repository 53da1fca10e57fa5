"""Controllers outside the compiled loop: they are called at a fixed rate and their orders are held in between."""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from stabctl.controllers import Law
    from stabctl.controllers.controller import Controller

    from .simulation import Simulation


Pilot = tuple[float, Callable[[], None]]


@runtime_checkable
class Sampled(Protocol):
    """A controller with a frame rate. Those that use PMU signals are in `stabctl.estimation`."""

    @property
    def rate(self) -> float:
        """Frames per second."""
        ...

    @property
    def law(self) -> "Law | None":
        """The storage law whose orders it sets, if any."""
        ...

    @property
    def controllers(self) -> "tuple[Controller, ...]":
        """Controllers whose inputs it sets."""
        ...

    def pilot(self, simulations: "Sequence[Simulation]") -> Callable[[], None]:
        """The function called at every frame, including the first, to set the orders of these simulations."""
        ...


def carry(simulations: "Sequence[Simulation]", pilots: "Sequence[Pilot]", ends: Iterable[float]) -> None:
    """Advance simulations at the same instant to each of `ends` (s), from frame to frame, while any is running.

    Each pilot is a rate (1/s) and the function called at its frames, which begin at the present instant.
    """
    start, now = simulations[0].time, simulations[0].time
    counts = [0] * len(pilots)
    for until in ends:
        for simulation in simulations:
            simulation.affordable(until)
        while now < until - 1e-9 and any(s.outcome is None for s in simulations):
            for k, (rate, frame) in enumerate(pilots):
                if start + counts[k] / rate <= now + 1e-9:
                    frame()
                    counts[k] += 1
            now = min([until, *(start + n / rate for n, (rate, _) in zip(counts, pilots, strict=True))])
            for simulation in simulations:
                simulation.advance(now)
