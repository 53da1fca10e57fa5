"""Inputs and output of a storage control law, and the device data it may use."""

from typing import Annotated, NamedTuple

from stabctl.devices.ports import fixed


class Input(NamedTuple):
    """Signals of a machine with storage, at the start of a step."""

    deviation: Annotated[float, "pu", "own speed minus the COI speed of the rest of the island", fixed(0.0)]
    acceleration: Annotated[float, "pu/s", "rate of the deviation, as last evaluated", fixed(0.0)]


class Output(NamedTuple):
    """Output of a law."""

    wanted: Annotated[float, "-", "order in ratings, positive to absorb"]


class Device(NamedTuple):
    """What a law needs to know of a device to set its constants."""

    rating: Annotated[float, "MW", "largest power"]
    machine: Annotated[float, "MVA", "base of its machine"]
    frequency: Annotated[float, "Hz", "of the system"]
