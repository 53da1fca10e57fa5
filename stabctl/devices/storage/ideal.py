"""STORE without a converter: absorbs the ordered share of its rating from its bus.

share -> P = share * rating * {1, V, V^2}
reactive -> Q = reactive * rating * {1, V, V^2}

Shares and energy are those of `order`. The device is constant power, constant current or constant conductance (Pp, Pc,
Pg); below vlow it is an admittance.
"""

from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, magnitude

from . import joined, order, parts
from .order import Input, State, guess

(store,) = parts(__name__)

NAME = __name__.rpartition(".")[2].upper()
ROLE = "storage"
automatic = store.automatic
LIMITS = {"energy": ("floor", "capacity")}
STOPS = ("energy",)
KIT = joined.Kit(store.NAME, (store.Par,), finite=store.FINITE)
__all__ = ["Input", "State", "guess"]


class Rating(NamedTuple):
    """The rating of one device, on the system base."""

    Pp: Annotated[float, "pu", "constant-power part of the rating"]
    Pc: Annotated[float, "pu", "constant-current part of the rating, at 1 pu voltage"]
    Pg: Annotated[float, "pu", "constant-conductance part of the rating, at 1 pu voltage"]
    vlow: Annotated[float, "pu", "voltage below which the device is a conductance"]


Par: Any = joined.joined(Rating, order.Par, store.Par)


class Output(NamedTuple):
    """Power at the terminals, and charge."""

    P: Annotated[float, "pu", "power absorbed, system base"]
    Q: Annotated[float, "pu", "reactive power absorbed, system base"]
    charge: Annotated[float, "-", "state of charge; 0 if the capacity is unlimited"]


def from_case(device: Any, base_mva: float) -> Any:
    """Parameters from a row of storage.csv."""
    part = {"power": "Pp", "current": "Pc", "conductance": "Pg"}[device.characteristic]
    return joined.from_row(KIT, Par, device, base_mva)._replace(**{part: device.rating / base_mva}, vlow=0.5)


@inline
def per_square(x, u, m, p):
    """Conductance, and susceptance with opposite sign, that draw the power at the voltage m (pu)."""
    active, reactive = order.shares(x, u, p, store.most(x, p))
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
    d_energy = store.rate(x, order.converted(P, p), p)
    return Output(P, b * square, x.energy / p.capacity), order.rates(x, u, p, store.most(x, p), d_energy)
