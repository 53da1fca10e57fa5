"""ESD behind a grid-following converter: the current source REGC_A with the electrical control REEC_C of batteries.

order   -> [1/(1+sTlag)] -> share    -> (zero if full or empty) -> Pref = -rated share    -> REEC_C -> Ipcmd -> REGC_A
order_q -> [1/(1+sTlag)] -> reactive -> (what P leaves of Smax) -> Qext = -rated reactive -> REEC_C -> Iqcmd -> REGC_A
With QFlag = 1 and VFlag = 0, Qext is the voltage reference, V0 + order_v.

P - jQ = -vt (Ip - j Iq) mva is absorbed from the bus. The equations of both parts are those of their files, with the
power flow at zero output. The store of the ESD takes the place of the state of charge of REEC_C: at once, a full device
takes and an empty one gives no active current. Ip + j Iq is at most Imax: where the lags, rate limits and overvoltage
logic of REGC_A leave the circle that REEC_C commands, it is shortened at the same angle. `rated` is the power rating
over the MVA; per unit on the MVA of the converter.
Source: see `regc_a` and `reec_c`.
"""

from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, available, magnitude, shortened
from stabctl.devices.converters import electrical, reec_c, regc_a
from stabctl.devices.converters.electrical import table_p, table_q
from stabctl.devices.converters.regc_a import delivered
from stabctl.devices.converters.regc_a import derivatives as converter_rates

from . import esd, joined
from .esd import rates as store_rates
from .esd import shares
from .joined import Input

NAME = "ESD_REGC"
ROLE = "storage"
LIMITS = {"energy": ("floor", "capacity"), "pord": ("Pmin", "Pmax")}
STOPS = ("energy",)
UPPER = regc_a.UPPER
CURRENT_LIMIT = "Imax"
Par: Any = joined.joined(joined.Store, regc_a.Par, reec_c.Par)
__all__ = ["Input"]


class Electrical(NamedTuple):
    """States of REEC_C in storage, whose charge is that of the store."""

    vm: Annotated[float, "pu", "filtered terminal voltage of REEC_C"]
    vq: Annotated[float, "pu", "integral of the reactive power error"]
    iv: Annotated[float, "pu", "integral of the voltage error"]
    iqr: Annotated[float, "pu", "lagged reactive current"]
    pord: Annotated[float, "pu", "power order"]


State: Any = joined.joined(esd.State, Electrical, regc_a.State)


class Output(NamedTuple):
    """Power at the terminals, charge, and currents."""

    P: Annotated[float, "pu", "power absorbed, system base"]
    Q: Annotated[float, "pu", "reactive power absorbed, system base"]
    charge: Annotated[float, "-", "state of charge; 0 if the capacity is unlimited"]
    Ip: Annotated[float, "pu", "active current delivered, converter base"]
    Iq: Annotated[float, "pu", "reactive current delivered, converter base"]
    vt: Annotated[float, "pu", "terminal voltage"]


KIT = joined.Kit(
    "REGC_A and REEC_C of storage",
    (regc_a.Par, reec_c.Par),
    {"Pmin": -1.0, "Qmin": -1.0, "Qmax": 1.0},
    ("PfFlag", "Tp", "T", "SOCini", "SOCmax", "SOCmin"),
    joined.no_errors,
)


def from_case(device: Any, base_mva: float) -> Any:
    """Parameters from a row of storage.csv; V0 is filled from the power flow."""
    return joined.from_row(KIT, Par, device, base_mva, P0=0.0, running=0.0)


def prepare(p: Any) -> Any:
    """Parameters with curves that ascend."""
    return electrical.rising(p)


def guess(V: complex, p: Any) -> Any:
    """States at rest: no power, and the initial energy."""
    v, inner = abs(V), p.QFlag > 0
    return State(0.0, p.stored, 0.0, v, v if inner else 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, v)


@inline
def converter(x):
    """The states of REGC_A."""
    return regc_a.State(x.ip, x.iq, x.vfilt)


@inline
def control(x):
    """The states of REEC_C."""
    return electrical.State(x.vm, 0 * x.vm, x.vq, x.iv, x.iqr, x.pord)


@inline
def seen(x, u, vt, P, Q, p):
    """What REEC_C reads; active and reactive power delivered (pu converter) are given."""
    active, reactive = shares(x, u, p)
    ordered = p.V0 + u.order_v if p.QFlag > 0.5 and p.VFlag < 0.5 else -p.rated * reactive
    return electrical.Input(-p.rated * active, ordered, 0 * vt, vt, P, Q)


@inline
def commands(x, r, p):
    """Active and reactive current command of REEC_C (pu), and state derivatives (1/s)."""
    e = control(x)
    return electrical.commands(r.Pref, e, r, p, 0.0, -1.0, table_p(e, r, p), table_q(e, r, p))


@inline
def terminal(x, vt, p):
    """Active and reactive current at the terminals (pu converter)."""
    ip, iq = delivered(converter(x), vt, p)
    return shortened(available(ip, x.energy, p.floor, p.capacity), iq, p.Imax)


@inline
def current(x, v, p):
    """Current into the network (pu system), real and imaginary part: (Ip - j Iq) V/|V|."""
    vt = magnitude(v[0], v[1])
    ip, iq = terminal(x, vt, p)
    k = p.mva / at_least(vt, p.vlow)
    return k * (ip * v[0] + iq * v[1]), k * (ip * v[1] - iq * v[0])


@inline
def output(x, v, p):
    """Power absorbed (pu system), charge, and currents (pu converter)."""
    vt = magnitude(v[0], v[1])
    ip, iq = terminal(x, vt, p)
    k = p.mva * vt * vt / at_least(vt, p.vlow)
    return Output(-k * ip, -k * iq, x.energy / p.capacity, ip, iq, vt)


@inline
def power(y, p):
    """Active and reactive power delivered (pu converter)."""
    k = y.vt * y.vt / at_least(y.vt, p.vlow)
    return k * y.Ip, k * y.Iq


@inline
def moved(x, u, y, r, p):
    """State derivatives (1/s); r is what REEC_C reads."""
    vt, s = y.vt, store_rates(x, u, y.P, p)
    ip, iq, e = commands(x, r, p)
    g = converter_rates(converter(x), regc_a.Input(ip, iq), regc_a.Output(0 * vt, 0 * vt, vt), p)
    return State(s.share, s.energy, s.reactive, e.vm, e.vq, e.iv, e.iq, e.pord, g.ip, g.iq, g.vfilt)


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is this device's own output."""
    P, Q = power(y, p)
    return moved(x, u, y, seen(x, u, y.vt, P, Q, p), p)
