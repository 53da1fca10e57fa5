"""IEEL: load as three powers of the voltage, with a part that follows the frequency.

P = P0 g(V)/g(V0) (1 + a7 df),   g(V) = a1 V^n1 + a2 V^n2 + a3 V^n3
Q = Q0 h(V)/h(V0) (1 + a8 df),   h(V) = a4 V^n4 + a5 V^n5 + a6 V^n6

P0 + jQ0 is drawn at the voltage V0 of the power flow, and df (pu) is the frequency deviation of the bus: the rate of
its voltage angle as in the bus frequency sensor, through a lag of the same T = 20 ms. Below vlow the load changes
continuously to a constant admittance, so that the network always has a solution.
Source: PSS/E Model Library, IEELBL, IEELOW, IEELZN, IEELAR, IEELAL; IEEE Task Force on Load Representation for Dynamic
Performance, Load Representation for Dynamic Performance Analysis, IEEE Trans. Power Systems 8(2), 1993.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE
from stabctl.devices.blocks import angle, at_least, magnitude

NAME = "IEEL"
ROLE = "load"
ANGLES = ("theta",)
ORDER = "a1 a2 a3 a4 a5 a6 a7 a8 n1 n2 n3 n4 n5 n6"
DYR = {f"IEEL{scope}": ORDER for scope in ("BL", "OW", "ZN", "AR", "AL")}
T = 0.02  # s   frequency filter


class Par(NamedTuple):
    """Parameters of one load."""

    P0: Annotated[float, "pu", "active power at V0, system base", FROM_CASE]
    Q0: Annotated[float, "pu", "reactive power at V0, system base", FROM_CASE]
    V0: Annotated[float, "pu", "voltage of the power flow", FROM_CASE]
    vlow: Annotated[float, "pu", "voltage below which the load is an admittance", FROM_CASE]
    wb: Annotated[float, "rad/s", "base speed, 2 pi f", FROM_CASE]
    a1: Annotated[float, "-", "share of n1 in the active power"]
    a2: Annotated[float, "-", "share of n2"]
    a3: Annotated[float, "-", "share of n3"]
    a4: Annotated[float, "-", "share of n4 in the reactive power"]
    a5: Annotated[float, "-", "share of n5"]
    a6: Annotated[float, "-", "share of n6"]
    a7: Annotated[float, "-", "active power over frequency"] = 0.0
    a8: Annotated[float, "-", "reactive power over frequency"] = 0.0
    n1: Annotated[float, "-", "exponent"] = 2.0
    n2: Annotated[float, "-", "exponent"] = 1.0
    n3: Annotated[float, "-", "exponent"] = 0.0
    n4: Annotated[float, "-", "exponent"] = 2.0
    n5: Annotated[float, "-", "exponent"] = 1.0
    n6: Annotated[float, "-", "exponent"] = 0.0
    g0: Annotated[float, "-", "g(V0)", FROM_CASE] = 1.0
    h0: Annotated[float, "-", "h(V0)", FROM_CASE] = 1.0
    curved: Annotated[float, "-", "whether an exponent is not 0, 1 or 2", FROM_CASE] = 1.0


class State(NamedTuple):
    """Frequency of the bus; at rest where nothing follows it."""

    theta: Annotated[float, "rad", "tracked angle of the voltage"]
    df: Annotated[float, "pu", "frequency deviation"]


def from_record(_kind: str, values: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of a record, whose shares may not add up to nothing."""
    for names in (("a1", "a2", "a3"), ("a4", "a5", "a6")):
        if not sum(values[name] for name in names):
            raise ValueError(f"{' + '.join(names)} = 0 leaves nothing of the load")
    return values, []


def prepare(p):
    """The parameters, with the shapes at V0."""
    p = p._replace(curved=float(not {p.n1, p.n2, p.n3, p.n4, p.n5, p.n6} <= {0.0, 1.0, 2.0}))
    return p._replace(g0=active(p.V0, np.log(p.V0), p), h0=reactive(p.V0, np.log(p.V0), p))


@inline
def term(V, log_V, a, n):
    """a V^n; common exponents take no logarithm."""
    if a == 0:
        return 0 * V
    if n == 0:
        return a + 0 * V
    if n == 1:
        return a * V
    if n == 2:
        return a * V * V
    return a * np.exp(n * log_V)


@inline
def active(V, log_V, p):
    """The shape g(V)."""
    return term(V, log_V, p.a1, p.n1) + term(V, log_V, p.a2, p.n2) + term(V, log_V, p.a3, p.n3)


@inline
def reactive(V, log_V, p):
    """The shape h(V)."""
    return term(V, log_V, p.a4, p.n4) + term(V, log_V, p.a5, p.n5) + term(V, log_V, p.a6, p.n6)


@inline
def current(x, v, p):
    """Current into the network (pu), real and imaginary part."""
    m = at_least(magnitude(v[0], v[1]), p.vlow)
    log_m = np.log(m) if p.curved else 0 * m
    g = p.P0 * active(m, log_m, p) * (1 + p.a7 * x.df) / (p.g0 * m * m)
    h = p.Q0 * reactive(m, log_m, p) * (1 + p.a8 * x.df) / (p.h0 * m * m)
    return -(g * v[0] + h * v[1]), h * v[0] - g * v[1]


@inline
def derivatives(x, v, p):
    """State derivatives (1/s)."""
    if p.a7 == 0 and p.a8 == 0:
        return State(0 * x.theta, 0 * x.df)
    c, s = np.cos(x.theta), np.sin(x.theta)
    rate = angle(c * v[0] + s * v[1], c * v[1] - s * v[0]) / T
    return State(rate, (rate / p.wb - x.df) / T)


def guess(V: complex) -> State:
    """States at rest: the angle of the voltage."""
    return State(float(np.angle(V)), 0.0)
