"""HVDC link: constant current drawn at the rectifier, constant current injected at the inverter.

rectifier bus -> P -> [dc line, losses] -> P - loss -> inverter bus

Both terminals have unity power factor and carry the scheduled power at their power-flow voltages. The power is
proportional to the voltage; below vlow a terminal is a constant admittance. Converter controls (Kundur, Power System
Stability and Control, ch. 10) are not represented: in a fault at one converter, the current of the other goes on.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, magnitude

NAME = "HVDC"
ROLE = "link"


class Par(NamedTuple):
    """Parameters of one link."""

    Prec: Annotated[float, "pu", "power drawn at the rectifier, at 1 pu voltage"]
    Pinv: Annotated[float, "pu", "power injected at the inverter, at 1 pu voltage"]
    vlow: Annotated[float, "pu", "voltage below which a terminal is an admittance"]


def blocked(p: Par) -> Par:
    """Constants of the link while a terminal is in an island without a source: no current at either."""
    return p._replace(Prec=0.0, Pinv=0.0)


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
