"""What a storage controller sees of its machine, and the constants of its law."""

from typing import Annotated, NamedTuple


class Seen(NamedTuple):
    """Signals at one device, at the start of a step."""

    deviation: Annotated[float, "pu", "own speed less the COI speed of the rest of the island"]
    acceleration: Annotated[float, "pu/s", "its rate, as last evaluated"]
    voltage: Annotated[float, "pu", "voltage magnitude at the device"]


class Par(NamedTuple):
    """Constants of the law of one device."""

    kind: Annotated[float, "-", "number of the law in `laws.order`"]
    deadband: Annotated[float, "pu", "speed deviation without action"]
    gate: Annotated[float, "pu", "voltage below which the device idles"]
    speed_gain: Annotated[float, "1/pu", "order over speed deviation"] = 0.0
    acceleration_gain: Annotated[float, "s/pu", "order over acceleration"] = 0.0


class Device(NamedTuple):
    """What a law needs to know of a device to set its constants."""

    rating: Annotated[float, "MW", "largest power"]
    machine: Annotated[float, "MVA", "base of its machine"]
    frequency: Annotated[float, "Hz", "of the system"]
