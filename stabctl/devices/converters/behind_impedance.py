"""What the converters behind an impedance, REGC_B and REGC_C, share: commands, current limit, current references.

Ipcmd, Iqcmd -> within Imax, the active current first with PqFlag = 1, otherwise the reactive one
Ip -> x vfilt with RateFlag = 1 -> [1/(1+sTg)], away from zero at most at Rrpwr -> / vfilt with RateFlag = 1 -> Ipref
Iq -> [1/(1+sTg)], rate Iqrmin..Iqrmax -> Iqref
vt -> [1/(1+sTfltr)] -> vfilt, at least 0.01 as a divisor

With RateFlag = 1 the rate limit holds for the active power instead of the current. Ip and Iq are the active and the
reactive current, the latter positive where it delivers reactive power: I = Ip - j Iq in the frame of the converter.
Source: P. Pourbeik, Proposal for New Features for the Renewable Energy System Generic Models, memorandum to the WECC
REMTF, 2019; GridOPTICS/GridPACK, REGCB1 and REGCC1 (rate limit by the sign of the command, lag Tg); InterPSS, REGCB1.
"""

from typing import Annotated, NamedTuple

from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl.devices.blocks import SHORT, at_least, growth_limit, lag, lag_rate, rate_limit
from stabctl.devices.ports import PORT

from .electrical import prioritized

FILTER = Interval(ge=SHORT)


class Input(NamedTuple):
    """Signals at a converter."""

    Ipcmd: Annotated[float, "pu", "active current command, converter base", PORT]
    Iqcmd: Annotated[float, "pu", "reactive current command, converter base", PORT]


@inline
def allowed(ip, iq, p):
    """Active and reactive current (pu) within Imax, one of them first."""
    return prioritized(ip, iq, -1.0, p)


@inline
def divisor(x, vt, p):
    """Filtered voltage (pu) by which a power is divided, 1 with RateFlag = 0."""
    return at_least(lag(p.Tfltr, vt, x.vfilt)[0], 0.01) if p.RateFlag > 0.5 else 1.0


@inline
def references(x, vt, p):
    """References of the active and the reactive current (pu)."""
    return x.ip / divisor(x, vt, p), x.iq


@inline
def reference_rates(x, u, vt, p):
    """State derivatives (1/s) of both references and of the filtered voltage."""
    ip, iq = allowed(u.Ipcmd, u.Iqcmd, p)
    rate = lag_rate(p.Tg, ip * divisor(x, vt, p), x.ip)
    return (
        growth_limit(rate, u.Ipcmd, p.Rrpwr),
        rate_limit(lag_rate(p.Tg, iq, x.iq), p.Iqrmin, p.Iqrmax),
        lag_rate(p.Tfltr, vt, x.vfilt),
    )


@inline
def through(re, im, p):
    """Active and reactive current (pu converter) that the voltage re + j im drives through Re + j Xe."""
    z2 = p.Re * p.Re + p.Xe * p.Xe
    return (p.Re * re + p.Xe * im) / z2, (p.Xe * re - p.Re * im) / z2


@inline
def drop(ip, iq, p):
    """Real and imaginary part of the voltage (pu) that these currents need across Re + j Xe."""
    return p.Re * ip + p.Xe * iq, p.Xe * ip - p.Re * iq


@inline
def admittance(p):
    """Norton admittance 1/(Re + j Xe) (pu system), real and imaginary part; 0 where the current is its reference."""
    ip, iq = through(1.0, 0.0, p)
    k = (p.Te >= SHORT) * p.mva
    return k * ip, -k * iq
