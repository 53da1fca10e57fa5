"""Inputs and output of a storage law, and what it may know about its device."""

from typing import Annotated, NamedTuple

from stabctl.devices.ports import fixed


class Input(NamedTuple):
    """Signals of a machine with storage, at the start of a step."""

    deviation: Annotated[float, "pu", "own speed less the COI speed of the rest of the island", fixed(0.0)]
    acceleration: Annotated[float, "pu/s", "its rate, as last evaluated", fixed(0.0)]


class Output(NamedTuple):
    """Output of a law."""

    wanted: Annotated[float, "-", "order, in ratings, absorbing positive"]


class Device(NamedTuple):
    """What a law needs to know of a device to set its constants."""

    rating: Annotated[float, "MW", "largest power"]
    machine: Annotated[float, "MVA", "base of its machine"]
    frequency: Annotated[float, "Hz", "of the system"]
