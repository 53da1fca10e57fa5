"""Energy storage device (ESD): absorbs the ordered share of its rating from its bus.

order   -> -1..1 -> [1/(1+sTlag)] -> share -> (zero if full or empty) -> P = share * rating * {1, V, V^2}
order_q -> [1/(1+sTlag)] -> reactive -> (what P leaves of the apparent power) -> Q = reactive * rating * {1, V, V^2}

The device is constant power, constant current or constant conductance (Pp, Pc, Pg); below vlow it is an admittance.
Active power has priority: of the apparent power, P leaves at most sqrt(Smax^2 - share^2) to Q. The stored energy
rises by k times the absorbed power and falls by 1/k times the injected power, where k^2 is the round-trip efficiency. A
full or empty device stops at once, without ramp or lag. With Tlag = 0 and unlimited capacity it is the ideal device of
the 2022 paper on distributed storage control (section 5).
"""

from math import inf, sqrt
from typing import Annotated, Any, NamedTuple

import numpy as np

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, at_most, clip, lag, lag_rate, magnitude
from stabctl.devices.ports import fixed

NAME = "ESD"
ROLE = "storage"
LIMITS = {"energy": ("floor", "capacity")}
STOPS = ("energy",)


class Par(NamedTuple):
    """Parameters of one device, on the system base."""

    Pp: Annotated[float, "pu", "constant-power part of the rating"]
    Pc: Annotated[float, "pu", "constant-current part of the rating, at 1 pu voltage"]
    Pg: Annotated[float, "pu", "constant-conductance part of the rating, at 1 pu voltage"]
    vlow: Annotated[float, "pu", "voltage below which the device is a conductance"]
    Tlag: Annotated[float, "s", "lag from order to power"]
    ramp: Annotated[float, "1/s", "largest change of the order, in ratings per second (0: unlimited)"]
    floor: Annotated[float, "pu s", "energy when empty (-inf: unlimited)"]
    capacity: Annotated[float, "pu s", "energy when full (inf: unlimited)"]
    stored: Annotated[float, "pu s", "initial energy"]
    efficiency: Annotated[float, "-", "one-way efficiency, the square root of the round-trip efficiency"]
    Smax: Annotated[float, "-", "largest apparent power over the power rating"]


class State(NamedTuple):
    """Shares of the rating in use, and stored energy."""

    share: Annotated[float, "-", "lagged order"]
    energy: Annotated[float, "pu s", "stored energy"]
    reactive: Annotated[float, "-", "lagged reactive order"]


class Input(NamedTuple):
    """Signals at a device."""

    order: Annotated[float, "-", "share of the rating to absorb", fixed(0.0)]
    order_q: Annotated[float, "-", "reactive power to absorb, over the power rating", fixed(0.0)]


class Output(NamedTuple):
    """Power at the terminals, and charge."""

    P: Annotated[float, "pu", "power absorbed, system base"]
    Q: Annotated[float, "pu", "reactive power absorbed, system base"]
    charge: Annotated[float, "-", "state of charge; 0 if the capacity is unlimited"]


def from_case(device: Any, base_mva: float) -> Par:
    """Parameters from a row of storage.csv."""
    part = {"power": 0.0, "current": 0.0, "conductance": 0.0, device.characteristic: device.rating / base_mva}
    capacity = device.energy * 3600 / base_mva
    return Par(
        part["power"],
        part["current"],
        part["conductance"],
        0.5,
        device.lag,
        device.ramp / device.rating if device.rating else 0.0,
        0.0 if capacity else -inf,
        capacity or inf,
        capacity * device.charge,
        sqrt(device.efficiency),
        device.mva / device.rating if device.mva and device.rating else 1.0,
    )


def guess(p: Par) -> State:
    """States at rest: no power, and the initial energy."""
    return State(0.0, p.stored, 0.0)


@inline
def allowed(share, x, p):
    """The share, at most 1, or zero if a full device would absorb or an empty one inject."""
    if (x.energy.real >= p.capacity and share.real > 0) or (x.energy.real <= p.floor and share.real < 0):
        return 0 * share
    return at_most(at_least(share, -1.0), 1.0)


@inline
def shares(x, u, p):
    """Active and reactive power over the rating."""
    active = allowed(lag(p.Tlag, allowed(u.order, x, p), x.share)[0], x, p)
    reactive, _ = lag(p.Tlag, u.order_q, x.reactive)
    if reactive == 0:
        return active, reactive
    most = np.sqrt(at_least(p.Smax * p.Smax - active * active, 0.0))
    return active, at_most(at_least(reactive, -most), most)


@inline
def rates(x, u, P, p):
    """State derivatives (1/s) where the power P is absorbed (pu system)."""
    way = p.efficiency if P.real > 0 else 1 / p.efficiency
    d_share = lag_rate(p.Tlag, allowed(u.order, x, p), x.share)
    d_reactive = lag_rate(p.Tlag, clip(u.order_q, -p.Smax, p.Smax), x.reactive)
    return State(share=d_share, energy=way * P, reactive=d_reactive)


@inline
def per_square(x, u, m, p):
    """Conductance, and susceptance with opposite sign, that draw the power at the voltage m (pu)."""
    active, reactive = shares(x, u, p)
    full = (p.Pp / m + p.Pc) / m + p.Pg
    return active * full, reactive * full


@inline
def current(x, u, v, p):
    """Current into the network -conj(P + jQ) V / m^2, m = max(|V|, vlow)."""
    g, b = per_square(x, u, at_least(magnitude(v[0], v[1]), p.vlow), p)
    return -(g * v[0] + b * v[1]), b * v[0] - g * v[1]


@inline
def equations(x, u, v, p):
    """Power absorbed (pu), charge, and state derivatives (1/s)."""
    g, b = per_square(x, u, at_least(magnitude(v[0], v[1]), p.vlow), p)
    square = v[0] * v[0] + v[1] * v[1]
    P = g * square
    return Output(P, b * square, x.energy / p.capacity), rates(x, u, P, p)
