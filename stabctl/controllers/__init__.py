"""Control laws of the storage devices, and the signals they see.

A law is a frozen record with `par(device) -> signals.Par`, and a kernel that `laws.order` calls by its kind. Orders may
also be set from outside the compiled loop, between calls of `Simulation.advance`.
"""

from typing import Protocol

from .bang_bang import BangBang
from .feedback import Feedback
from .laws import order
from .signals import Device, Par, Seen


class Law(Protocol):
    """A law that runs inside the compiled loop."""

    def par(self, device: Device) -> Par:
        """Constants of the law for a device."""
        ...


__all__ = ["BangBang", "Device", "Feedback", "Law", "Par", "Seen", "order"]
