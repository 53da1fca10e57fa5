"""Inputs and output of a storage control law, and the device data it may use.

The group of a machine is the machine alone, unless the law names groups.
"""

from typing import Annotated, NamedTuple

from stabctl.devices.ports import fixed


class Input(NamedTuple):
    """Signals of a machine with storage, at the start of a step."""

    deviation: Annotated[float, "pu", "COI speed of its group minus that of the rest of the island", fixed(0.0)]
    acceleration: Annotated[float, "pu/s", "rate of the deviation, as last evaluated", fixed(0.0)]
    angle: Annotated[float, "rad", "COI angle of its group minus that of the rest, less its start", fixed(0.0)] = 0.0
    energy: Annotated[float, "pu s", "energy in the device, system base", fixed(0.0)] = 0.0
    time: Annotated[float, "s", "start of the present step", fixed(0.0)] = 0.0


class Output(NamedTuple):
    """Output of a law."""

    wanted: Annotated[float, "-", "order in ratings, positive to absorb"]


class StorageDevice(NamedTuple):
    """What a law needs to know of a device to set its constants."""

    rating: Annotated[float, "MW", "largest power"]
    machine: Annotated[float, "MVA", "base of its machine"]
    frequency: Annotated[float, "Hz", "of the system"]
    system: Annotated[float, "MVA", "base of the system"] = 100.0
    stored: Annotated[float, "pu s", "initial energy, system base"] = 0.0
