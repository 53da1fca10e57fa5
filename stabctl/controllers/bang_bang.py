"""Bang-bang law: full power by the sign of the speed deviation (the paper, section 5, eq. (40) and Table 3)."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl._util.validation import guard
from stabctl.devices.blocks import magnitude

from .law import Law
from .signals import Input, Output, StorageDevice

NAME = "bang-bang"
ROLE = "controller"
__all__ = ["NAME", "ROLE", "BangBang", "Input", "Output", "Par", "step"]


class Par(NamedTuple):
    """Parameters for one device."""

    deadband: Annotated[float, "pu", "speed deviation without action"]
    gate: Annotated[float, "pu", "voltage below which the device idles"]


@inline
def step(u, v, p):
    """Order in ratings: absorb (1) when fast, inject (-1) when slow, idle within the deadband or at low voltage."""
    if magnitude(v[0], v[1]) < p.gate or -p.deadband <= u.deviation <= p.deadband:
        return Output(0.0)
    return Output(1.0 if u.deviation > 0 else -1.0)


@dataclass(frozen=True)
class BangBang(Law):
    """The bang-bang law (the paper, section 5, eq. (40)).

    Parameters
    ----------
    deadband : float or str, Hz
        Speed deviation below which a device idles; text such as "100mHz".
    min_voltage : float, pu
        Voltage below which a device idles.

    Raises
    ------
    StudyError
        For a negative or infinite value.

    Examples
    --------
    >>> law = st.BangBang(deadband="50mHz", min_voltage=0.7)
    >>> st.load("two_area").clearing_time("7-8@0.4", storage="50MW", control=law, resolution="1cyc").cycles
    30.0
    """

    deadband: Annotated[float, "Hz", "speed deviation without action", NOT_NEGATIVE] = 0.1
    min_voltage: Annotated[float, "pu", "voltage below which the device idles", NOT_NEGATIVE] = 0.8
    relay = True

    def __post_init__(self) -> None:
        guard(self)

    def par(self, device: StorageDevice) -> Par:
        """Parameters in pu."""
        return Par(self.deadband / device.frequency, self.min_voltage)
