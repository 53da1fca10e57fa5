"""REGC_B: renewable energy generator/converter with a voltage source interface, grid-following without a rotor.

Ipcmd, Iqcmd -> limits, rates and lags of `behind_impedance` -> Ipref, Iqref
vt + Re Ipref + Xe Iqref -> [1/(1+sTe)] -> Ed
     Xe Ipref - Re Iqref -> [1/(1+sTe)] -> Eq
I = ((Ed + j Eq) - vt)/(Re + j Xe) in the frame of the bus voltage, within Imax

The frame is that of the bus voltage at every instant: the phase-locked loop is ideal, as in the source. With Te below
1 ms the current is its reference, and the impedance has no effect. Below vlow, where a real loop would lose
synchronism, the current is reduced in proportion to the voltage. Iqrmax and Iqrmin apply whatever the sign of the
initial Q. Per unit on the converter's own MVA; `mva` converts currents to the system base.
Source: as in `behind_impedance`; REGC_B.
"""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import SHORT, at_least, lag_rate, magnitude

from .behind_impedance import FILTER, Input, admittance, allowed, drop, reference_rates, references, through

__all__ = ["Input", "admittance"]

NAME = "REGC_B"
ROLE = "converter"
UPPER = ("Rrpwr",)
SWITCH = Interval(ge=0, le=1)
LOOPS = {
    "active current": ("ip",),
    "reactive current": ("iq",),
    "internal voltage": ("Ed", "Eq"),
    "voltage filter": ("vfilt",),
}
DYR = dict.fromkeys(("REGCB1", "REGCBU1"), "+RateFlag +PqFlag Tg Tfltr Iqrmax Iqrmin Rrpwr Te Imax")


class Par(NamedTuple):
    """Parameters of one converter."""

    mva: Annotated[float, "-", "converter MVA over system MVA", FROM_CASE]
    RateFlag: Annotated[float, "-", "what Rrpwr limits (1: active power, 0: active current)", SWITCH] = 0
    PqFlag: Annotated[float, "-", "priority of the current limit (1: active, 0: reactive current)", SWITCH] = 0
    Tg: Annotated[float, "s", "lag of the current commands", FILTER] = 0.02
    Tfltr: Annotated[float, "s", "voltage filter", NOT_NEGATIVE] = 0.02
    Iqrmax: Annotated[float, "pu/s", "largest rise of the reactive current"] = 999.0
    Iqrmin: Annotated[float, "pu/s", "largest fall of the reactive current, negative"] = -999.0
    Rrpwr: Annotated[float, "pu/s", "largest rise of the active current or power", POSITIVE] = 10.0
    Te: Annotated[float, "s", "lag of the internal voltage", NOT_NEGATIVE] = 0.02
    Imax: Annotated[float, "pu", "current limit", POSITIVE] = 1.2
    Re: Annotated[float, "pu", "source resistance", NOT_NEGATIVE] = 0.0
    Xe: Annotated[float, "pu", "source reactance", POSITIVE] = 0.15
    vlow: Annotated[float, "pu", "voltage below which the converter is an admittance", POSITIVE] = 0.1


class State(NamedTuple):
    """Current references, filtered voltage and internal voltage."""

    ip: Annotated[float, "pu", "active current reference, or power with RateFlag = 1"]
    iq: Annotated[float, "pu", "reactive current reference"]
    vfilt: Annotated[float, "pu", "filtered terminal voltage"]
    Ed: Annotated[float, "pu", "internal voltage in phase with the terminal voltage"]
    Eq: Annotated[float, "pu", "internal voltage ahead of the terminal voltage"]


class Output(NamedTuple):
    """Power and voltage at the terminals."""

    P: Annotated[float, "pu", "active power delivered, converter base"]
    Q: Annotated[float, "pu", "reactive power delivered, converter base"]
    vt: Annotated[float, "pu", "terminal voltage"]


@inline
def delivered(x, vt, p):
    """Active and reactive current at the terminals (pu converter)."""
    ip, iq = through(x.Ed - vt, x.Eq, p) if p.Te >= SHORT else references(x, vt, p)
    return allowed(ip, iq, p)


@inline
def injected(ip, iq, v, p):
    """Current into the network beside the Norton admittance (pu system), real and imaginary part: I + Y V."""
    k = p.mva / at_least(magnitude(v[0], v[1]), p.vlow)
    g, b = admittance(p)
    return k * (ip * v[0] + iq * v[1]) + g * v[0] - b * v[1], k * (ip * v[1] - iq * v[0]) + g * v[1] + b * v[0]


@inline
def current(x, v, p):
    """Current into the network beside the Norton admittance (pu system), real and imaginary part: I + Y V."""
    ip, iq = delivered(x, magnitude(v[0], v[1]), p)
    return injected(ip, iq, v, p)


@inline
def output(x, v, p):
    """Power and voltage at the terminals (pu converter)."""
    vt = magnitude(v[0], v[1])
    ip, iq = delivered(x, vt, p)
    k = vt * vt / at_least(vt, p.vlow)
    return Output(k * ip, k * iq, vt)


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is this converter's own output."""
    ip, iq = references(x, y.vt, p)
    ed, eq = drop(ip, iq, p)
    d_ip, d_iq, d_vfilt = reference_rates(x, u, y.vt, p)
    d_Ed, d_Eq = lag_rate(p.Te, y.vt + ed, x.Ed), lag_rate(p.Te, eq, x.Eq)
    return State(ip=d_ip, iq=d_iq, vfilt=d_vfilt, Ed=d_Ed, Eq=d_Eq)


def guess(V: complex, I: complex, p: Par) -> State:
    """States of the power flow."""
    vt, local = abs(V), I * np.exp(-1j * np.angle(V))
    ed, eq = drop(local.real, -local.imag, p)
    return State(local.real * (vt if p.RateFlag else 1), -local.imag, vt, vt + ed, eq)
