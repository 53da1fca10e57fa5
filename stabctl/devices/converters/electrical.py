"""What the electrical controls REEC_A to REEC_D share: signals, reactive and active current, current limits.

    Qref = Qext, or tan(pf) P/(1+sTp) with PfFlag = 1, held between Qmin and Qmax
    Vref = [Kqp + Kqi/s] (Qref - Q) between Vmin and Vmax with VFlag = 1, otherwise the same input as a voltage
    Iq   = [Kvp + Kvi/s] (Vref - vf) between -Iqmax and Iqmax with QFlag = 1, otherwise Qref/vf/(1+sTiq)
    Iqcmd = Iq + Iqv between -Iqmax and Iqmax, Iqv = Kqv (Vref0 - vf) outside dbd1..dbd2, between Iqvmin and Iqvmax
    Ipcmd = Pord/vf between Ipmin and Ipmax; Pord = Pref/(1+sTpord), rate dPmin..dPmax, between Pmin and Pmax

vf is the filtered terminal voltage vt/(1+sTrv), at least 0.01 as a divisor. While vt is below Vdip or above Vup, the
integrals, Iq/(1+sTiq) and Pord stay as they are. A regulator without gains keeps its output. A unit without active
power at the start has no power factor: PfFlag is 0 there.
Source: WECC Renewable Energy Modeling Task Force, WECC Solar Plant Dynamic Modeling Guidelines (2014), and WECC Battery
Storage Dynamic Modeling Guideline (2016); NREL-Sienna/PowerSimulationsDynamics.jl, outer and inner control type B.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl.devices.blocks import (
    at_least,
    at_most,
    clip,
    deadband,
    lag,
    lag_rate,
    lookup,
    low_value,
    magnitude,
    pi,
    rate_limit,
    regulated,
    while_within,
)
from stabctl.devices.ports import PORT

FLAG = Interval(ge=0, le=1)
LOOPS = {
    "voltage control": ("vm", "iv"),
    "reactive power control": ("vq", "iq", "pf"),
    "power order": ("pord",),
}
NO_POWER = 1e-6  # pu   below which Q/P is not defined
NO_LIMIT = 99.0  # pu   of a curve without points


class State(NamedTuple):
    """Filters, integrals and orders."""

    vm: Annotated[float, "pu", "filtered terminal voltage"]
    pf: Annotated[float, "pu", "filtered power, for the power factor"]
    vq: Annotated[float, "pu", "integral of the reactive power error"]
    iv: Annotated[float, "pu", "integral of the voltage error"]
    iq: Annotated[float, "pu", "lagged reactive current"]
    pord: Annotated[float, "pu", "power order"]


class Input(NamedTuple):
    """Signals that an electrical control reads, on the converter base."""

    Pref: Annotated[float, "pu", "power reference", PORT]
    Qext: Annotated[float, "pu", "reactive power or voltage reference", PORT]
    pfref: Annotated[float, "-", "Q/P to be held with PfFlag = 1", PORT]
    vt: Annotated[float, "pu", "terminal voltage"]
    P: Annotated[float, "pu", "active power"]
    Q: Annotated[float, "pu", "reactive power"]


class Output(NamedTuple):
    """Current commands."""

    Ipcmd: Annotated[float, "pu", "active current command, converter base"]
    Iqcmd: Annotated[float, "pu", "reactive current command, converter base"]


@inline
def steady(rate, used, u, p):
    """The state derivative (1/s), 0 while the voltage is outside Vdip..Vup or where the state is not used."""
    return while_within(rate, u.vt, p.Vdip, p.Vup) if used else 0 * rate


@inline
def root(I, used):
    """What the limit I leaves beside a current in quadrature, sqrt(I^2 - used^2), or nothing."""
    return np.sqrt(at_least(I * I - used * used, 0.0))


@inline
def prioritized(ip, iq, low, p):
    """Active and reactive current (pu) within Imax, one of them first; ip is at least `low` times its limit."""
    if p.PqFlag > 0.5:
        ip = clip(ip, low * p.Imax, p.Imax)
        most = root(p.Imax, ip)
        return ip, clip(iq, -most, most)
    iq = clip(iq, -p.Imax, p.Imax)
    most = root(p.Imax, iq)
    return clip(ip, low * most, most), iq


@inline
def curves(vf, p):
    """Limits of the active and of the reactive current (pu) by the curves VDL2 and VDL1 of four points."""
    most_p = lookup(vf, (p.Vp1, p.Vp2, p.Vp3, p.Vp4), (p.Ip1, p.Ip2, p.Ip3, p.Ip4))
    return most_p, lookup(vf, (p.Vq1, p.Vq2, p.Vq3, p.Vq4), (p.Iq1, p.Iq2, p.Iq3, p.Iq4))


@inline
def behind(v, P, Q, p):
    """Voltage |V - (Rc + j Xc) I| (pu) behind a compensating impedance, at the voltage v and the power P + jQ."""
    at = at_least(v, 0.01)
    return magnitude(v - (p.Rc * P + p.Xc * Q) / at, -(p.Xc * P - p.Rc * Q) / at)


class Own(NamedTuple):
    """What one electrical control has of its own (pu)."""

    pref: float  # power reference
    aux: float  # power beside the order
    vc: float  # voltage that the inner regulator holds
    bias: float  # added to the voltage reference with VFlag = 0
    low: float  # least active current over its limit: 0 for a plant, negative for storage
    dips: float  # 1: reactive current is injected outside Vdip..Vup alone; 0: always
    most_p: float  # limits of the currents by voltage
    most_q: float


@inline
def commands(x, u, p, own):
    """Active and reactive current command (pu), and state derivatives (1/s); regulators that are not in use rest."""
    vf, d_vm = lag(p.Trv, u.vt, x.vm)
    divisor = at_least(vf, 0.01)

    pf, d_pf = lag(p.Tp, u.P, x.pf)
    given = u.pfref * pf if p.PfFlag > 0.5 else u.Qext
    q = clip(given, p.Qmin, p.Qmax)
    from_q, d_vq = pi(p.Kqp, p.Kqi, q - u.Q, regulated(p.Kqp, p.Kqi, x.vq), p.Vmin, p.Vmax)
    vref = from_q if p.VFlag > 0.5 else clip(given + own.bias, p.Vmin, p.Vmax)

    pord, _ = lag(p.Tpord, clip(own.pref, p.Pmin, p.Pmax), x.pord)
    d_pord = rate_limit(lag_rate(p.Tpord, own.pref, x.pord), p.dPmin, p.dPmax)
    ip, most_p, most_q = (pord + own.aux) / divisor, at_most(own.most_p, p.Imax), at_most(own.most_q, p.Imax)
    if p.PqFlag > 0.5:
        ip = clip(ip, own.low * most_p, most_p)
        most_q = low_value(most_q, root(p.Imax, ip))

    inner = p.QFlag > 0.5
    from_v, d_iv = pi(p.Kvp, p.Kvi, vref - own.vc, regulated(p.Kvp, p.Kvi, x.iv), -most_q, most_q)
    lagged, d_iq = lag(p.Tiq, q / divisor, x.iq)
    error = (p.Vref0 if p.Vref0 > 0 else p.V0) - vf
    injected = clip(p.Kqv * deadband(error, p.dbd1, p.dbd2), p.Iqvmin, p.Iqvmax)
    if own.dips > 0.5:
        injected = injected - while_within(injected, u.vt, p.Vdip, p.Vup)
    iq = clip((from_v if inner else lagged) + injected, -most_q, most_q)
    if p.PqFlag <= 0.5:
        most_p = low_value(most_p, root(p.Imax, iq))
        ip = clip(ip, own.low * most_p, most_p)

    d_vq, d_iv = steady(d_vq, inner and p.VFlag > 0.5, u, p), steady(d_iv, inner, u, p)
    d_iq, d_pord = steady(d_iq, not inner, u, p), steady(d_pord, True, u, p)
    return ip, iq, State(vm=d_vm, pf=d_pf, vq=d_vq, iv=d_iv, iq=d_iq, pord=d_pord)


def prepare(p: Any) -> Any:
    """Parameters with curves that ascend; without power at the start, Q is held as ordered: Q/P is not defined."""
    return rising(p._replace(PfFlag=0) if abs(p.P0) < NO_POWER else p)


def guess(V: complex, I: complex) -> State:
    """States of the power flow."""
    S = V * I.conjugate()
    return State(abs(V), S.real, abs(V), S.imag / abs(V), S.imag / abs(V), S.real)


def rising(p: Any) -> Any:
    """Parameters whose curves have ascending voltages, and no limit where every point is zero.

    Points 0, 0 after the last of a curve are unused.
    """
    for v, i in (("Vq", "Iq"), ("Vp", "Ip")):
        count = sum(name[:2] == v and name[2:].isdecimal() for name in p._fields)
        if not count:
            continue
        given = [(getattr(p, f"{v}{k}"), getattr(p, f"{i}{k}")) for k in range(1, count + 1)]
        while len(given) > 1 and given[-1] == (0.0, 0.0):
            given.pop()
        points = sorted(dict(reversed(given)).items())
        if not any(limit for _, limit in points):
            points = [(0.0, NO_LIMIT)]
        while len(points) < count:
            points.append((points[-1][0] + 1.0, points[-1][1]))
        for k, (volts, limit) in enumerate(points, 1):
            p = p._replace(**{f"{v}{k}": volts, f"{i}{k}": limit})
    return p


def local(values: dict[str, Any]) -> dict[str, Any]:
    """Constants of a record that controls its own bus; `ValueError` for a remote bus."""
    if values["bus"]:
        raise ValueError(f"voltage control of the remote bus {values['bus']} is not modeled")
    return {name: value for name, value in values.items() if name != "bus"}
