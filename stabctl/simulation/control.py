"""What acts on a simulation: a storage law, controllers, and what is called from outside at frames.

Laws, and controllers with matrices, are compiled. A Python function, or a controller that uses PMU signals, is called
between steps at a fixed rate, and what it gives is held until its next frame.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl.controllers import Law
from stabctl.controllers.controller import Controller
from stabctl.controllers.python_law import Seen, answer
from stabctl.model.case import Case

from .attached import Called
from .lti import shape
from .outcome import Outcome


@runtime_checkable
class Sampled(Protocol):
    """A controller with a frame rate. Those that use PMU signals are in `stabctl.estimation`."""

    @property
    def rate(self) -> float:
        """Frames per second."""
        ...

    @property
    def law(self) -> Law | None:
        """The storage law whose orders it sets, if any."""
        ...

    @property
    def timed(self) -> bool:
        """Whether it has instants of its own, other than those of its law and controllers."""
        ...

    @property
    def controllers(self) -> tuple[Controller, ...]:
        """Controllers whose inputs it sets."""
        ...

    def pilot(self, simulations: Sequence[Any]) -> Callable[[], None]:
        """The function called at every frame, including the first, to set the orders of these simulations."""
        ...


Control = Law | Sampled | Controller | Sequence[Law | Sampled | Controller] | None


@dataclass(frozen=True)
class Acting:
    """The parts of what a study is given as `control`."""

    law: Law | None = None  # acts at every step
    pilots: tuple[Sampled, ...] = ()
    controllers: tuple[Controller, ...] = ()
    measured: tuple[Controller, ...] = ()  # that read what a pilot measures

    @property
    def timed(self) -> bool:
        """Whether instants matter: a gate opens or closes, PMUs fail, or a law or Python function reads the time."""
        timed = (c.law or (c.gate and c.gate.timed) for c in (*self.controllers, *self.measured))
        laws = self.law, *(pilot.law for pilot in self.pilots)
        return any(timed) or any(pilot.timed for pilot in self.pilots) or any(law.timed for law in laws if law)


def acting(control: Any, storage: bool = True) -> Acting:
    """The parts of a control, checked.

    Parameters
    ----------
    control : control law, Controller, sequence of them, or None
        What a study was given.
    storage : bool
        Whether the case has storage devices, which laws need.

    Raises
    ------
    StudyError
        If something is not a controller, or there are two laws for the same storage devices.
    """
    several = control if isinstance(control, list | tuple) else () if control is None else (control,)
    laws: list[Any] = []
    controllers: list[Controller] = []
    pilots: list[Sampled] = []
    for one in several:
        if isinstance(one, type):
            raise StudyError(f"control = {one.__name__} is a class; give an instance, {one.__name__}().")
        if isinstance(one, Controller):
            controllers.append(one)
        elif not isinstance(one, Law) and isinstance(one, Sampled):  # the check of a protocol is slow
            pilots.append(one)
        elif not callable(getattr(one, "par", None)):
            raise StudyError(
                f"control = {shown(one)} is not a control law; give BangBang(), Feedback(...) or a Controller."
            )
        elif not storage:
            raise StudyError(
                f"{type(one).__name__} needs storage devices to control; give storage='50MW', for example."
            )
        else:
            laws.append(one)
    if len(pilots) > 1:
        raise StudyError("Give one EstimatorControl, with all controllers behind the estimator in a list.")
    if len(laws) + sum(p.law is not None for p in pilots) > 1:
        raise StudyError("Give one storage law; further controllers are made with Controller.")
    measured = tuple(c for p in pilots for c in p.controllers)
    return Acting(laws[0] if laws else None, tuple(pilots), tuple(controllers), measured)


def with_law(several: Sequence[Law | Controller], law: Law) -> list[Law | Controller]:
    """The controllers, with a law beside them unless one of them is a law or gives orders."""
    own = [c for c in several if isinstance(c, Controller)]
    return [*several] if len(own) < len(several) or ordered(own) else [law, *several]


def ordered(controllers: Sequence[Controller]) -> bool:
    """Whether controllers give orders of active power to storage devices, which then need no law."""
    return any(name.startswith(("order:", "order ")) or name == "order" for c in controllers for name in c.outputs)


def idle(case: Case, control: Control) -> bool:
    """Whether a case has storage devices to which the control gives no orders, of whatever kind."""
    parts = acting(control)
    laws = parts.law, *(pilot.law for pilot in parts.pilots)
    outputs = (name for c in (*parts.controllers, *parts.measured) for name in c.outputs)
    commanded = any(law is not None for law in laws) or any("order" in name for name in outputs)
    return any(s.rating for s in case.storage) and not commanded


class Running(Protocol):
    """A `Simulation` that is under way, as far as frames use it."""

    time: float
    outcome: Outcome | None

    @property
    def island(self) -> np.ndarray:
        """Island numbers (units) now."""
        ...

    def at_frame(self) -> np.ndarray:
        """Every signal now."""
        ...

    def affordable(self, until: float) -> None:
        """Raise `StudyError` if a run to an instant (s) takes too many steps."""
        ...

    def advance(self, until: float, beyond: float | None = None) -> bool:
        """Advance to an instant (s), with the steps of an advance beyond it; returns whether the run continues."""
        ...


Pilot = tuple[float, Callable[[], None]]  # a rate (1/s), and what is called at its frames


def carry(simulations: Sequence[Running], pilots: Sequence[Pilot], ends: Iterable[float]) -> None:
    """Advance simulations at the same instant to each of `ends` (s), from frame to frame, while any is running.

    Frames begin at the present instant.
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
            following = min(start + n / rate for n, (rate, _) in zip(counts, pilots, strict=True))
            now = min(until, following)
            for simulation in simulations:
                simulation.advance(now, following)


class Frames:
    """The frames of a Python function in one simulation: it reads, and its outputs are held."""

    def __init__(self, called: Called, simulation: Running) -> None:
        what = called.named.controller
        self._called, self._what, self._simulation = called, what, simulation
        self._rest()

    def _rest(self) -> None:
        """States, and an instance of a class, as at the start, and nothing on its way."""
        law = self._what.law
        assert law is not None
        self._law: Callable[..., Any] = law() if isinstance(law, type) else law
        self._x = np.array(self._what.start, float)
        self._late = [np.zeros(self._called.held.stop - self._called.held.start)] * self._what.frames

    def __call__(self) -> None:
        """One frame."""
        simulation, named, what = self._simulation, self._called.named, self._what
        if simulation.outcome is not None:
            return
        s = simulation.at_frame()
        if (s[self._called.gates] <= 0).any():
            self._rest()
            s[self._called.held] = 0.0
            return
        values, units, island = s[self._called.reads] - named.rest, self._called.units, simulation.island
        if island.min() < 0:
            values[(units >= 0) & (island[units] < 0)] = 0.0  # of a machine that is off
        seen = Seen(named.names, values, named.rest, simulation.time)
        u, self._x = answer(self._law, seen, self._x, len(named.outputs), what.name)
        self._late.append(u.real)
        low, high = named.limits
        late = [shape(value, low, high, what.deadband, what.relay) for value in self._late.pop(0).tolist()]
        held = s[self._called.held]
        reach = what.ramp / (what.rate or 1)
        held[:] = np.clip(late, held - reach, held + reach) if reach else late
