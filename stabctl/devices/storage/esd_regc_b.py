"""ESD behind a grid-following converter with an impedance: REGC_B with REEC_C.

order   -> [1/(1+sTlag)] -> share    -> (zero if full or empty) -> Pref = -rated share    -> REEC_C -> Ipcmd -> REGC_B
order_q -> [1/(1+sTlag)] -> reactive -> (what P leaves of Smax) -> Qext = -rated reactive -> REEC_C -> Iqcmd -> REGC_B

The equations of both parts are those of their files, with the power flow at zero output; Imax and PqFlag are the same
for both. The store of the ESD takes the place of the state of charge of REEC_C: at once, a full device takes and an
empty one gives no active current. `rated` is the power rating over the MVA; per unit on the MVA of the converter.
Source: see `regc_b` and `reec_c`.
"""

from typing import Any

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, available, magnitude
from stabctl.devices.converters import electrical, reec_c, regc_b
from stabctl.devices.converters.behind_impedance import admittance
from stabctl.devices.converters.regc_b import delivered
from stabctl.devices.converters.regc_b import derivatives as converter_rates

from . import esd, joined
from .esd import rates as store_rates
from .esd_regc import KIT as FOLLOWING
from .esd_regc import Electrical, Output, commands, power, seen
from .joined import Input

NAME = "ESD_REGC_B"
ROLE = "storage"
LIMITS = {"energy": ("floor", "capacity"), "pord": ("Pmin", "Pmax")}
STOPS = ("energy",)
UPPER = regc_b.UPPER
CURRENT_LIMIT = "Imax"
Par: Any = joined.joined(joined.Store, regc_b.Par, reec_c.Par)
KIT = FOLLOWING._replace(name="REGC_B and REEC_C of storage", parts=(regc_b.Par, reec_c.Par))
__all__ = ["Input", "Output", "admittance"]


State: Any = joined.joined(esd.State, Electrical, regc_b.State)


def from_case(device: Any, base_mva: float) -> Any:
    """Parameters from a row of storage.csv; V0 is filled from the power flow."""
    return joined.from_row(KIT, Par, device, base_mva, P0=0.0, running=0.0)


def prepare(p: Any) -> Any:
    """Parameters with curves that ascend."""
    return electrical.rising(p)


def guess(V: complex, p: Any) -> Any:
    """States at rest: no power, and the initial energy."""
    v = abs(V)
    return State(0.0, p.stored, 0.0, v, v if p.QFlag > 0 else 0.0, 0.0, 0.0, 0.0, *regc_b.guess(V, 0j, p))


@inline
def converter(x):
    """The states of REGC_B."""
    return regc_b.State(x.ip, x.iq, x.vfilt, x.Ed, x.Eq)


@inline
def terminal(x, vt, p):
    """Active and reactive current at the terminals (pu converter)."""
    ip, iq = delivered(converter(x), vt, p)
    return available(ip, x.energy, p.floor, p.capacity), iq


@inline
def current(x, v, p):
    """Current into the network beside the Norton admittance (pu system), real and imaginary part: I + Y V."""
    vt = magnitude(v[0], v[1])
    ip, iq = terminal(x, vt, p)
    k = p.mva / at_least(vt, p.vlow)
    g, b = admittance(p)
    return k * (ip * v[0] + iq * v[1]) + g * v[0] - b * v[1], k * (ip * v[1] - iq * v[0]) + g * v[1] + b * v[0]


@inline
def output(x, v, p):
    """Power absorbed (pu system), charge, and currents (pu converter)."""
    vt = magnitude(v[0], v[1])
    ip, iq = terminal(x, vt, p)
    k = p.mva * vt * vt / at_least(vt, p.vlow)
    return Output(-k * ip, -k * iq, x.energy / p.capacity, ip, iq, vt)


@inline
def moved(x, u, y, r, p):
    """State derivatives (1/s); r is what REEC_C reads."""
    vt, s = y.vt, store_rates(x, u, y.P, p)
    ip, iq, e = commands(x, r, p)
    g = converter_rates(converter(x), regc_b.Input(ip, iq), regc_b.Output(0 * vt, 0 * vt, vt), p)
    return State(s.share, s.energy, s.reactive, e.vm, e.vq, e.iv, e.iq, e.pord, g.ip, g.iq, g.vfilt, g.Ed, g.Eq)


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is this device's own output."""
    P, Q = power(y, p)
    return moved(x, u, y, seen(x, u, y.vt, P, Q, p), p)
