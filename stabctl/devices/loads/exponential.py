"""Exponential load: P = P0 (V/V0)^a, Q = Q0 (V/V0)^b, with the power P0 + jQ0 at the voltage V0 of the power flow.

The current into the network is -conj(S(m)/m^2) V with m = max(|V|, vlow). Below vlow the load changes continuously to a
constant admittance, so that the network always has a solution. Exponents of 0, 1 and 2 mean constant power, current and
admittance.
Source: Kundur, Power System Stability and Control, section 7.1.1, eq. (7.1); typical exponents in table 7.1.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE
from stabctl.devices.blocks import at_least, magnitude, power

NAME = "exponential load"
ROLE = "load"


class Par(NamedTuple):
    """Parameters of one load."""

    P0: Annotated[float, "pu", "active power at V0, system base", FROM_CASE]
    Q0: Annotated[float, "pu", "reactive power at V0, system base", FROM_CASE]
    V0: Annotated[float, "pu", "voltage of the power flow", FROM_CASE]
    vlow: Annotated[float, "pu", "voltage below which the load is an admittance", FROM_CASE]
    a: Annotated[float, "-", "exponent of the active power"]
    b: Annotated[float, "-", "exponent of the reactive power"]


@inline
def current(v, p):
    """Current into the network (pu), real and imaginary part."""
    m = at_least(magnitude(v[0], v[1]), p.vlow)
    g, b = p.P0 / (m * m) * power(m / p.V0, p.a), p.Q0 / (m * m) * power(m / p.V0, p.b)
    return -(g * v[0] + b * v[1]), b * v[0] - g * v[1]
