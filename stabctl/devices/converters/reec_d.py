"""REEC_D: electrical control of a plant or of storage, current commands of its converter, with a compensated voltage.

Pref, x wg with PFlag = 1 -> [1/(1+sTpord)], rate dPmin..dPmax, Pmin..Pmax -> + Paux -> /vf -> -Ke Ipmax..Ipmax -> Ipcmd
Qext, or tan(pf) P with PfFlag = 1 -> Qmin..Qmax -> (+) -> [Kqp + Kqi/s], Vmin..Vmax -> Vref with VFlag = 1
                                              Q -> (-)            Qext + Vbias -> Vref with VFlag = 0
Vref - vc -> [Kvp + Kvi/s] with QFlag = 1, Qref/vf -> [1/(1+sTiq)] with QFlag = 0 -> (+) -> -Iqmax..Iqmax -> Iqcmd
(Vref0 - vf) outside dbd1..dbd2 -> x Kqv -> Iqvmin..Iqvmax --------------------> (+)
|V - (Rc + j Xc) I| with VcmpFlag = 1, V + Kc Q with VcmpFlag = 0 -> [1/(1+sTr1)] -> vc

vf = vt/(1+sTrv). Iqmax is the least of Imax and the curve VDL1 (vf), Ipmax of the curve VDL2 (vf) and what Imax leaves
beside Iqcmd; with PqFlag = 1 the active current comes first. Curves have up to ten points. Below Vblkl and above Vblkh
both commands are zero at once. Outside Vdip..Vup integrals, lagged current and power order stay as they are, and only
there Iqv is injected. What is held for some time after a dip or a blocking (Thld, Iqfrz, Thld2, Tblk) is not
represented.
Source: WECC Renewable Energy Modeling Task Force, REEC_D; P. Pourbeik, Proposal for New Features for the Renewable
Energy System Generic Models, memorandum to the WECC REMTF, 2019; PSS/E Model Library, REECD1. Diagram and constants are
those of public implementations that cite it: OpenIPSL, REECDU1, and InterPSS, REECD.
"""

from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE, SHARE
from stabctl.devices.blocks import lag, lookup, while_within
from stabctl.devices.ports import PORT, fixed

from . import electrical
from .electrical import FLAG, LOOPS, Output, Own, behind, commands, prepare

NAME = "REEC_D"
ROLE = "electrical control"
LIMITS = {"pord": ("Pmin", "Pmax")}
_CONSTANTS = (
    "+PfFlag +VFlag +QFlag +PFlag +PqFlag +VcmpFlag Vdip Vup Trv dbd1 dbd2 Kqv Iqvmax Iqvmin Vref0 Iqfrz Thld "
    "Thld2 Tp Qmax Qmin Vmax Vmin Kqp Kqi Kvp Kvi Vbias Tiq dPmax dPmin Pmax Pmin Imax Tpord Vq1 Iq1 Vq2 Iq2 Vq3 "
    "Iq3 Vq4 Iq4 Vq5 Iq5 Vq6 Iq6 Vq7 Iq7 Vq8 Iq8 Vq9 Iq9 Vq10 Iq10 Vp1 Ip1 Vp2 Ip2 Vp3 Ip3 Vp4 Ip4 Vp5 Ip5 Vp6 "
    "Ip6 Vp7 Ip7 Vp8 Ip8 Vp9 Ip9 Vp10 Ip10 Rc Xc Tr1 Kc Ke Vblkl Vblkh Tblk"
)
DYR = {"REECD": _CONSTANTS, "REECD1": _CONSTANTS, "REECDU1": _CONSTANTS}
__all__ = ["LOOPS", "Output", "prepare"]


