"""STORE behind CONVERTER with REEC_C, a grid-following converter.

order   -> share    -> (zero if full or empty) -> Pref = -rated share    -> REEC_C -> Ipcmd -> CONVERTER
order_q -> reactive -> (what P leaves of Smax) -> Qext = -rated reactive -> REEC_C -> Iqcmd -> CONVERTER
With QFlag = 1 and VFlag = 0, Qext is the voltage reference, V0 + order_v.

P - jQ = -vt (Ip - j Iq) mva is absorbed from the bus. The equations of all parts are those of their files (`order`,
`reec_c`, `repc_a`), with the power flow at zero output; Imax and PqFlag are the same for all. The store takes the place
of the state of charge of REEC_C: at once, a full device takes and an empty one gives no active current. Ip + j Iq is at
most Imax: where the lags, rate limits and overvoltage logic of REGC_A leave the circle that REEC_C commands, it is
shortened at the same angle. `rated` is the power rating over the MVA; per unit on the MVA of the converter.
Source: see `regc_a`, `regc_b`, `reec_c` and `repc_a`.
"""

from functools import partial
from math import inf
from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, available, magnitude, shortened
from stabctl.devices.converters import electrical, reec_c
from stabctl.devices.device import of

from . import control, joined, order, parts

store, converter, before = parts(__name__)

NAME = __name__.rpartition(".")[2].upper()
ROLE = "storage"
automatic = store.automatic
LIMITS = {"energy": ("floor", "capacity"), "pord": ("Pmin", "Pmax")}
STOPS = ("energy",)
DEADBANDS = before.DEADBANDS
CURRENT_LIMIT = "Imax"
Input: Any = before.Input
Par: Any = joined.joined(joined.Common, converter.Par, reec_c.Par, before.Par, store.Par)
KIT = control.kit(converter, store, before)
from_case, prepare = partial(joined.from_row, KIT, Par), electrical.rising
State: Any = joined.joined(order.State, control.State, converter.State, before.State)
REACH = inf if "Imax" in converter.Par._fields else 1.0  # of Imax; a converter that knows Imax is within it
UPPER, admittance = of(converter).upper, of(converter).admittance


class Voltage(NamedTuple):
    """Its voltage."""

    vt: Annotated[float, "pu", "terminal voltage"]


Output: Any = joined.joined(joined.Output, Voltage)


def guess(V: complex, p: Any) -> Any:
    """States at rest."""
    return State(*order.guess(p), *control.guess(V, p), *converter.guess(V, 0j, p), *before.guess(V, p))


@inline
def terminal(x, vt, p):
    """Active and reactive current at the terminals (pu converter)."""
    ip, iq = converter.delivered(x, vt, p)
    return shortened(available(ip, x.energy, p.floor, p.capacity), iq, REACH * p.Imax)


@inline
def current(x, v, p):
    """Current into the network, beside that of a Norton admittance (pu system), real and imaginary part."""
    ip, iq = terminal(x, magnitude(v[0], v[1]), p)
    return converter.injected(ip, iq, v, p)


@inline
def output(x, v, p):
    """Power absorbed (pu system), charge, and currents (pu converter)."""
    vt = magnitude(v[0], v[1])
    ip, iq = terminal(x, vt, p)
    k = p.mva * vt * vt / at_least(vt, p.vlow)
    return Output(-k * ip, -k * iq, x.energy / p.capacity, ip, iq, vt)


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is this device's own output."""
    vt, most = y.vt, store.most(x, p)
    k = vt * vt / at_least(vt, p.vlow)
    r, d_before = before.references(x, u, order.shares(x, u, p, most), vt, k * y.Ip, k * y.Iq, p)
    ip, iq, d_control = control.commands(x, r, p)
    d_converter = converter.derivatives(x, converter.Input(ip, iq), converter.Output(0 * vt, 0 * vt, vt), p)
    d_store = order.rates(x, u, p, most, store.rate(x, order.converted(y.P, p), p))
    return State(*d_store[:], *d_control[:], *d_converter[:], *d_before)
