"""Control laws of the storage devices.

A law is a frozen record with `par(device)`, its constants, and `module`, the file with its equations: a device with the
role "controller" whose `step` gives the order of a storage device. RELAY = True in that file says that the order
switches between fixed values; the simulation then finds the instants within a step. A new law is one file.
"""

from types import ModuleType
from typing import Any, Protocol, runtime_checkable

from .bang_bang import BangBang
from .controller import Controller
from .feedback import Feedback
from .gate import Gate
from .python_law import Seen
from .signals import Device, Input


@runtime_checkable
class Law(Protocol):
    """A law that runs inside the compiled loop."""

    @property
    def module(self) -> ModuleType:
        """The file with its equations."""
        ...

    def par(self, device: Device) -> Any:
        """Parameters of the law for a device."""
        ...


def wanted(law: Law, par: Any, signals: Input, voltage: float) -> float:
    """Order of one device, in ratings (positive when absorbing), from a law with its parameters, at a voltage (pu)."""
    return float(law.module.step(signals, (voltage, 0.0), par).wanted)


__all__ = ["BangBang", "Controller", "Device", "Feedback", "Gate", "Input", "Law", "Seen", "wanted"]
