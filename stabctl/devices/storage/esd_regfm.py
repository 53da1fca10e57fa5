"""ESD behind a grid-forming converter with droop, REGFM_A1: a voltage source behind a reactance.

order   -> [1/(1+sTlag)] -> share    -> (zero if full or empty) -> Pref = -rated share    -> REGFM_A1
order_q -> [1/(1+sTlag)] -> reactive -> (what P leaves of Smax) -> Qref = -rated reactive -> REGFM_A1

The equations are those of `regfm_a1`, with Vref at the voltage of the power flow plus `order_v`, so that the output is
zero at the start. A voltage source cannot stop at once: the limit Pmax of an empty device, and Pmin of a full one,
becomes 0, and the controllers `over` and `under` bring the power there. The energy that flows until then is counted, so
the charge may pass 0 or 1 by a little. `rated` is the power rating over the MVA; per unit on the MVA of the converter.
Source: see `regfm_a1`.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, available
from stabctl.devices.converters import regfm_a1
from stabctl.devices.converters.regfm_a1 import admittance, between
from stabctl.devices.converters.regfm_a1 import current as added
from stabctl.devices.converters.regfm_a1 import source as norton

from . import esd, joined
from .esd import rates, shares
from .joined import Input

NAME = "ESD_REGFM"
ROLE = "storage"
LIMITS = regfm_a1.LIMITS
UPPER = regfm_a1.UPPER
CURRENT_LIMIT = "ImaxF"


class Vref(NamedTuple):
    """The voltage reference."""

    V0: Annotated[float, "pu", "voltage of the power flow"]


Par: Any = joined.joined(joined.Store, regfm_a1.Par, Vref)
__all__ = ["Input", "admittance"]


State: Any = joined.joined(esd.State, regfm_a1.State)


class Output(NamedTuple):
    """Power at the terminals, charge, currents, and virtual speed."""

    P: Annotated[float, "pu", "power absorbed, system base"]
    Q: Annotated[float, "pu", "reactive power absorbed, system base"]
    charge: Annotated[float, "-", "state of charge; 0 if the capacity is unlimited"]
    Ip: Annotated[float, "pu", "active current delivered, converter base"]
    Iq: Annotated[float, "pu", "reactive current delivered, converter base"]
    omega: Annotated[float, "pu", "virtual speed"]


def errors(values: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """Name and message for each combination of parameters that is not possible."""
    if values["VFlag"] > 0 and not values["mq"]:
        yield "mq", "must be above 0 with VFlag = 1; without droop nothing determines the reactive power at rest"
    if values["Pmin"] > 0 or values["Pmax"] < 0:
        yield "Pmin" if values["Pmin"] > 0 else "Pmax", "does not allow zero power, with which storage starts"


KIT = joined.Kit("REGFM_A1 of storage", (regfm_a1.Par,), {"Pmin": -1.0}, (), errors)


def from_case(device: Any, base_mva: float) -> Any:
    """Parameters from a row of storage.csv; V0 and wb are filled from the case."""
    return joined.from_row(KIT, Par, device, base_mva, wb=0.0)


def guess(V: complex, p: Any) -> Any:
    """States at rest: no power, and the initial energy."""
    v, none = abs(V), (0.0,) * 4
    return State(0.0, p.stored, 0.0, float(np.angle(V)), 0.0, 0.0, v, v if p.VFlag > 0.5 else 0.0, *none)


@inline
def references(x, u, p):
    """What REGFM_A1 reads (pu converter)."""
    active, reactive = shares(x, u, p)
    return regfm_a1.Input(-p.rated * active, -p.rated * reactive, p.V0 + u.order_v)


@inline
def limits(x, p):
    """Least and largest active power (pu converter) that the store allows."""
    low, high = p.Pmin + 0 * x.energy, p.Pmax + 0 * x.energy
    return available(low, x.energy, p.floor, p.capacity), available(high, x.energy, p.floor, p.capacity)


@inline
def source(x, u, p):
    """Short-circuit current of the internal voltage without limit (pu system), real and imaginary part."""
    return norton(x, references(x, u, p), p)


@inline
def current(x, u, v, p):
    """Current that the limit adds to that of the source (pu system), real and imaginary part."""
    return added(x, references(x, u, p), v, p)


@inline
def equations(x, u, v, p):
    """Power absorbed (pu system), charge, currents (pu converter), virtual speed; state derivatives (1/s)."""
    low, high = limits(x, p)
    y, d = between(x, references(x, u, p), v, p, low, high)
    P, divisor = -p.mva * y.P, at_least(y.vt, 1e-9)
    s = rates(x, u, P, p)
    return Output(P, -p.mva * y.Q, x.energy / p.capacity, y.P / divisor, y.Q / divisor, y.omega), State(
        s.share, s.energy, s.reactive, d.delta, d.pf, d.qf, d.vm, d.e, d.pmax, d.pmin, d.qmax, d.qmin
    )
