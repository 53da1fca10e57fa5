"""REEC_A: electrical control of a wind or photovoltaic plant, current commands of its converter.

Pref, x wg with PFlag = 1 -> [1/(1+sTpord)], rate dPmin..dPmax, Pmin..Pmax -> /vf -> 0..Ipmax -> Ipcmd
Qext, or tan(pf) P with PfFlag = 1 -> Qmin..Qmax -> (+) -> [Kqp + Kqi/s], Vmin..Vmax -> Vref with VFlag = 1
                                              Q -> (-)            Qext + Vref1 -> Vref with VFlag = 0
Vref - vf -> [Kvp + Kvi/s] with QFlag = 1, Qref/vf -> [1/(1+sTiq)] with QFlag = 0 -> (+) -> -Iqmax..Iqmax -> Iqcmd
(Vref0 - vf) outside dbd1..dbd2 -> x Kqv -> Iqvmin..Iqvmax --------------------> (+)

vf = vt/(1+sTrv). Iqmax is the least of Imax and the curve VDL1 (vf), Ipmax of the curve VDL2 (vf) and what Imax leaves
beside Iqcmd; with PqFlag = 1 the active current comes first. Outside Vdip..Vup integrals, lagged current and power
order stay as they are, and only there Iqv is injected; after a dip (Thld, Iqfrz, Thld2) it is not. The curves are
constant beyond their ends; points at one voltage or below the one before are not used.
Source: WECC Renewable Energy Modeling Task Force, WECC Wind Plant Dynamic Modeling Guidelines (2014), REEC_A; PSS/E
Model Library, REECA1.
"""

from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import lag
from stabctl.devices.ports import PORT, fixed

from .electrical import FLAG, LOOPS, Output, Own, State, commands, curves, guess, local, prepare

NAME = "REEC_A"
ROLE = "electrical control"
LIMITS = {"pord": ("Pmin", "Pmax")}
DYR = {
    "REECA1": "+bus +PfFlag +VFlag +QFlag +PFlag +PqFlag Vdip Vup Trv dbd1 dbd2 Kqv Iqvmax Iqvmin Vref0 Iqfrz "
    "Thld Thld2 "
    "Tp Qmax Qmin Vmax Vmin Kqp Kqi Kvp Kvi Vref1 Tiq dPmax dPmin Pmax Pmin Imax Tpord Vq1 Iq1 Vq2 Iq2 Vq3 Iq3 Vq4 Iq4 "
    "Vp1 Ip1 Vp2 Ip2 Vp3 Ip3 Vp4 Ip4"
}
__all__ = ["LOOPS", "Output", "State", "guess", "prepare"]


class Par(NamedTuple):
    """Parameters of one electrical control, on the converter base."""

    V0: Annotated[float, "pu", "voltage of the power flow", FROM_CASE]
    P0: Annotated[float, "pu", "power of the start", FROM_CASE] = 1.0
    PfFlag: Annotated[float, "-", "reactive power (1: of a power factor, 0: as ordered)", FLAG] = 0
    VFlag: Annotated[float, "-", "voltage reference (1: from reactive power, 0: as ordered)", FLAG] = 1
    QFlag: Annotated[float, "-", "reactive current (1: from voltage, 0: from reactive power)", FLAG] = 0
    PqFlag: Annotated[float, "-", "priority (1: active, 0: reactive current)", FLAG] = 0
    Vdip: Annotated[float, "pu", "voltage below which the control is frozen and Kqv acts"] = -99.0
    Vup: Annotated[float, "pu", "voltage above which the control is frozen and Kqv acts (0: none)"] = 99.0
    Trv: Annotated[float, "s", "voltage filter", NOT_NEGATIVE] = 0.02
    dbd1: Annotated[float, "pu", "lower edge of the voltage deadband"] = -0.05
    dbd2: Annotated[float, "pu", "upper edge of the voltage deadband"] = 0.05
    Kqv: Annotated[float, "pu", "reactive current over voltage error, outside Vdip..Vup", NOT_NEGATIVE] = 0.0
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
    PFlag: Annotated[float, "-", "power reference (1: times the generator speed, 0: as ordered)", FLAG] = 0
    Vref1: Annotated[float, "pu", "added to the voltage reference with VFlag = 0"] = 0.0
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


class Input(NamedTuple):
    """Signals that an electrical control reads, on the converter base."""

    Pref: Annotated[float, "pu", "power reference", PORT]
    Qext: Annotated[float, "pu", "reactive power or voltage reference", PORT]
    pfref: Annotated[float, "-", "Q/P to be held with PfFlag = 1", PORT]
    wg: Annotated[float, "pu", "speed of the generator", fixed(1.0)]
    vt: Annotated[float, "pu", "terminal voltage"]
    P: Annotated[float, "pu", "active power"]
    Q: Annotated[float, "pu", "reactive power"]


def from_record(_kind: str, values: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of a record; a remote bus and an injection held after a dip are not modeled."""
    for name in ("Thld", "Thld2"):
        if values[name]:
            raise ValueError(f"{name} = {values[name]:g} is not modeled")
    return local(values), []


@inline
def equations(x, u, p):
    """Current commands (pu), and state derivatives (1/s)."""
    pref = u.Pref * u.wg if p.PFlag > 0.5 else u.Pref
    vf, _ = lag(p.Trv, u.vt, x.vm)
    ip, iq, rates = commands(x, u, p, Own(pref, 0.0, vf, p.Vref1, 0.0, 1.0, *curves(vf, p)))
    return Output(ip, iq), rates
