"""REGFM_B1: grid-forming converter controlled as a virtual synchronous machine, a voltage source behind a reactance.

2H d(dw)/dt = Pref - FFlag/mp [1/(1+sTp)] dw - pf - D1 dw - D2 [s/(s+wD)] dw, dwmin..dwmax;   omega = 1 + dw
wb dw -> [1/s] -> delta, within theta_pll + dmin..dmax;   droop reads wpll - 1 instead of dw with wFlag = 1
Vref + mq (Qref - qf), with VdrpFlag = 1 Vref - mq iqf -> Vcmd;   E = [kpv + kiv/s] (Vcmd - vm), Emin..Emax
Vq -> [kpPLL + kiPLL/s], dwPLLmin..dwPLLmax -> wpll - 1 -> [wb/s] -> theta_pll, held while vt < VPLLfrz
P, Q, vt -> [1/(1+sTPf)], [1/(1+sTQf)], [1/(1+sTVf)] -> pf, qf, vm
Id, Iq in the frame of theta_pll -> [1/(1+sTIf)] -> idf, iqf
Idmax = kf ImaxSS, Iqmax = sqrt(ImaxSS^2 - idf^2) with PQFlag = 1;  Idmax = sqrt(ImaxSS^2 - iqf^2), Iqmax = kf ImaxSS
kI (Idmax - idf) -> [1/s], 0..asin(XL ImaxSS) -> dmax;   kI (-Ke Idmax - idf) -> [1/s], -asin(XL ImaxSS)..0 -> dmin
Emax, Emin = sqrt((vm +/- Iqmax XL)^2 + (idf XL)^2)
I = (E exp(j delta) - V)/(RL + jXL), reduced to the magnitude ImaxF where it is larger, at the same angle

H is the weight of the virtual rotor in a center of inertia. A steady change dP of the load changes the frequency by
-dP/(1/mp + D1). ImaxSS limits the steady current through the angle ahead of the phase-locked loop and through E, active
current first with PQFlag = 1. While the angle is at a limit it moves with the phase-locked loop, and omega is not its
speed. With ESFlag = 0, dmin is 0: no power is taken in. dmax and dmin are asin(XL ImaxSS) less the states `over` and
`under`, which rest at 0. RL is Re of the source. Vref is solved for at Qref = 0 (QVFlag = 1 in the source). Per unit on
the converter's own MVA; `mva` converts currents to the system base.

Source: W. Du et al., Virtual Synchronous Machine Grid-Forming Inverter Model Specification (REGFM_B1),
NREL/TP-5D00-90260, 2024. Its text was not at hand: the equations are those of public implementations that cite it.
Swing equation and droop as in pydae, in a MATLAB model that cites equation numbers, and in one for ANDES after PSS/E's
REGFMB1U; the sign of the phase-locked loop as in ANDES; voltage control as in pydae and ANDES (in the MATLAB model the
droop bypasses the controller); ImaxF, dmax, dmin, Emax and Emin as in the MATLAB and ANDES models (pydae limits E, and
the angle by constants); defaults, of its Table 1, as in pydae and MATLAB; names and flags as in PowerWorld's help. Not
verified: these differences, Tp = 0 by default, the sign of iqf with VdrpFlag = 1 (here delivered reactive current
lowers the voltage), and the integral of E while its limit moves (here it stops, as in IEEE Std 421.5). Different: delta
comes to dmin and dmax through a lag of 10 ms, so that it does not wind up, and vm - Iqmax XL is at least 0, which
matters only near zero voltage.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import SHORT, at_least, at_most, beyond, lag, magnitude, pi, while_within

from .electrical import root
from .forming import (
    Input,
    Output,
    admittance,
    correction,
    limited,
    short_circuit,
    terminals,
)

__all__ = ["Input", "admittance"]

NAME = "REGFM_B1"
UNVERIFIED = "not verified against its source, whose text was not at hand"
ROLE = "converter"
UPPER = ("ImaxF", "ImaxSS")
ANGLES = ("delta", "theta_pll")
FILTER = Interval(ge=SHORT)
SWITCH = Interval(ge=0, le=1)
SHARE = Interval(gt=0, le=1)
STOP = 100.0  # 1/s   how fast delta comes to its limits
LIMITS = {"dw": ("dwmin", "dwmax"), "over": (0.0, "deltamax"), "under": (0.0, "deltamax")}
LOOPS = {
    "virtual rotor": ("delta", "dw", "xd", "pf", "wf"),
    "voltage control": ("e", "vm"),
    "reactive power droop": ("qf",),
    "PLL": ("theta_pll", "xpll"),
    "current limits": ("over", "under", "idf", "iqf"),
}


class Par(NamedTuple):
    """Parameters of one converter."""

    mva: Annotated[float, "-", "converter MVA over system MVA", FROM_CASE]
    wb: Annotated[float, "rad/s", "base speed, 2 pi f", FROM_CASE]
    deltamax: Annotated[float, "rad", "largest angle ahead of the phase-locked loop, asin(XL ImaxSS)", FROM_CASE] = 0.0
    deltamin: Annotated[float, "rad", "largest angle behind it, negative, 0 with ESFlag = 0", FROM_CASE] = 0.0
    XL: Annotated[float, "pu", "coupling reactance", POSITIVE] = 0.1
    RL: Annotated[float, "pu", "coupling resistance", NOT_NEGATIVE] = 0.0
    H: Annotated[float, "s", "inertia constant of the virtual rotor", POSITIVE] = 0.5
    D1: Annotated[float, "pu", "damping", NOT_NEGATIVE] = 0.0
    D2: Annotated[float, "pu", "transient damping", NOT_NEGATIVE] = 100.0
    wD: Annotated[float, "rad/s", "corner of the washout of the transient damping", POSITIVE] = 50.0
    mp: Annotated[float, "pu", "frequency droop: frequency over active power", POSITIVE] = 0.02
    Tp: Annotated[float, "s", "filter of the frequency droop", NOT_NEGATIVE] = 0.0
    mq: Annotated[float, "pu", "voltage droop: voltage over reactive power, or current", NOT_NEGATIVE] = 0.05
    kpv: Annotated[float, "pu", "proportional gain of the voltage controller", NOT_NEGATIVE] = 0.0
    kiv: Annotated[float, "1/s", "integral gain of the voltage controller", POSITIVE] = 5.0
    kpPLL: Annotated[float, "pu", "proportional gain of the phase-locked loop", NOT_NEGATIVE] = 0.265
    kiPLL: Annotated[float, "1/s", "integral gain of the phase-locked loop", POSITIVE] = 2.65
    TPf: Annotated[float, "s", "filter of the active power", NOT_NEGATIVE] = 0.02
    TQf: Annotated[float, "s", "filter of the reactive power", FILTER] = 0.02
    TVf: Annotated[float, "s", "filter of the voltage", FILTER] = 0.02
    TIf: Annotated[float, "s", "filter of the current", FILTER] = 0.02
    ImaxSS: Annotated[float, "pu", "current limit in steady state", POSITIVE] = 1.0
    ImaxF: Annotated[float, "pu", "current limit at every instant", POSITIVE] = 1.5
    kf: Annotated[float, "-", "share of ImaxSS that the current with priority may have", SHARE] = 0.9
    kI: Annotated[float, "rad/s", "integral gain of the limit of the active current", NOT_NEGATIVE] = 2.0
    Ke: Annotated[float, "-", "limit of the current taken in over that delivered", Interval(ge=0, le=1)] = 1.0
    dwmax: Annotated[float, "pu", "largest deviation of the virtual speed"] = 0.05
    dwmin: Annotated[float, "pu", "smallest deviation of the virtual speed"] = -0.05
    dwPLLmax: Annotated[float, "pu", "largest deviation of the phase-locked loop"] = 0.2
    dwPLLmin: Annotated[float, "pu", "smallest deviation of the phase-locked loop"] = -0.2
    VPLLfrz: Annotated[float, "pu", "voltage below which the phase-locked loop is held", NOT_NEGATIVE] = 0.05
    wFlag: Annotated[float, "-", "speed that the droop reads (1: phase-locked loop, 0: virtual)", SWITCH] = 0.0
    VdrpFlag: Annotated[float, "-", "voltage droop (1: on reactive current, 0: on reactive power)", SWITCH] = 0.0
    PQFlag: Annotated[float, "-", "priority in steady state (1: active, 0: reactive current)", SWITCH] = 1.0
    FFlag: Annotated[float, "-", "frequency droop (1: on, 0: off)", SWITCH] = 1.0
    ESFlag: Annotated[float, "-", "energy storage (1: also takes power in, 0: only delivers)", SWITCH] = 1.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        for low, high in (("dwmin", "dwmax"), ("dwPLLmin", "dwPLLmax")):
            if getattr(self, low) >= getattr(self, high):
                yield high, f"must be above {low} = {getattr(self, low):g}"
        if self.XL * self.ImaxSS > 1:
            yield "ImaxSS", f"must be at most 1/XL = {1 / self.XL:g}"
        if not self.FFlag and not self.D1:
            yield "D1", "must be above 0 where FFlag = 0, or nothing determines the power"


class State(NamedTuple):
    """Virtual rotor, filters, voltage controller, limits of the angle, and phase-locked loop."""

    delta: Annotated[float, "rad", "angle of the internal voltage relative to the synchronous frame"]
    dw: Annotated[float, "pu", "deviation of the virtual speed"]
    xd: Annotated[float, "pu", "lagged deviation of the speed, of the transient damping"]
    wf: Annotated[float, "pu", "filtered deviation of the speed, of the droop"]
    pf: Annotated[float, "pu", "filtered active power"]
    qf: Annotated[float, "pu", "filtered reactive power"]
    vm: Annotated[float, "pu", "filtered terminal voltage"]
    idf: Annotated[float, "pu", "filtered active current"]
    iqf: Annotated[float, "pu", "filtered reactive current"]
    e: Annotated[float, "pu", "integral of the voltage controller"]
    over: Annotated[float, "rad", "reduction of the largest angle ahead of the phase-locked loop"]
    under: Annotated[float, "rad", "reduction of the largest angle behind the phase-locked loop"]
    theta_pll: Annotated[float, "rad", "angle of the phase-locked loop relative to the synchronous frame"]
    xpll: Annotated[float, "pu", "integral of the phase-locked loop"]


def prepare(p: Par) -> Par:
    """The parameters, with the largest angles that ImaxSS allows."""
    widest = float(np.arcsin(min(p.XL * p.ImaxSS, 1.0)))
    return p._replace(deltamax=widest, deltamin=-widest if p.ESFlag > 0.5 else 0.0)


def inertia(p: Par) -> float:
    """Inertia constant (s) of the virtual rotor."""
    return p.H


@inline
def most(x, p):
    """Limits of the active and the reactive current in steady state (pu)."""
    if p.PQFlag > 0.5:
        return p.kf * p.ImaxSS, root(p.ImaxSS, x.idf)
    return root(p.ImaxSS, x.iqf), p.kf * p.ImaxSS


@inline
def voltage(x, u, p):
    """Magnitude of the internal voltage (pu), between Emin and Emax, and derivative (1/s) of its integral."""
    wanted = u.Vref + p.mq * (-x.iqf if p.VdrpFlag > 0.5 else u.Qref - x.qf)
    _, iq = most(x, p)
    ahead = x.idf * p.XL
    low, high = magnitude(at_least(x.vm - iq * p.XL, 0.0), ahead), magnitude(x.vm + iq * p.XL, ahead)
    return pi(p.kpv, p.kiv, wanted - x.vm, x.e, low, high)


@inline
def span(x, p):
    """Least and largest angle (rad) of the internal voltage ahead of the phase-locked loop."""
    return p.deltamin + x.under, p.deltamax - x.over


@inline
def angle(x, low, high):
    """Angle (rad) of the internal voltage, between two limits ahead of the phase-locked loop."""
    return x.theta_pll + at_least(at_most(x.delta - x.theta_pll, high), low)


@inline
def norton(x, u, p, low, high):
    """`source` with these limits of the angle ahead of the phase-locked loop (rad)."""
    return short_circuit(voltage(x, u, p)[0], angle(x, low, high), p)


@inline
def added(x, u, v, p, low, high):
    """`current` with these limits of the angle ahead of the phase-locked loop (rad)."""
    return correction(voltage(x, u, p)[0], angle(x, low, high), v, p)


@inline
def source(x, u, p):
    """Short-circuit current of the internal voltage without limit (pu system), real and imaginary part."""
    low, high = span(x, p)
    return norton(x, u, p, low, high)


@inline
def current(x, u, v, p):
    """Current that the limit adds to that of the source (pu system), real and imaginary part."""
    low, high = span(x, p)
    return added(x, u, v, p, low, high)


@inline
def between(x, u, v, p, low, high):
    """Output and state derivatives (1/s) with these limits of the angle ahead of the phase-locked loop (rad)."""
    E, d_e = voltage(x, u, p)
    P, Q, vt = terminals(E, angle(x, low, high), v, p)

    c, s = np.cos(x.theta_pll), np.sin(x.theta_pll)
    vq = v[1] * c - v[0] * s
    dwpll, d_xpll = pi(p.kpPLL, p.kiPLL, vq, x.xpll, p.dwPLLmin, p.dwPLLmax)
    turn = while_within(p.wb * dwpll, vt, p.VPLLfrz, 0.0)

    wf, d_wf = lag(p.Tp, dwpll if p.wFlag > 0.5 else x.dw, x.wf)
    droop = wf / p.mp if p.FFlag > 0.5 else 0 * x.dw
    pf, d_pf = lag(p.TPf, P, x.pf)
    power = u.Pref - droop - pf - p.D1 * x.dw - p.D2 * (x.dw - x.xd)
    lead = x.delta - x.theta_pll
    slip = at_least(at_most(p.wb * x.dw - turn, STOP * (high - lead)), STOP * (low - lead))

    ir, ii = limited(E, angle(x, low, high), v, p)
    idmax, _ = most(x, p)
    taking = p.kI if p.ESFlag > 0.5 else 0.0
    _, d_over = beyond(0.0, p.kI, x.idf - idmax, x.over)
    _, d_under = beyond(0.0, taking, -p.Ke * idmax - x.idf, x.under)
    return Output(P, Q, vt, 1 + x.dw, E), State(
        delta=turn + slip,
        dw=power / (2 * p.H),
        xd=p.wD * (x.dw - x.xd),
        wf=d_wf,
        pf=d_pf,
        qf=(Q - x.qf) / p.TQf,
        vm=(vt - x.vm) / p.TVf,
        idf=(ir * c + ii * s - x.idf) / p.TIf,
        iqf=(ir * s - ii * c - x.iqf) / p.TIf,
        e=d_e,
        over=d_over,
        under=d_under,
        theta_pll=turn,
        xpll=while_within(d_xpll, vt, p.VPLLfrz, 0.0),
    )


@inline
def equations(x, u, v, p):
    """Power and voltage at the terminals, virtual speed, internal voltage (pu converter); state derivatives (1/s)."""
    low, high = span(x, p)
    return between(x, u, v, p, low, high)


def guess(V: complex, I: complex, p: Par) -> State:
    """States of the power flow."""
    E, S, theta = V + complex(p.RL, p.XL) * I, V * I.conjugate(), float(np.angle(V))
    local = I * np.exp(-1j * theta)
    filters = S.real, S.imag, abs(V), float(local.real), -float(local.imag)
    return State(float(np.angle(E)), 0.0, 0.0, 0.0, *filters, abs(E), 0.0, 0.0, theta, 0.0)
