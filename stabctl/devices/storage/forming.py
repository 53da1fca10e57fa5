"""STORE behind CONVERTER, a grid-forming converter.

order   -> share    -> (zero if full or empty) -> Pref = -rated share    -> CONVERTER
order_q -> reactive -> (what P leaves of Smax) -> Qref = -rated reactive -> CONVERTER

The equations are those of `order` and of the converter, with Vref at the voltage of the power flow plus `order_v`, so
that the output is zero at the start. A voltage source cannot stop at once. REGFM_A1: the limit Pmax of an empty device,
and Pmin of a full one, becomes 0, and the controllers `over` and `under` bring the power there. REGFM_B1: the angle of
a full device stays ahead of the phase-locked loop, as with ESFlag = 0, that of an empty one behind it. The energy that
flows until then, with REGFM_B1 within some 50 ms, is counted, so the charge may pass 0 or 1 by a little. `rated` is the
power rating over the MVA; per unit on the MVA of the converter.
Source: see `regfm_a1` and `regfm_b1`.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, available
from stabctl.devices.device import of

from . import joined, order, parts

store, converter = parts(__name__)

NAME = __name__.rpartition(".")[2].upper()
ROLE = "storage"
automatic = store.automatic
device = of(converter)
LIMITS, UPPER, ANGLES, UNVERIFIED = device.limits, device.upper, device.angles, device.unverified
CURRENT_LIMIT = "ImaxF"
Input = joined.Input
State: Any = joined.joined(order.State, converter.State)
admittance, prepare, elsewhere, inertia = device.admittance, device.prepare, device.elsewhere, device.inertia


class Vref(NamedTuple):
    """The voltage reference."""

    V0: Annotated[float, "pu", "voltage of the power flow"]


Par: Any = joined.joined(joined.Common, converter.Par, Vref, store.Par)


class Speed(NamedTuple):
    """Its virtual speed."""

    omega: Annotated[float, "pu", "virtual speed"]


Output: Any = joined.joined(joined.Output, Speed)


def errors(values: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """Name and message for each combination of parameters that is not possible."""
    if values.get("VFlag", 1) > 0 and not values["mq"]:
        where = " with VFlag = 1" if "VFlag" in values else ""
        yield "mq", f"must be above 0{where}; without droop nothing determines the reactive power at rest"
    low, high = values.get("Pmin", 0.0), values.get("Pmax", 0.0)
    if low > 0 or high < 0:
        yield "Pmin" if low > 0 else "Pmax", "does not allow zero power, with which storage starts"


KIT = joined.Kit(
    f"{converter.NAME} of storage",
    (converter.Par, store.Par),
    {"Pmin": -1.0} if "Pmin" in converter.Par._fields else {},
    errors=errors,
    finite=store.FINITE,
)
from_case = partial(joined.from_row, KIT, Par)


def guess(V: complex, p: Any) -> Any:
    """States at rest."""
    return State(*order.guess(p), *converter.guess(V, 0j, p))


@inline
def references(x, u, p):
    """What the converter reads (pu converter)."""
    active, reactive = order.shares(x, u, p, store.most(x, p))
    return converter.Input(-p.rated * active, -p.rated * reactive, p.V0 + u.order_v)


@inline
def limits(x, p):
    """Limits of the converter that hold its power, as the store allows."""
    low, high = converter.span(x, p)
    return available(low, x.energy, p.floor, p.capacity), available(high, x.energy, p.floor, p.capacity)


@inline
def source(x, u, p):
    """Short-circuit current of the internal voltage without limit (pu system), real and imaginary part."""
    low, high = limits(x, p)
    return converter.norton(x, references(x, u, p), p, low, high)


@inline
def current(x, u, v, p):
    """Current that the limit adds to that of the source (pu system), real and imaginary part."""
    low, high = limits(x, p)
    return converter.added(x, references(x, u, p), v, p, low, high)


@inline
def equations(x, u, v, p):
    """Power absorbed (pu system), charge, currents (pu converter), virtual speed; state derivatives (1/s)."""
    low, high = limits(x, p)
    y, d = converter.between(x, references(x, u, p), v, p, low, high)
    P, divisor = -p.mva * y.P, at_least(y.vt, 1e-9)
    d_store = order.rates(x, u, p, store.most(x, p), store.rate(x, order.converted(P, p), p))
    shown = Output(P, -p.mva * y.Q, x.energy / p.capacity, y.P / divisor, y.Q / divisor, y.omega)
    return shown, State(*d_store[:], *d[:])