class Par(NamedTuple):
    """Parameters of one electrical control, on the converter base."""

    V0: Annotated[float, "pu", "voltage of the power flow", FROM_CASE]
    P0: Annotated[float, "pu", "power of the start", FROM_CASE] = 1.0
    PfFlag: Annotated[float, "-", "reactive power (1: of a power factor, 0: as ordered)", FLAG] = 0
    VFlag: Annotated[float, "-", "voltage reference (1: from reactive power, 0: as ordered)", FLAG] = 1
    QFlag: Annotated[float, "-", "reactive current (1: from voltage, 0: from reactive power)", FLAG] = 0
    PFlag: Annotated[float, "-", "power reference (1: times the generator speed, 0: as ordered)", FLAG] = 0
    PqFlag: Annotated[float, "-", "priority (1: active, 0: reactive current)", FLAG] = 0
    VcmpFlag: Annotated[float, "-", "compensated voltage (1: behind Rc + j Xc, 0: with droop Kc)", FLAG] = 0
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
    Qmax: Annotated[float, "pu", "largest reactive power or voltage reference"] = 0.4
    Qmin: Annotated[float, "pu", "smallest reactive power or voltage reference"] = -0.4
    Vmax: Annotated[float, "pu", "largest voltage reference"] = 1.1
    Vmin: Annotated[float, "pu", "smallest voltage reference"] = 0.9
    Kqp: Annotated[float, "pu", "proportional gain of reactive power", NOT_NEGATIVE] = 0.0
    Kqi: Annotated[float, "1/s", "integral gain of reactive power", NOT_NEGATIVE] = 0.1
    Kvp: Annotated[float, "pu", "proportional gain of voltage", NOT_NEGATIVE] = 1.0
    Kvi: Annotated[float, "1/s", "integral gain of voltage", NOT_NEGATIVE] = 40.0
    Vbias: Annotated[float, "pu", "added to the voltage reference with VFlag = 0"] = 0.0
    Tiq: Annotated[float, "s", "lag of the reactive current", NOT_NEGATIVE] = 0.02
    dPmax: Annotated[float, "pu/s", "largest rise of the power order"] = 99.0
    dPmin: Annotated[float, "pu/s", "largest fall of the power order, negative"] = -99.0
    Pmax: Annotated[float, "pu", "largest power order"] = 1.0
    Pmin: Annotated[float, "pu", "smallest power order"] = 0.0
    Imax: Annotated[float, "pu", "largest current", POSITIVE] = 1.11
    Tpord: Annotated[float, "s", "lag of the power order", NOT_NEGATIVE] = 0.02
    Rc: Annotated[float, "pu", "compensation resistance"] = 0.0
    Xc: Annotated[float, "pu", "compensation reactance"] = 0.0
    Tr1: Annotated[float, "s", "filter of the compensated voltage", NOT_NEGATIVE] = 0.02
    Kc: Annotated[float, "pu", "compensated voltage over reactive power"] = 0.0
    Ke: Annotated[float, "-", "least active current over its limit: 0 for a plant, 1 for storage", SHARE] = 0.0
    Vblkl: Annotated[float, "pu", "voltage below which the converter is blocked"] = -99.0
    Vblkh: Annotated[float, "pu", "voltage above which the converter is blocked (0: none)"] = 99.0
    Vq1: Annotated[float, "pu", "voltage of point 1 of VDL1"] = 0.0
    Iq1: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq2: Annotated[float, "pu", "voltage of point 2 of VDL1"] = 0.1
    Iq2: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq3: Annotated[float, "pu", "voltage of point 3 of VDL1"] = 0.2
    Iq3: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq4: Annotated[float, "pu", "voltage of point 4 of VDL1"] = 0.3
    Iq4: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq5: Annotated[float, "pu", "voltage of point 5 of VDL1"] = 0.4
    Iq5: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq6: Annotated[float, "pu", "voltage of point 6 of VDL1"] = 0.5
    Iq6: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq7: Annotated[float, "pu", "voltage of point 7 of VDL1"] = 0.6
    Iq7: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq8: Annotated[float, "pu", "voltage of point 8 of VDL1"] = 0.7
    Iq8: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq9: Annotated[float, "pu", "voltage of point 9 of VDL1"] = 0.8
    Iq9: Annotated[float, "pu", "reactive current there"] = 99.0
    Vq10: Annotated[float, "pu", "voltage of point 10 of VDL1"] = 0.9
    Iq10: Annotated[float, "pu", "reactive current there"] = 99.0
    Vp1: Annotated[float, "pu", "voltage of point 1 of VDL2"] = 0.0
    Ip1: Annotated[float, "pu", "active current there"] = 99.0
    Vp2: Annotated[float, "pu", "voltage of point 2 of VDL2"] = 0.1
    Ip2: Annotated[float, "pu", "active current there"] = 99.0
    Vp3: Annotated[float, "pu", "voltage of point 3 of VDL2"] = 0.2
    Ip3: Annotated[float, "pu", "active current there"] = 99.0
    Vp4: Annotated[float, "pu", "voltage of point 4 of VDL2"] = 0.3
    Ip4: Annotated[float, "pu", "active current there"] = 99.0
    Vp5: Annotated[float, "pu", "voltage of point 5 of VDL2"] = 0.4
    Ip5: Annotated[float, "pu", "active current there"] = 99.0
    Vp6: Annotated[float, "pu", "voltage of point 6 of VDL2"] = 0.5
    Ip6: Annotated[float, "pu", "active current there"] = 99.0
    Vp7: Annotated[float, "pu", "voltage of point 7 of VDL2"] = 0.6
    Ip7: Annotated[float, "pu", "active current there"] = 99.0
    Vp8: Annotated[float, "pu", "voltage of point 8 of VDL2"] = 0.7
    Ip8: Annotated[float, "pu", "active current there"] = 99.0
    Vp9: Annotated[float, "pu", "voltage of point 9 of VDL2"] = 0.8
    Ip9: Annotated[float, "pu", "active current there"] = 99.0
    Vp10: Annotated[float, "pu", "voltage of point 10 of VDL2"] = 0.9
    Ip10: Annotated[float, "pu", "active current there"] = 99.0


