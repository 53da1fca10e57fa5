"""Bang-bang law: full power by the sign of the speed deviation (the paper, section 5, eq. (40) and Table 3)."""

from dataclasses import dataclass
from typing import Annotated

from stabctl._util.guard import guard
from stabctl._util.jit import inline
from stabctl.schema import NOT_NEGATIVE

from .signals import Device, Par

KIND = 1.0


@inline
def order(seen, p):
    """Order in ratings: absorb (1) when fast, inject (-1) when slow, idle within the deadband or at low voltage."""
    if seen.voltage < p.gate or -p.deadband <= seen.deviation <= p.deadband:
        return 0.0
    return 1.0 if seen.deviation > 0 else -1.0


@dataclass(frozen=True)
class BangBang:
    """The bang-bang law with its two thresholds; the deadband may be text, as "100mHz"."""

    deadband: Annotated[float, "Hz", "speed deviation without action", NOT_NEGATIVE] = 0.1
    min_voltage: Annotated[float, "pu", "voltage below which the device idles", NOT_NEGATIVE] = 0.8

    def __post_init__(self) -> None:
        guard(self)

    def par(self, device: Device) -> Par:
        """Constants in pu."""
        return Par(KIND, self.deadband / device.frequency, self.min_voltage)
