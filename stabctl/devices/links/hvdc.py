"""HVDC link seen from its terminals: a constant current drawn at the rectifier, and one injected at the inverter.

The terminals are constant-current devices of unity power factor: P at the voltages of the power flow, in proportion to
the voltage elsewhere, and a constant admittance below vlow.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, magnitude

NAME = "HVDC"
ROLE = "link"


class Par(NamedTuple):
    """Constants of one link."""

    Prec: Annotated[float, "pu", "power drawn at the rectifier, at 1 pu voltage"]
    Pinv: Annotated[float, "pu", "power injected at the inverter, at 1 pu voltage"]
    vlow: Annotated[float, "pu", "voltage below which a terminal is an admittance"]


@inline
def terminal(P, v, vlow):
    """Current into the network (pu) of a terminal that injects P at 1 pu voltage."""
    g = P / at_least(magnitude(v[0], v[1]), vlow)
    return g * v[0], g * v[1]


@inline
def current(v1, v2, p):
    """Currents into the network at the rectifier and at the inverter (pu), real and imaginary parts."""
    a, b = terminal(-p.Prec, v1, p.vlow)
    c, d = terminal(p.Pinv, v2, p.vlow)
    return a, b, c, d
