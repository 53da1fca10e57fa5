"""REEC_B: electrical control of a photovoltaic plant, current commands of its converter.

Pref -> [1/(1+sTpord)], rate dPmin..dPmax, Pmin..Pmax -> /vf -> at most Ipmax -> Ipcmd
Qext, or tan(pf) P with PfFlag = 1 -> Qmin..Qmax -> (+) -> [Kqp + Kqi/s], Vmin..Vmax -> Vref with VFlag = 1
                                              Q -> (-)
Vref - vf -> [Kvp + Kvi/s] with QFlag = 1, Qref/vf -> [1/(1+sTiq)] with QFlag = 0 -> (+) -> -Iqmax..Iqmax -> Iqcmd
(Vref0 - vf) outside dbd1..dbd2 -> x Kqv -> Iqvmin..Iqvmax --------------------------> (+)

vf = vt/(1+sTrv). The reactive current has priority (Iqmax = Imax, Ipmax = sqrt(Imax^2 - Iqcmd^2)), with PqFlag = 1 the
active one. Outside Vdip..Vup integrals, lagged current and power order stay as they are.
Source: WECC Renewable Energy Modeling Task Force, WECC Solar Plant Dynamic Modeling Guidelines (2014), REEC_B; PSS/E
Model Library, REECB1; NREL-Sienna/PowerSimulationsDynamics.jl, RECurrentControlB.
"""

from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import lag

from .electrical import FLAG, LOOPS, Input, Output, Own, State, commands, guess, local, prepare

NAME = "REEC_B"
ROLE = "electrical control"
LIMITS = {"pord": ("Pmin", "Pmax")}
DYR = {
    "REECB1": "+bus +PfFlag +VFlag +QFlag +PqFlag Vdip Vup Trv dbd1 dbd2 Kqv Iqvmax Iqvmin Vref0 Tp Qmax Qmin Vmax "
    "Vmin Kqp Kqi Kvp Kvi Tiq dPmax dPmin Pmax Pmin Imax Tpord"
}
__all__ = ["LOOPS", "Input", "Output", "State", "guess", "prepare"]


class Par(NamedTuple):
    """Parameters of one electrical control, on the converter base."""

    V0: Annotated[float, "pu", "voltage of the power flow", FROM_CASE]
    P0: Annotated[float, "pu", "power of the start", FROM_CASE] = 1.0
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


def from_record(_kind: str, values: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of a record; voltage control of a remote bus is not modeled."""
    return local(values), []


@inline
def equations(x, u, p):
    """Current commands (pu), and state derivatives (1/s)."""
    vf, _ = lag(p.Trv, u.vt, x.vm)
    most = p.Imax + 0 * vf
    ip, iq, rates = commands(x, u, p, Own(u.Pref, 0.0, vf, 0.0, 0.0, 0.0, most, most))
    return Output(ip, iq), rates
