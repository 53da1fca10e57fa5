"""REEC_C: electrical control of battery storage, current commands of its converter, with the state of charge.

Pref -> [1/(1+sTpord)], rate dPmin..dPmax, Pmin..Pmax -> /vf -> -Ipmax..Ipmax -> Ipcmd
Qext, or tan(pf) P with PfFlag = 1 -> Qmin..Qmax -> (+) -> [Kqp + Kqi/s], Vmin..Vmax -> Vref with VFlag = 1
                                              Q -> (-)                    Qext -> Vref with VFlag = 0
Vref - vf -> [Kvp + Kvi/s] with QFlag = 1, Qref/vf -> [1/(1+sTiq)] with QFlag = 0 -> (+) -> -Iqmax..Iqmax -> Iqcmd
(Vref0 - vf) outside dbd1..dbd2 -> x Kqv -> Iqvmin..Iqvmax --------------------> (+)
SOCini - (P - P0)/(sT) -> SOC, between SOCmin and SOCmax: at SOCmin no discharge (Ipcmd <= 0), at SOCmax no charge

vf = vt/(1+sTrv). Iqmax is the least of Imax and the curve VDL1 (vf), Ipmax of the curve VDL2 (vf) and what Imax leaves
beside Iqcmd; with PqFlag = 1 the active current comes first. Outside Vdip..Vup integrals, lagged current and power
order stay as they are. The charge counts the power beyond that of the start, so that nothing moves while nothing
happens; where it stops the current it rests, until the order turns.
Source: WECC Renewable Energy Modeling Task Force, WECC Battery Storage Dynamic Modeling Guideline (2016), REEC_C; PSS/E
Model Library, REECC1.
"""

from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE, SHARE
from stabctl.devices.blocks import available, lag

from . import electrical
from .electrical import FLAG, LOOPS, Input, Output, Own, commands, curves, local, prepare

NAME = "REEC_C"
ROLE = "electrical control"
LIMITS = {"pord": ("Pmin", "Pmax"), "soc": ("SOCmin", "SOCmax")}
STOPS = ("soc",)
DYR = {
    "REECC1": "+bus +PfFlag +VFlag +QFlag +PqFlag Vdip Vup Trv dbd1 dbd2 Kqv Iqvmax Iqvmin Vref0 Tp Qmax Qmin "
    "Vmax Vmin "
    "Kqp Kqi Kvp Kvi Tiq dPmax dPmin Pmax Pmin Imax Tpord Vq1 Iq1 Vq2 Iq2 Vq3 Iq3 Vq4 Iq4 Vp1 Ip1 Vp2 Ip2 Vp3 Ip3 Vp4 "
    "Ip4 T SOCini SOCmax SOCmin"
}
__all__ = ["LOOPS", "Input", "Output", "prepare"]


