"""Kinds of device inputs: a plain signal, a port with a set-point, a summing port, or a remote signal.

An input with the name of a signal of its unit (a state or output of the machine, an output of one of its controls)
reads that signal. The markers below, in the `Annotated` hint of an input, give the other kinds.
"""

from typing import NamedTuple


class Port(NamedTuple):
    """An input that another device can drive with an output of the same name.

    If none does, it is a set-point: solved for at initialization, or fixed at `start` if that is a number. A summing
    port adds up everything that drives it, and is zero if nothing does.
    """

    summing: bool = False
    start: float | None = None


PORT = Port()
SUM = Port(summing=True)


def fixed(value: float) -> Port:
    """A port whose set-point starts at this value instead of being solved for."""
    return Port(start=value)


class At(NamedTuple):
    """A remote input: `signal` at the bus or machine whose number is the parameter `place` (0: its own).

    `signal` is the name of a sensor (`bus_voltage`, `bus_frequency`) for a bus, else of a signal of that machine.
    """

    signal: str
    place: str
