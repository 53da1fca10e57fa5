"""Energy storage device (ESD): absorbs an ordered share of its rating from its bus.

order -> [1/(1+sTlag)] -> share -> (stops where the store is full or empty) -> power = share * rating * {1, V, V^2}
The power against voltage is constant power, constant current or constant conductance (Pp, Pc, Pg); below vlow all of
it is a conductance. Stored energy grows with k times the absorbed and falls with 1/k times the injected power,
k^2 the round-trip efficiency; a full or empty store stops at once, whatever ramp and lag. Tlag = 0 and capacity = 0
(unlimited) are the paper's ideal device.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, lag, lag_rate, magnitude

NAME = "ESD"
ROLE = "storage"
HELD: dict[str, tuple[str, str]] = {}


class Par(NamedTuple):
    """Constants of one device."""

    Pp: Annotated[float, "pu", "rating that is constant power"]
    Pc: Annotated[float, "pu", "rating that is constant current, at 1 pu voltage"]
    Pg: Annotated[float, "pu", "rating that is constant conductance, at 1 pu voltage"]
    vlow: Annotated[float, "pu", "voltage below which the device is a conductance"]
    Tlag: Annotated[float, "s", "lag from order to power"]
    ramp: Annotated[float, "1/s", "largest change of the order, in ratings per second (0: unlimited)"]
    capacity: Annotated[float, "pu s", "energy it can hold (0: unlimited)"]
    efficiency: Annotated[float, "-", "of one way, the root of the round trip"]


class State(NamedTuple):
    """Share of the rating in use, and energy in store."""

    share: Annotated[float, "-", "lagged order"]
    energy: Annotated[float, "pu s", "energy in store"]


class Output(NamedTuple):
    """Current into the network and power absorbed."""

    re: Annotated[float, "pu", "current, real part"]
    im: Annotated[float, "pu", "current, imaginary part"]
    P: Annotated[float, "pu", "power absorbed, system base"]


@inline
def allowed(share, x, p):
    """The share, or nothing where a full store would absorb or an empty one inject."""
    if p.capacity > 0 and ((x.energy.real >= p.capacity and share.real > 0) or (x.energy.real <= 0 and share.real < 0)):
        return 0 * share
    return share


@inline
def output(x, order, v, p):
    """Current into the network -share (Pp/m^2 + Pc/m + Pg) V, m = max(|V|, vlow), and the power absorbed."""
    m = at_least(magnitude(v[0], v[1]), p.vlow)
    share = allowed(lag(p.Tlag, allowed(order, x, p), x.share), x, p)
    g = share * ((p.Pp / m + p.Pc) / m + p.Pg)
    return Output(-g * v[0], -g * v[1], g * (v[0] * v[0] + v[1] * v[1]))


@inline
def flow(x, order, y, p):
    """State rates (1/s); y is this device's own output."""
    way = p.efficiency if y.P.real > 0 else 1 / p.efficiency
    return State(lag_rate(p.Tlag, allowed(order, x, p), x.share), way * y.P)