class Par(NamedTuple):
    """Parameters of one electrical control, on the converter base."""

    P0: Annotated[float, "pu", "power of the start", FROM_CASE]
    running: Annotated[float, "-", "whether P0 is known; before, the charge rests", FROM_CASE]
    V0: Annotated[float, "pu", "voltage of the power flow", FROM_CASE]
    PfFlag: Annotated[float, "-", "reactive power (1: of a power factor, 0: as ordered)", FLAG] = 0
    VFlag: Annotated[float, "-", "voltage reference (1: from reactive power, 0: as ordered)", FLAG] = 1
    QFlag: Annotated[float, "-", "reactive current (1: from voltage, 0: from reactive power)", FLAG] = 0
    PqFlag: Annotated[float, "-", "priority (1: active, 0: reactive current)", FLAG] = 0
    Vdip: Annotated[float, "pu", "voltage below which the control is frozen"] = -99.0
    Vup: Annotated[float, "pu", "voltage above which the control is frozen (0: none)"] = 99.0
    Trv: Annotated[float, "s", "voltage filter", NOT_NEGATIVE] = 0.02
    dbd1: Annotated[float, "pu", "lower edge of the voltage deadband"] = -0.05
    dbd2: Annotated[float, "pu", "upper edge of the voltage deadband"] = 0.05
    Kqv: Annotated[float, "pu", "reactive current over voltage error", NOT_NEGATIVE] = 0.0
    Iqvmax: Annotated[float, "pu", "largest reactive current injection"] = 1.05
    Iqvmin: Annotated[float, "pu", "smallest reactive current injection"] = -1.05
    Vref0: Annotated[float, "pu", "voltage reference of the injection (0: initial voltage)"] = 0.0
    Tp: Annotated[float, "s", "power filter", NOT_NEGATIVE] = 0.05
    Qmax: Annotated[float, "pu", "largest reactive power"] = 0.4
    Qmin: Annotated[float, "pu", "smallest reactive power"] = -0.4
    Vmax: Annotated[float, "pu", "largest voltage reference"] = 1.1
    Vmin: Annotated[float, "pu", "smallest voltage reference"] = 0.9
    Kqp: Annotated[float, "pu", "proportional gain of reactive power", NOT_NEGATIVE] = 0.0
    Kqi: Annotated[float, "1/s", "integral gain of reactive power", NOT_NEGATIVE] = 0.1
    Kvp: Annotated[float, "pu", "proportional gain of voltage", NOT_NEGATIVE] = 1.0
    Kvi: Annotated[float, "1/s", "integral gain of voltage", NOT_NEGATIVE] = 40.0
    Tiq: Annotated[float, "s", "lag of the reactive current", NOT_NEGATIVE] = 0.02
    dPmax: Annotated[float, "pu/s", "largest rise of the power order"] = 99.0
    dPmin: Annotated[float, "pu/s", "largest fall of the power order, negative"] = -99.0
    Pmax: Annotated[float, "pu", "largest power order"] = 1.0
    Pmin: Annotated[float, "pu", "smallest power order"] = 0.0
    Imax: Annotated[float, "pu", "largest current", POSITIVE] = 1.11
    Tpord: Annotated[float, "s", "lag of the power order", NOT_NEGATIVE] = 0.02
    Vq1: Annotated[float, "pu", "voltage of the first point of VDL1"] = 0.0
    Iq1: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq2: Annotated[float, "pu", "voltage of the second point of VDL1"] = 0.1
    Iq2: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq3: Annotated[float, "pu", "voltage of the third point of VDL1"] = 0.2
    Iq3: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq4: Annotated[float, "pu", "voltage of the fourth point of VDL1"] = 0.3
    Iq4: Annotated[float, "pu", "reactive current there"] = 99.0
    Vp1: Annotated[float, "pu", "voltage of the first point of VDL2"] = 0.0
    Ip1: Annotated[float, "pu", "active current there"] = 99.0
    Vp2: Annotated[float, "pu", "voltage of the second point of VDL2"] = 0.1
    Ip2: Annotated[float, "pu", "active current there"] = 99.0
    Vp3: Annotated[float, "pu", "voltage of the third point of VDL2"] = 0.2
    Ip3: Annotated[float, "pu", "active current there"] = 99.0
    Vp4: Annotated[float, "pu", "voltage of the fourth point of VDL2"] = 0.3
    Ip4: Annotated[float, "pu", "active current there"] = 99.0
    T: Annotated[float, "s", "time in which full power empties the storage", POSITIVE] = 999.0
    SOCini: Annotated[float, "-", "initial state of charge", SHARE] = 0.5
    SOCmax: Annotated[float, "-", "state of charge at which charging ends"] = 0.8
    SOCmin: Annotated[float, "-", "state of charge at which discharging ends"] = 0.2


class State(NamedTuple):
    """Filters, integrals, orders and charge."""

    vm: Annotated[float, "pu", "filtered terminal voltage"]
    pf: Annotated[float, "pu", "filtered power, for the power factor"]
    vq: Annotated[float, "pu", "integral of the reactive power error"]
    iv: Annotated[float, "pu", "integral of the voltage error"]
    iq: Annotated[float, "pu", "lagged reactive current"]
    pord: Annotated[float, "pu", "power order"]
    soc: Annotated[float, "-", "state of charge"]


def from_record(_kind: str, values: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of a record; voltage control of a remote bus is not modeled."""
    return local(values), []


def automatic(p: Par, u: Input) -> Par:
    """Parameters with the power of the start."""
    return p._replace(P0=float(u.P), running=1.0)


def guess(V: complex, I: complex, p: Par) -> State:
    """States of the power flow, with the initial charge."""
    return State(*electrical.guess(V, I), p.SOCini)


@inline
def equations(x, u, p):
    """Current commands (pu), and state derivatives (1/s)."""
    vf, _ = lag(p.Trv, u.vt, x.vm)
    ip, iq, d = commands(x, u, p, Own(u.Pref, 0.0, vf, 0.0, -1.0, 0.0, *curves(vf, p)))
    given = available(ip, x.soc, p.SOCmin, p.SOCmax)
    d_soc = (p.P0 - u.P) / p.T if p.running > 0.5 and given == ip else 0 * x.soc
    rates = State(vm=d.vm, pf=d.pf, vq=d.vq, iv=d.iv, iq=d.iq, pord=d.pord, soc=d_soc)
    return Output(given, iq), rates
