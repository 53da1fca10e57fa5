"""ESD behind a grid-following converter with phase-locked loop and inner current control: REGC_C with REEC_C.

order   -> [1/(1+sTlag)] -> share    -> (zero if full or empty) -> Pref = -rated share    -> REEC_C -> Ipcmd -> REGC_C
order_q -> [1/(1+sTlag)] -> reactive -> (what P leaves of Smax) -> Qext = -rated reactive -> REEC_C -> Iqcmd -> REGC_C

The equations of both parts are those of their files, with the power flow at zero output; Imax and PqFlag are the same
for both. The store of the ESD takes the place of the state of charge of REEC_C: at once, a full device takes and an
empty one gives no active power. `rated` is the power rating over the MVA; per unit on the MVA of the converter.
Source: see `regc_c` and `reec_c`.
"""

from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, available, magnitude, shortened
from stabctl.devices.converters import electrical, reec_c, regc_c
from stabctl.devices.converters.behind_impedance import admittance
from stabctl.devices.converters.regc_c import Internal, delivered, framed, locked, turned
from stabctl.devices.converters.regc_c import derivatives as converter_rates
from stabctl.devices.converters.regc_c import internal as frame

from . import esd, joined
from .esd import rates as store_rates
from .esd_regc import KIT as FOLLOWING
from .esd_regc import Electrical, commands, seen
from .joined import Input

NAME = "ESD_REGC_C"
ROLE = "storage"
LIMITS = {"energy": ("floor", "capacity"), "pord": ("Pmin", "Pmax")}
STOPS = ("energy",)
UPPER = regc_c.UPPER
CURRENT_LIMIT = "Imax"
ANGLES = regc_c.ANGLES
PLL = regc_c.PLL
Par: Any = joined.joined(joined.Store, regc_c.Par, reec_c.Par)
KIT = FOLLOWING._replace(name="REGC_C and REEC_C of storage", parts=(regc_c.Par, reec_c.Par))
LEAST = 1e-3  # pu   smallest voltage along the frame by which a power is divided
__all__ = ["Input", "Internal", "admittance"]


State: Any = joined.joined(esd.State, Electrical, regc_c.State)


class Output(NamedTuple):
    """Power at the terminals, charge, currents, voltage, and frequency of the phase-locked loop."""

    P: Annotated[float, "pu", "power absorbed, system base"]
    Q: Annotated[float, "pu", "reactive power absorbed, system base"]
    charge: Annotated[float, "-", "state of charge; 0 if the capacity is unlimited"]
    Ip: Annotated[float, "pu", "active current delivered in the frame, converter base"]
    Iq: Annotated[float, "pu", "reactive current delivered in the frame, converter base"]
    vt: Annotated[float, "pu", "terminal voltage"]
    wpll: Annotated[float, "pu", "frequency of the phase-locked loop"]


def from_case(device: Any, base_mva: float) -> Any:
    """Parameters from a row of storage.csv; V0 and wb are filled from the case."""
    return joined.from_row(KIT, Par, device, base_mva, wb=0.0, P0=0.0, running=0.0)


def prepare(p: Any) -> Any:
    """Parameters with curves that ascend."""
    return electrical.rising(p)


def guess(V: complex, p: Any) -> Any:
    """States at rest: no power, and the initial energy."""
    v = abs(V)
    rest = regc_c.guess(V, 0j, p)
    return State(0.0, p.stored, 0.0, v, v if p.QFlag > 0 else 0.0, 0.0, 0.0, 0.0, *rest)


@inline
def converter(x):
    """The states of REGC_C."""
    return regc_c.State(x.theta_pll, x.xpll, x.ip, x.iq, x.vfilt, x.xp, x.xq, x.Ed, x.Eq)


@inline
def internal(x, p):
    """Direction of the frame."""
    return frame(converter(x), p)


@inline
def terminal(x, i, v, p):
    """Active and reactive current at the terminals (pu converter), in the frame, and the active power (pu converter).

    Where the store does not allow the power, the active current only balances that of the reactive current.
    """
    vd, vq = framed(i, v)
    ip, iq = delivered(converter(x), vd, vq, magnitude(vd, vq), p)
    power = vd * ip - vq * iq
    kept = available(power, x.energy, p.floor, p.capacity)
    ip, iq = shortened(ip - (power - kept) / at_least(vd, LEAST), iq, p.Imax)
    return ip, iq, kept


@inline
def current(x, i, v, p):
    """Current into the network beside the Norton admittance (pu system), real and imaginary part: I + Y V."""
    ip, iq, _ = terminal(x, i, v, p)
    return turned(i, ip, iq, v, p)


@inline
def output(x, i, v, p):
    """Power absorbed (pu system), charge, currents (pu converter), voltage, frequency of the phase-locked loop."""
    vd, vq = framed(i, v)
    ip, iq, P = terminal(x, i, v, p)
    Q = vd * iq + vq * ip
    charge, vt = x.energy / p.capacity, magnitude(v[0], v[1])
    return Output(-p.mva * P, -p.mva * Q, charge, ip, iq, vt, locked(converter(x), vq, p))


@inline
def power(i, v, y):
    """Active and reactive power delivered (pu converter)."""
    vd, vq = framed(i, v)
    return vd * y.Ip - vq * y.Iq, vd * y.Iq + vq * y.Ip


@inline
def moved(x, i, u, v, y, r, p):
    """State derivatives (1/s); r is what REEC_C reads."""
    s, vq = store_rates(x, u, y.P, p), framed(i, v)[1]
    ip, iq, e = commands(x, r, p)
    g = converter_rates(converter(x), i, regc_c.Input(ip, iq), v, regc_c.Output(r.P, r.Q, y.vt, y.wpll, vq), p)
    return State(
        s.share, s.energy, s.reactive, e.vm, e.vq, e.iv, e.iq, e.pord,
        g.theta_pll, g.xpll, g.ip, g.iq, g.vfilt, g.xp, g.xq, g.Ed, g.Eq,
    )  # fmt: skip


@inline
def derivatives(x, i, u, v, y, p):
    """State derivatives (1/s); y is this device's own output."""
    P, Q = power(i, v, y)
    return moved(x, i, u, v, y, seen(x, u, y.vt, P, Q, p), p)
