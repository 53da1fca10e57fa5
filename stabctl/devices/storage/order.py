"""From the orders of a storage device to the shares of its rating, and its energy.

order   -> -give..take -> [1/(1+sTlag)] -> share -> (zero if full or empty)
order_q -> [1/(1+sTlag)] -> reactive -> (what the active power leaves of the apparent power)

give and take are what the store can, 1 for a battery. Active power has priority: of the apparent power it leaves at
most sqrt(Smax^2 - share^2). The store receives k times the absorbed power and gives 1/k times the injected one, where
k^2 is the round-trip efficiency of the conversion. A full or empty device stops at once, without ramp or lag.
"""

from typing import Annotated, NamedTuple

import numpy as np

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, at_most, clip, lag, lag_rate
from stabctl.devices.ports import fixed


class Par(NamedTuple):
    """What every storage device has: limits of its order, and its store of energy."""

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


def guess(p):
    """States at rest: no power, and the initial energy."""
    return State(0.0, p.stored, 0.0)


@inline
def allowed(share, x, p, most):
    """The share within what the store can take and give, or zero if a full one would take or an empty one give."""
    if (x.energy.real >= p.capacity and share.real > 0) or (x.energy.real <= p.floor and share.real < 0):
        return 0 * share
    take, give = most
    return at_most(at_least(share, -give), take)


@inline
def shares(x, u, p, most):
    """Active and reactive power over the rating."""
    share, _ = lag(p.Tlag, allowed(u.order, x, p, most), x.share)
    active = allowed(share, x, p, most)
    reactive, _ = lag(p.Tlag, u.order_q, x.reactive)
    if reactive == 0:
        return active, reactive
    left = np.sqrt(at_least(p.Smax * p.Smax - active * active, 0.0))
    return active, at_most(at_least(reactive, -left), left)


@inline
def converted(P, p):
    """Power into the store, where P is absorbed at the terminals."""
    return (p.efficiency if P.real > 0 else 1 / p.efficiency) * P


@inline
def rates(x, u, p, most, d_energy):
    """State derivatives (1/s); that of the energy is given."""
    d_share = lag_rate(p.Tlag, allowed(u.order, x, p, most), x.share)
    d_reactive = lag_rate(p.Tlag, clip(u.order_q, -p.Smax, p.Smax), x.reactive)
    return State(share=d_share, energy=d_energy, reactive=d_reactive)