class State(NamedTuple):
    """Filters, integrals and orders."""

    vm: Annotated[float, "pu", "filtered terminal voltage"]
    pf: Annotated[float, "pu", "filtered power, for the power factor"]
    vq: Annotated[float, "pu", "integral of the reactive power error"]
    iv: Annotated[float, "pu", "integral of the voltage error"]
    iq: Annotated[float, "pu", "lagged reactive current"]
    pord: Annotated[float, "pu", "power order"]
    vc: Annotated[float, "pu", "filtered compensated voltage"]


class Input(NamedTuple):
    """Signals that the electrical control reads, on the converter base."""

    Pref: Annotated[float, "pu", "power reference", PORT]
    Qext: Annotated[float, "pu", "reactive power or voltage reference", PORT]
    pfref: Annotated[float, "-", "Q/P to be held with PfFlag = 1", PORT]
    wg: Annotated[float, "pu", "speed of the generator", fixed(1.0)]
    Paux: Annotated[float, "pu", "power beside the order", fixed(0.0)]
    vt: Annotated[float, "pu", "terminal voltage"]
    P: Annotated[float, "pu", "active power"]
    Q: Annotated[float, "pu", "reactive power"]


def from_record(_kind: str, values: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of a record; what is held for some time after a dip is not modeled."""
    for name in ("Thld", "Thld2", "Tblk"):
        if values[name]:
            raise ValueError(f"{name} = {values[name]:g} is not modeled")
    return values, []


@inline
def curves(vf, u, p):
    """Limits of the active and of the reactive current (pu) by the curves, 0 while the converter is blocked."""
    most_p = lookup(
        vf,
        (p.Vp1, p.Vp2, p.Vp3, p.Vp4, p.Vp5, p.Vp6, p.Vp7, p.Vp8, p.Vp9, p.Vp10),
        (p.Ip1, p.Ip2, p.Ip3, p.Ip4, p.Ip5, p.Ip6, p.Ip7, p.Ip8, p.Ip9, p.Ip10),
    )
    most_q = lookup(
        vf,
        (p.Vq1, p.Vq2, p.Vq3, p.Vq4, p.Vq5, p.Vq6, p.Vq7, p.Vq8, p.Vq9, p.Vq10),
        (p.Iq1, p.Iq2, p.Iq3, p.Iq4, p.Iq5, p.Iq6, p.Iq7, p.Iq8, p.Iq9, p.Iq10),
    )
    return while_within(most_p, u.vt, p.Vblkl, p.Vblkh), while_within(most_q, u.vt, p.Vblkl, p.Vblkh)


@inline
def equations(x, u, p):
    """Current commands (pu), and state derivatives (1/s)."""
    vf, _ = lag(p.Trv, u.vt, x.vm)
    vc, d_vc = lag(p.Tr1, behind(u.vt, u.P, u.Q, p) if p.VcmpFlag > 0.5 else u.vt + p.Kc * u.Q, x.vc)
    pref = u.Pref * u.wg if p.PFlag > 0.5 else u.Pref
    ip, iq, d = commands(x, u, p, Own(pref, u.Paux, vc, p.Vbias, -p.Ke, 1.0, *curves(vf, u, p)))
    return Output(ip, iq), State(vm=d.vm, pf=d.pf, vq=d.vq, iv=d.iv, iq=d.iq, pord=d.pord, vc=d_vc)


def guess(V: complex, I: complex) -> State:
    """States of the power flow."""
    return State(*electrical.guess(V, I), abs(V))
