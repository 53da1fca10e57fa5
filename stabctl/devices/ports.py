"""What an input of a device is: a plain signal, a port with a set-point, a summing port, or a signal elsewhere.

An input named like a signal of its unit (a state or output of the machine, an output of one of its controls) reads that
signal. The markers below stand in the `Annotated` hint of an input and say what else it may be.
"""

from typing import NamedTuple


class Port(NamedTuple):
    """An input that a control, a stabilizer or a designed controller may fill with an output of the same name.

    If nothing fills it, it is a set-point: solved for at initialization, or `start` where that is a number. A summing
    port adds up whatever fills it and is zero where nothing does.
    """

    summing: bool = False
    start: float | None = None


PORT = Port()
SUM = Port(summing=True)


def fixed(value: float) -> Port:
    """A port whose set-point starts at this value instead of being solved for."""
    return Port(start=value)


class At(NamedTuple):
    """An input from elsewhere: `signal` at the bus or machine whose number is the parameter `place` (0: its own).

    `signal` is the name of a sensor (`bus_voltage`, `bus_frequency`) for a bus, else of a signal of that machine.
    """

    signal: str
    place: str
