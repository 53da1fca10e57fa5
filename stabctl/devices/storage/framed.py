"""STORE behind CONVERTER with REEC_C, a grid-following converter with a phase-locked loop.

order   -> share    -> (zero if full or empty) -> Pref = -rated share    -> REEC_C -> Ipcmd -> CONVERTER
order_q -> reactive -> (what P leaves of Smax) -> Qext = -rated reactive -> REEC_C -> Iqcmd -> CONVERTER

The equations of all parts are those of their files (`order`, `reec_c`, `repc_a`), with the power flow at zero output;
Imax and PqFlag are the same for all. The store takes the place of the state of charge of REEC_C: at once, a full device
takes and an empty one gives no active power. `rated` is the power rating over the MVA; per unit on the MVA of the
converter.
Source: see `regc_c`, `reec_c` and `repc_a`.
"""

from functools import partial
from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, available, magnitude, shortened
from stabctl.devices.converters import electrical, reec_c

from . import control, joined, order, parts

store, converter, before = parts(__name__)

NAME = __name__.rpartition(".")[2].upper()
ROLE = "storage"
automatic = store.automatic
LIMITS = {"energy": ("floor", "capacity"), "pord": ("Pmin", "Pmax")}
STOPS = ("energy",)
UPPER = converter.UPPER
DEADBANDS = before.DEADBANDS
CURRENT_LIMIT = "Imax"
ANGLES = converter.ANGLES
PLL = converter.PLL
Input: Any = before.Input
Par: Any = joined.joined(joined.Common, converter.Par, reec_c.Par, before.Par, store.Par)
KIT = control.kit(converter, store, before)
from_case, prepare = partial(joined.from_row, KIT, Par), electrical.rising
State: Any = joined.joined(order.State, control.State, converter.State, before.State)
Internal, internal, admittance = converter.Internal, converter.internal, converter.admittance
LEAST = 1e-3  # pu   smallest voltage along the frame by which a power is divided


class Voltage(NamedTuple):
    """Its voltage, and the frequency of the phase-locked loop; its currents are those in the frame of the loop."""

    vt: Annotated[float, "pu", "terminal voltage"]
    wpll: Annotated[float, "pu", "frequency of the phase-locked loop"]


Output: Any = joined.joined(joined.Output, Voltage)


def guess(V: complex, p: Any) -> Any:
    """States at rest."""
    return State(*order.guess(p), *control.guess(V, p), *converter.guess(V, 0j, p), *before.guess(V, p))


@inline
def terminal(x, i, v, p):
    """Active and reactive current at the terminals (pu converter), in the frame, and the active power (pu converter).

    Where the store does not allow the power, the active current only balances that of the reactive current.
    """
    vd, vq = converter.framed(i, v)
    ip, iq = converter.delivered(x, vd, vq, magnitude(vd, vq), p)
    power = vd * ip - vq * iq
    kept = available(power, x.energy, p.floor, p.capacity)
    ip, iq = shortened(ip - (power - kept) / at_least(vd, LEAST), iq, p.Imax)
    return ip, iq, kept


@inline
def current(x, i, v, p):
    """Current into the network beside the Norton admittance (pu system), real and imaginary part: I + Y V."""
    ip, iq, _ = terminal(x, i, v, p)
    return converter.turned(i, ip, iq, v, p)


@inline
def output(x, i, v, p):
    """Power absorbed (pu system), charge, currents (pu converter), voltage, frequency of the phase-locked loop."""
    vd, vq = converter.framed(i, v)
    ip, iq, P = terminal(x, i, v, p)
    Q = vd * iq + vq * ip
    charge, vt = x.energy / p.capacity, magnitude(v[0], v[1])
    return Output(-p.mva * P, -p.mva * Q, charge, ip, iq, vt, converter.locked(x, vq, p))


@inline
def derivatives(x, i, u, v, y, p):
    """State derivatives (1/s); y is this device's own output."""
    vd, vq = converter.framed(i, v)
    P, Q, most = vd * y.Ip - vq * y.Iq, vd * y.Iq + vq * y.Ip, store.most(x, p)
    r, d_before = before.references(x, u, order.shares(x, u, p, most), y.vt, P, Q, p)
    ip, iq, d_control = control.commands(x, r, p)
    own = converter.Output(P, Q, y.vt, y.wpll, vq)
    d_converter = converter.derivatives(x, i, converter.Input(ip, iq), v, own, p)
    d_store = order.rates(x, u, p, most, store.rate(x, order.converted(y.P, p), p))
    return State(*d_store[:], *d_control[:], *d_converter[:], *d_before)
