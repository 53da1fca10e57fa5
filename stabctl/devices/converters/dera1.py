"""DER_A: aggregated distributed generation, a current source with its controls.

FreqFlag = 1: Pref - P/(1+sTp) + droop(1 - f/(1+sTrf)) -> femin..femax -> [Kpg + Kig/s], Pmin..Pmax; 0: Pref
    -> [1/(1+sTpord)], rate dPmin..dPmax, Pmin..Pmax -> /vm -> Ipmin..Ipmax -> [1/(1+sTg)], rise <= rrpwr -> Ip
Qref, or tan(pf) Pref/(1+sTp) with PfFlag = 1 -> /vm -> [1/(1+sTiq)] -> (+) -> -Iqmax..Iqmax -> [1/(1+sTg)] -> Iq
(Vref0 - vm) outside dbd1..dbd2 -> x Kqv -> Iqmin..Iqmax of Kqv ---> (+)

P + jQ = vt (Ip + j Iq), vm = vt/(1+sTrv). droop(e) is Ddn e for e < 0, Dup e for e > 0, and zero within fdbd1..fdbd2.
The reactive current has priority, with PqFlag = 1 the active one; Ipmin is 0, with GenFlag = 0 (storage) -Ipmax. Below
vlow the currents fall with the voltage. The trips by voltage and frequency are not represented, and refused.
As the trajectories of PSS/E show, the power of the power factor is the filtered reference.
Source: EPRI, The New Aggregated Distributed Energy Resources (der_a) Model for Transmission Planning Studies (2019);
PSS/E Model Library, DERA1; NREL-Sienna/PowerSimulationsDynamics.jl, AggregateDistributedGenerationA.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import (
    SHORT,
    at_least,
    at_most,
    clip,
    deadband,
    lag,
    lag_rate,
    magnitude,
    pi,
    rate_limit,
    regulated,
    two_slopes,
)
from stabctl.devices.ports import PORT, At

from .electrical import FLAG, prepare, prioritized

NAME = "DER_A"
ROLE = "converter"
LIMITS = {"pord": ("Pmin", "Pmax")}
UPPER = ("rrpwr",)
DEADBANDS = ("fdbd1", "fdbd2")
LOOPS = {
    "voltage control": ("vm",),
    "reactive power control": ("qv", "iq"),
    "power control": ("pf", "pm", "ff", "xp", "pord", "ip"),
}
DYR = {
    "DERA1": "+PfFlag +FreqFlag +PqFlag +GenFlag +VtripFlag +FtripFlag Trv Trf dbd1 dbd2 Kqv Vref0 Tp Tiq Ddn "
    "Dup fdbd1 "
    "fdbd2 femax femin Pmax Pmin dPmax dPmin Tpord Kpg Kig Imax _vl0 _vl1 _vh0 _vh1 _tvl0 _tvl1 _tvh0 _tvh1 "
    "_Vrfrac _fl "
    "_fh _tfl _tfh Tg rrpwr Tv Vpr Iqvmax Iqvmin"
}


__all__ = ["prepare"]


class Par(NamedTuple):
    """Parameters of the generation, on its own MVA."""

    mva: Annotated[float, "-", "MVA over system MVA", FROM_CASE]
    V0: Annotated[float, "pu", "voltage of the power flow", FROM_CASE]
    bus: Annotated[float, "-", "its own bus", FROM_CASE]
    P0: Annotated[float, "pu", "power of the start", FROM_CASE] = 1.0
    PfFlag: Annotated[float, "-", "reactive power (1: of a power factor, 0: as ordered)", FLAG] = 1
    FreqFlag: Annotated[float, "-", "power control (1: on, 0: off)", FLAG] = 1
    PqFlag: Annotated[float, "-", "priority (1: active, 0: reactive current)", FLAG] = 0
    GenFlag: Annotated[float, "-", "what it is (1: generation, 0: storage)", FLAG] = 1
    Trv: Annotated[float, "s", "voltage filter", NOT_NEGATIVE] = 0.02
    Trf: Annotated[float, "s", "frequency filter", NOT_NEGATIVE] = 0.02
    dbd1: Annotated[float, "pu", "lower edge of the voltage deadband"] = -99.0
    dbd2: Annotated[float, "pu", "upper edge of the voltage deadband"] = 99.0
    Kqv: Annotated[float, "pu", "reactive current over voltage error", NOT_NEGATIVE] = 0.0
    Vref0: Annotated[float, "pu", "voltage reference (0: initial voltage)"] = 0.0
    Tp: Annotated[float, "s", "power filter", NOT_NEGATIVE] = 0.02
    Tiq: Annotated[float, "s", "lag of the reactive current order", NOT_NEGATIVE] = 0.02
    Ddn: Annotated[float, "pu", "power over frequency excess", NOT_NEGATIVE] = 20.0
    Dup: Annotated[float, "pu", "power over frequency deficit", NOT_NEGATIVE] = 0.0
    fdbd1: Annotated[float, "pu", "lower edge of the frequency deadband"] = -0.0006
    fdbd2: Annotated[float, "pu", "upper edge of the frequency deadband"] = 0.0006
    femax: Annotated[float, "pu", "largest power error"] = 99.0
    femin: Annotated[float, "pu", "smallest power error"] = -99.0
    Pmax: Annotated[float, "pu", "largest power"] = 1.1
    Pmin: Annotated[float, "pu", "smallest power"] = 0.0
    dPmax: Annotated[float, "pu/s", "largest rise of the power order"] = 0.5
    dPmin: Annotated[float, "pu/s", "largest fall of the power order, negative"] = -0.5
    Tpord: Annotated[float, "s", "lag of the power order", Interval(ge=SHORT)] = 0.02
    Kpg: Annotated[float, "pu", "proportional gain of the power", NOT_NEGATIVE] = 0.1
    Kig: Annotated[float, "1/s", "integral gain of the power", NOT_NEGATIVE] = 10.0
    Imax: Annotated[float, "pu", "largest current", POSITIVE] = 1.2
    Tg: Annotated[float, "s", "lag of the currents", Interval(ge=SHORT)] = 0.02
    rrpwr: Annotated[float, "pu/s", "largest rise of the active current", POSITIVE] = 99.0
    Iqvmax: Annotated[float, "pu", "largest reactive current of Kqv"] = 1.0
    Iqvmin: Annotated[float, "pu", "smallest reactive current of Kqv"] = -1.0
    vlow: Annotated[float, "pu", "voltage below which the currents fall with it", POSITIVE] = 0.1


class State(NamedTuple):
    """Filters, controls and currents."""

    vm: Annotated[float, "pu", "filtered terminal voltage"]
    pf: Annotated[float, "pu", "filtered power reference"]
    pm: Annotated[float, "pu", "filtered power"]
    ff: Annotated[float, "pu", "filtered frequency"]
    qv: Annotated[float, "pu", "lagged reactive current order"]
    xp: Annotated[float, "pu", "integral of the power error"]
    pord: Annotated[float, "pu", "power order"]
    ip: Annotated[float, "pu", "active current"]
    iq: Annotated[float, "pu", "reactive current"]


class Input(NamedTuple):
    """Signals that the generation reads."""

    Pref: Annotated[float, "pu", "power reference", PORT]
    Qref: Annotated[float, "pu", "reactive power reference", PORT]
    pfref: Annotated[float, "-", "Q/P to be held with PfFlag = 1", PORT]
    f: Annotated[float, "pu", "frequency of the bus", At("bus_frequency", "bus")]


class Output(NamedTuple):
    """Power and voltage at the terminals."""

    P: Annotated[float, "pu", "active power delivered, its own base"]
    Q: Annotated[float, "pu", "reactive power delivered, its own base"]
    vt: Annotated[float, "pu", "terminal voltage"]


def from_record(_kind: str, values: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of a record; trips are refused."""
    for name in ("VtripFlag", "FtripFlag"):
        if values[name]:
            raise ValueError(f"{name} = {values[name]} is not modeled")
    return values, []


