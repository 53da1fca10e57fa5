"""REGC_C: renewable energy generator/converter with phase-locked loop and inner current control, without a rotor.

Vq -> [Kppll + Kipll/s], wmin..wmax -> dw -> [1/s] -> theta, the angle of the frame;   Vd + j Vq = V exp(-j theta)
Ipcmd, Iqcmd -> limits, rates and lags of `behind_impedance` -> Ipref, Iqref
Ipref - Ip -> [Kip + Kii/s], within Imax -> up;   Iqref - Iq -> [Kip + Kii/s], within Imax -> uq
Vd + Re up + Xe uq -> [1/(1+sTe)] -> Ed
Vq + Xe up - Re uq -> [1/(1+sTe)] -> Eq
I = ((Ed + j Eq) exp(j theta) - V)/(Re + j Xe), within Imax;   Ip - j Iq = I exp(-j theta)

The phase-locked loop turns its frame until Vq is zero; where the grid is weak, the current moves the voltage that the
loop follows, and the loop may become unstable. Without voltage it keeps the frequency of its integral. The fast loop
through Kip is closed algebraically where Te is below 1 ms: up = Ip = (Kip Ipref + xp)/(1 + Kip), xp the integral; the
impedance then has no effect. Iqrmax and Iqrmin apply whatever the sign of the initial Q. Per unit on the converter's
own MVA; `mva` converts currents to the system base.
Source: as in `behind_impedance`; REGC_C. Order of the constants of a record REGCC1: GridOPTICS/GridPACK.
"""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import SHORT, lag_rate, magnitude, pi

from .behind_impedance import FILTER, Input, admittance, allowed, drop, reference_rates, references, through
from .electrical import root

__all__ = ["Input", "admittance"]

NAME = "REGC_C"
ROLE = "converter"
UPPER = ("Rrpwr",)
SWITCH = Interval(ge=0, le=1)
ANGLES = ("theta_pll",)
PLL = "theta_pll"
PLL_GAINS = "Kppll", "Kipll"
LOOPS = {
    "PLL": ("theta_pll", "xpll"),
    "current control": ("xp", "xq", "Ed", "Eq"),
    "active current": ("ip",),
    "reactive current": ("iq",),
    "voltage filter": ("vfilt",),
}
DYR = {"REGCC1": "+RateFlag +PqFlag Tg Tfltr Iqrmax Iqrmin Rrpwr Te Imax Kip Kii Kppll Kipll wmax wmin"}


class Par(NamedTuple):
    """Parameters of one converter."""

    mva: Annotated[float, "-", "converter MVA over system MVA", FROM_CASE]
    wb: Annotated[float, "rad/s", "base speed, 2 pi f", FROM_CASE]
    RateFlag: Annotated[float, "-", "what Rrpwr limits (1: active power, 0: active current)", SWITCH] = 0
    PqFlag: Annotated[float, "-", "priority of the current limit (1: active, 0: reactive current)", SWITCH] = 0
    Tg: Annotated[float, "s", "lag of the current commands", FILTER] = 0.02
    Tfltr: Annotated[float, "s", "voltage filter", NOT_NEGATIVE] = 0.02
    Iqrmax: Annotated[float, "pu/s", "largest rise of the reactive current"] = 999.0
    Iqrmin: Annotated[float, "pu/s", "largest fall of the reactive current, negative"] = -999.0
    Rrpwr: Annotated[float, "pu/s", "largest rise of the active current or power", POSITIVE] = 10.0
    Te: Annotated[float, "s", "lag of the internal voltage", NOT_NEGATIVE] = 0.02
    Imax: Annotated[float, "pu", "current limit", POSITIVE] = 1.2
    Kip: Annotated[float, "pu", "proportional gain of the current control", NOT_NEGATIVE] = 5.0
    Kii: Annotated[float, "1/s", "integral gain of the current control", POSITIVE] = 70.0
    Kppll: Annotated[float, "rad/s", "proportional gain of the phase-locked loop over voltage", POSITIVE] = 20.0
    Kipll: Annotated[float, "rad/s2", "integral gain of the phase-locked loop over voltage", NOT_NEGATIVE] = 700.0
    wmax: Annotated[float, "rad/s", "largest deviation of the phase-locked loop"] = 12.0
    wmin: Annotated[float, "rad/s", "smallest deviation of the phase-locked loop"] = -12.0
    Re: Annotated[float, "pu", "source resistance", NOT_NEGATIVE] = 0.0
    Xe: Annotated[float, "pu", "source reactance", POSITIVE] = 0.15


class State(NamedTuple):
    """Phase-locked loop, current references, filtered voltage, current control and internal voltage."""

    theta_pll: Annotated[float, "rad", "angle of the phase-locked loop relative to the synchronous frame"]
    xpll: Annotated[float, "rad/s", "integral of the phase-locked loop"]
    ip: Annotated[float, "pu", "active current reference, or power with RateFlag = 1"]
    iq: Annotated[float, "pu", "reactive current reference"]
    vfilt: Annotated[float, "pu", "filtered terminal voltage"]
    xp: Annotated[float, "pu", "integral of the active current control"]
    xq: Annotated[float, "pu", "integral of the reactive current control"]
    Ed: Annotated[float, "pu", "internal voltage along the frame"]
    Eq: Annotated[float, "pu", "internal voltage ahead of the frame"]


