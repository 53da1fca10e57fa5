"""Base class of the control laws of storage devices, and sampled laws."""

import inspect
import sys
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cache
from typing import TYPE_CHECKING, Any

from stabctl import devices
from stabctl._util.errors import StudyError, shown
from stabctl._util.jit import own
from stabctl._util.verbs import verb
from stabctl.devices.device import Device, of

from .signals import Input, StorageDevice
from .timing import checked_frames, duration

if TYPE_CHECKING:
    from stabctl.model.case import Case


class Law(ABC):
    """A law that runs inside the compiled loop.

    Attributes
    ----------
    relay
        Whether its orders switch between fixed values; the simulation then finds the instants within a step.
    inertial
        Whether its orders follow the acceleration that they cause; the simulation then solves for both at once.
    abrupt
        Whether its orders may jump, although they follow the signals; the simulation then makes shorter steps there.
    step
        Longest default step of a run with it, s.
    groups
        Machines that are seen as one: the deviation of each of them is that of the group.
    rate, frames
        Frames per second and frames of delay; a law without a rate acts at every step.
    """

    relay: bool = False
    inertial: bool = False
    abrupt: bool = False
    step: float = 1 / 120
    groups: tuple[tuple[int | str, ...], ...] = ()
    rate: int | None = None
    frames: int = 0

    def __str__(self) -> str:
        given = ((f.name, getattr(self, f.name), f.default) for f in fields(self))  # type: ignore[arg-type]
        changed = (f"{name}={value!r}" for name, value, default in given if value != default)
        return f"{type(self).__name__}({', '.join(changed)})"

    @property
    def device(self) -> Device:
        """Its equations, which are in the file of its class or of the class that this extends."""
        return _device(type(self))

    @property
    def timed(self) -> bool:
        """Whether its orders depend on the instant."""
        return self.reads("time")

    def numbers(self, case: "Case") -> tuple[tuple[int, ...], ...]:
        """The groups by numbers of machines. Raises `StudyError` for a machine that the case does not have."""
        return tuple(tuple(case.machine(n).machine for n in group) for group in self.groups)

    def reads(self, signal: str) -> bool:
        """Whether its orders depend on a signal of `Input`: whether compiled code of its file mentions that.

        Parameters
        ----------
        signal : str
            Its name, such as "time".
        """
        functions = (f for f in vars(self.device.module).values() if inspect.isfunction(f) and "inlined" in vars(f))
        return any(signal in (*f.__code__.co_names, *f.__code__.co_varnames) for f in functions)

    @abstractmethod
    def par(self, device: StorageDevice) -> Any:
        """Parameters of the compiled law for one device.

        Parameters
        ----------
        device : StorageDevice
            The device: rating, base, frequency.

        Returns
        -------
        Par
            Record of the file of the law, in pu.
        """

    def gains(self, device: StorageDevice) -> tuple[float, float, float]:
        """Slopes of the order by speed (1/pu), acceleration (s/pu) and angle (1/rad) beyond the deadband; 0: relay.

        Parameters
        ----------
        device : StorageDevice
            The device: rating, base, frequency.
        """
        return 0.0, 0.0, 0.0

    def sampled(self, rate: int, delay: str | float = 0.0) -> "SampledLaw":
        """The same law acting once per frame, with a delay.

        Parameters
        ----------
        rate : int, 1/s
            Frames per second.
        delay : str or float, s
            Time from measurement to output, a whole number of frames.
        """
        return SampledLaw(self, rate, delay)  # type: ignore[arg-type]

    save = verb("stabctl.io.control_files:save_law")
    controllers = verb("stabctl.controllers.law_controllers:controllers")


@cache
def _device(kind: type) -> Device:
    for base in kind.__mro__:
        module: Any = sys.modules.get(base.__module__)
        if module and {"NAME", "step", "__file__"} <= vars(module).keys():
            return devices.checked(module.__file__, module) if own(module.__file__) else of(module)
    raise StudyError(
        f"The law {kind.__name__} has no equations, because no file with NAME and step defines it; write the law to a "
        "file of its own, as in docs/extending.md, and import it from there."
    )


@dataclass(frozen=True)
class SampledLaw(Law):
    """A law that acts once per frame; see `Law.sampled`."""

    law: Law
    rate: int
    delay: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.law, Law) or isinstance(self.law, SampledLaw):
            raise StudyError(f"law = {shown(self.law)} is not a law that can be sampled; give BangBang(), for example.")
        object.__setattr__(self, "delay", duration("delay", self.delay))
        object.__setattr__(self, "delay", checked_frames("The law", self.rate, self.delay) / self.rate)

    def __str__(self) -> str:
        return f"{self.law}, {self.rate} times per second" + (f", delay {1e3 * self.delay:g} ms" if self.delay else "")

    @property
    def device(self) -> Device:
        """The equations of the law."""
        return self.law.device

    def reads(self, signal: str) -> bool:
        """Whether the orders of the law depend on a signal."""
        return self.law.reads(signal)

    @property
    def groups(self) -> tuple[tuple[int | str, ...], ...]:  # type: ignore[override]
        """Groups of the law."""
        return self.law.groups

    @property
    def frames(self) -> int:  # type: ignore[override]
        """Delay in frames."""
        return round(self.delay * self.rate)

    def par(self, device: StorageDevice) -> Any:
        """Parameters of the law."""
        return self.law.par(device)


def decided(law: Law, par: Any, signals: Input, voltage: float, before: Any = None) -> Any:
    """What a law gives for one device at a voltage (pu), with its parameters; `before` is what it gave last."""
    device = law.device
    known = {"u": signals, "v": (voltage, 0.0), "y": device.start if before is None else before, "p": par}
    return device.evaluate("step", known)
