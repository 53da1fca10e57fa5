"""REGC_A: renewable energy generator/converter, a grid-following current source without a rotor.

Ipcmd -> [1/(1+sTg)], rate <= Rrpwr, at most LVPL(vfilt) -> x gain(vt) -> Ip, in phase with the bus voltage
Iqcmd -> [1/(1+sTg)], rate Iqrmin..Iqrmax -> (+) -> at least Iolim -> Iq, positive where it delivers reactive power
                                             (-) Khv (vt - Volim) where vt > Volim
vt -> [1/(1+sTfltr)] -> vfilt;   LVPL rises from 0 at Zerox to Lvpl1 at Brkpt and stays there (Lvplsw = 0: no limit)
gain rises from 0 at Lvpnt0 to 1 at Lvpnt1 (low-voltage active current management)

P + jQ = vt (Ip + j Iq). Ipcmd and Iqcmd come from the electrical controls; without these they are constant and
initialized from the power flow. The phase-locked loop is ideal, as in the source. Below vlow, where a real one would
lose synchronism, the currents are reduced in proportion to the voltage, so that the network always has a solution.
Simplifications: Iqrmax and Iqrmin apply whatever the sign of the initial Q; while LVPL is active, Ip is reduced at once
and its lag follows with Tg. Tg is at least 1 ms: without it the current would depend on commands that depend on the
voltage that it makes. Some programs remove the limit LVPL above Brkpt. Per unit on the converter's own MVA; `mva`
converts currents to the system base.
Source: WECC Renewable Energy Modeling Task Force, WECC Solar Plant Dynamic Modeling Guidelines (2014), REGC_A;
PSS/E Model Library, REGCA1.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import (
    SHORT,
    at_least,
    at_most,
    deadband,
    lag,
    lag_rate,
    line,
    low_value,
    magnitude,
    rate_limit,
)
from stabctl.devices.ports import PORT

NAME = "REGC_A"
ROLE = "converter"
UPPER = ("Rrpwr", "Lvpl1")
FILTER = Interval(ge=SHORT)
SWITCH = Interval(ge=0, le=1)
LOOPS = {"active current": ("ip",), "reactive current": ("iq",), "voltage filter": ("vfilt",)}
DYR = {
    "REGCA1": "+Lvplsw Tg Rrpwr Brkpt Zerox Lvpl1 Volim Lvpnt1 Lvpnt0 Iolim Tfltr Khv Iqrmax Iqrmin _Accel",
}


class Par(NamedTuple):
    """Parameters of one converter."""

    mva: Annotated[float, "-", "converter MVA over system MVA", FROM_CASE]
    Tg: Annotated[float, "s", "lag of the current regulators", FILTER] = 0.02
    Rrpwr: Annotated[float, "pu/s", "largest rise of the active current", POSITIVE] = 10.0
    Brkpt: Annotated[float, "pu", "voltage at which low-voltage power logic reaches Lvpl1"] = 0.9
    Zerox: Annotated[float, "pu", "voltage at which low-voltage power logic reaches zero", NOT_NEGATIVE] = 0.5
    Lvpl1: Annotated[float, "pu", "active current limit of low-voltage power logic", POSITIVE] = 1.22
    Volim: Annotated[float, "pu", "voltage above which reactive current is drawn", POSITIVE] = 1.2
    Lvpnt1: Annotated[float, "pu", "voltage above which active current is delivered in full"] = 0.8
    Lvpnt0: Annotated[float, "pu", "voltage below which no active current is delivered", NOT_NEGATIVE] = 0.4
    Iolim: Annotated[float, "pu", "lower limit of the reactive current"] = -1.3
    Tfltr: Annotated[float, "s", "voltage filter of low-voltage power logic", NOT_NEGATIVE] = 0.02
    Khv: Annotated[float, "pu", "reactive current over overvoltage", NOT_NEGATIVE] = 0.7
    Iqrmax: Annotated[float, "pu/s", "largest rise of the reactive current"] = 999.0
    Iqrmin: Annotated[float, "pu/s", "largest fall of the reactive current, negative"] = -999.0
    vlow: Annotated[float, "pu", "voltage below which the converter is an admittance", POSITIVE] = 0.1
    Lvplsw: Annotated[float, "-", "low-voltage power logic (1: on, 0: off)", SWITCH] = 1.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        for low, high in (*((("Zerox", "Brkpt"),) if self.Lvplsw > 0.5 else ()), ("Lvpnt0", "Lvpnt1")):
            if getattr(self, low) >= getattr(self, high):
                yield high, f"must be above {low} = {getattr(self, low):g}"


class State(NamedTuple):
    """Currents of the regulators, and filtered voltage."""

    ip: Annotated[float, "pu", "active current"]
    iq: Annotated[float, "pu", "reactive current"]
    vfilt: Annotated[float, "pu", "filtered terminal voltage"]


class Input(NamedTuple):
    """Signals at a converter."""

    Ipcmd: Annotated[float, "pu", "active current command, converter base", PORT]
    Iqcmd: Annotated[float, "pu", "reactive current command, converter base", PORT]


class Output(NamedTuple):
    """Power and voltage at the terminals."""

    P: Annotated[float, "pu", "active power delivered, converter base"]
    Q: Annotated[float, "pu", "reactive power delivered, converter base"]
    vt: Annotated[float, "pu", "terminal voltage"]


@inline
def logic(ip, vt, x, p):
    """Active current (pu) within the limit of low-voltage power logic."""
    if p.Lvplsw < 0.5:
        return ip
    return low_value(ip, p.Lvpl1 * line(lag(p.Tfltr, vt, x.vfilt)[0], p.Zerox, 0.0, p.Brkpt, 1.0))


@inline
def delivered(x, vt, p):
    """Active and reactive current at the terminals (pu converter)."""
    ip = logic(x.ip, vt, x, p) * line(vt, p.Lvpnt0, 0.0, p.Lvpnt1, 1.0)
    return ip, at_least(x.iq - p.Khv * deadband(vt, 0.0, p.Volim), p.Iolim)


@inline
def injected(ip, iq, v, p):
    """Current into the network (pu system), real and imaginary part: (Ip - j Iq) V/|V|."""
    k = p.mva / at_least(magnitude(v[0], v[1]), p.vlow)
    return k * (ip * v[0] + iq * v[1]), k * (ip * v[1] - iq * v[0])


@inline
def current(x, v, p):
    """Current into the network (pu system), real and imaginary part."""
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
    return State(
        ip=at_most(lag_rate(p.Tg, logic(u.Ipcmd, y.vt, x, p), x.ip), p.Rrpwr),
        iq=rate_limit(lag_rate(p.Tg, u.Iqcmd, x.iq), p.Iqrmin, p.Iqrmax),
        vfilt=lag_rate(p.Tfltr, y.vt, x.vfilt),
    )


def guess(V: complex, I: complex, p: Par) -> State:
    """States of the power flow at full delivery."""
    lead = np.angle(I) - np.angle(V)
    return State(float(abs(I) * np.cos(lead)), float(-abs(I) * np.sin(lead)), abs(V))