@inline
def current(x, v, p):
    """Current into the network (pu system), real and imaginary part: (Ip - j Iq) V/|V|."""
    k = p.mva / at_least(magnitude(v[0], v[1]), p.vlow)
    return k * (x.ip * v[0] + x.iq * v[1]), k * (x.ip * v[1] - x.iq * v[0])


@inline
def output(x, v, p):
    """Power and voltage at the terminals (pu)."""
    vt = magnitude(v[0], v[1])
    k = vt * vt / at_least(vt, p.vlow)
    return Output(k * x.ip, k * x.iq, vt)


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is its own output."""
    vm, d_vm = lag(p.Trv, y.vt, x.vm)
    pf, d_pf = lag(p.Tp, u.Pref, x.pf)
    pm, d_pm = lag(p.Tp, y.P, x.pm)
    divisor = at_least(vm, 0.01)

    ff, d_ff = lag(p.Trf, u.f, x.ff)
    droop = two_slopes(deadband(1 - ff, p.fdbd1, p.fdbd2), p.Ddn, p.Dup)
    error = clip(u.Pref - pm + droop, p.femin, p.femax)
    held, d_xp = pi(p.Kpg, p.Kig, error, regulated(p.Kpg, p.Kig, x.xp), p.Pmin, p.Pmax)
    order = held if p.FreqFlag > 0.5 else u.Pref
    on = 1.0 if p.FreqFlag > 0.5 else 0.0
    d_pord = rate_limit(lag_rate(p.Tpord, order, x.pord), p.dPmin, p.dPmax)

    q = u.pfref * pf if p.PfFlag > 0.5 else u.Qref
    qv, d_qv = lag(p.Tiq, q / divisor, x.qv)
    injected = clip(p.Kqv * deadband((p.Vref0 if p.Vref0 > 0 else p.V0) - vm, p.dbd1, p.dbd2), p.Iqvmin, p.Iqvmax)
    ip, iq = prioritized(x.pord / divisor, qv + injected, 0.0 if p.GenFlag > 0.5 else -1.0, p)
    return State(
        vm=d_vm,
        pf=d_pf,
        pm=d_pm,
        ff=d_ff,
        qv=d_qv,
        xp=on * d_xp,
        pord=d_pord,
        ip=at_most(lag_rate(p.Tg, ip, x.ip), p.rrpwr),
        iq=lag_rate(p.Tg, iq, x.iq),
    )


def guess(V: complex, I: complex, p: Par) -> State:
    """States of the power flow."""
    lead = np.angle(I) - np.angle(V)
    ip, iq = float(abs(I) * np.cos(lead)), float(-abs(I) * np.sin(lead))
    P = ip * abs(V)
    return State(abs(V), P, P, 1.0, iq, P, P, ip, iq)