class Output(NamedTuple):
    """Power and voltage at the terminals, frequency and angle error of the phase-locked loop."""

    P: Annotated[float, "pu", "active power delivered, converter base"]
    Q: Annotated[float, "pu", "reactive power delivered, converter base"]
    vt: Annotated[float, "pu", "terminal voltage"]
    wpll: Annotated[float, "pu", "frequency of the phase-locked loop"]
    vq: Annotated[float, "pu", "terminal voltage ahead of the frame, which the phase-locked loop brings to zero"]


class Internal(NamedTuple):
    """Direction of the frame."""

    c: Annotated[float, "-", "cosine of its angle"]
    s: Annotated[float, "-", "sine of its angle"]


@inline
def internal(x, p):
    """Direction of the frame."""
    return Internal(np.cos(x.theta_pll), np.sin(x.theta_pll))


@inline
def framed(i, v):
    """Components of the terminal voltage (pu) along the frame and ahead of it."""
    return v[0] * i.c + v[1] * i.s, v[1] * i.c - v[0] * i.s


@inline
def delivered(x, vd, vq, vt, p):
    """Active and reactive current in the frame (pu converter)."""
    if p.Te >= SHORT:
        ip, iq = through(x.Ed - vd, x.Eq - vq, p)
        return allowed(ip, iq, p)
    ip, iq = references(x, vt, p)
    return allowed((p.Kip * ip + x.xp) / (1 + p.Kip), (p.Kip * iq + x.xq) / (1 + p.Kip), p)


@inline
def locked(x, vq, p):
    """Frequency of the phase-locked loop (pu)."""
    return 1 + pi(p.Kppll, p.Kipll, vq, x.xpll, p.wmin, p.wmax)[0] / p.wb


@inline
def current(x, i, v, p):
    """Current into the network beside the Norton admittance (pu system), real and imaginary part: I + Y V."""
    vd, vq = framed(i, v)
    ip, iq = delivered(x, vd, vq, magnitude(vd, vq), p)
    return turned(i, ip, iq, v, p)


@inline
def turned(i, ip, iq, v, p):
    """The current of `current` from its active and reactive part in the frame (pu converter)."""
    g, b = admittance(p)
    re, im = ip * i.c + iq * i.s, ip * i.s - iq * i.c
    return p.mva * re + g * v[0] - b * v[1], p.mva * im + g * v[1] + b * v[0]


@inline
def output(x, i, v, p):
    """Power and voltage at the terminals, frequency and error of the phase-locked loop (pu)."""
    vd, vq = framed(i, v)
    vt = magnitude(v[0], v[1])
    ip, iq = delivered(x, vd, vq, vt, p)
    return Output(vd * ip - vq * iq, vd * iq + vq * ip, vt, locked(x, vq, p), vq)


@inline
def derivatives(x, i, u, v, y, p):
    """State derivatives (1/s); y is this converter's own output."""
    vd, vq = framed(i, v)
    ip, iq = delivered(x, vd, vq, y.vt, p)
    to_p, to_q = references(x, y.vt, p)
    ep, eq = to_p - ip, to_q - iq
    if p.PqFlag > 0.5:
        up, d_xp = pi(p.Kip, p.Kii, ep, x.xp, -p.Imax, p.Imax)
        most = root(p.Imax, up)
        uq, d_xq = pi(p.Kip, p.Kii, eq, x.xq, -most, most)
    else:
        uq, d_xq = pi(p.Kip, p.Kii, eq, x.xq, -p.Imax, p.Imax)
        most = root(p.Imax, uq)
        up, d_xp = pi(p.Kip, p.Kii, ep, x.xp, -most, most)
    along, ahead = drop(up, uq, p)
    d_ip, d_iq, d_vfilt = reference_rates(x, u, y.vt, p)
    return State(
        theta_pll=p.wb * (y.wpll - 1),
        xpll=pi(p.Kppll, p.Kipll, vq, x.xpll, p.wmin, p.wmax)[1],
        ip=d_ip,
        iq=d_iq,
        vfilt=d_vfilt,
        xp=d_xp,
        xq=d_xq,
        Ed=lag_rate(p.Te, vd + along, x.Ed),
        Eq=lag_rate(p.Te, vq + ahead, x.Eq),
    )


def guess(V: complex, I: complex, p: Par) -> State:
    """States of the power flow."""
    vt, theta = abs(V), float(np.angle(V))
    local = I * np.exp(-1j * theta)
    ip, iq = local.real, -local.imag
    ed, eq = drop(ip, iq, p)
    return State(theta, 0.0, ip * (vt if p.RateFlag else 1), iq, vt, ip, iq, vt + ed, eq)
