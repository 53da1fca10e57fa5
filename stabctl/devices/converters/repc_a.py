"""REPC_A: plant controller of a converter, its reactive and active power references.

RefFlag = 1: Vset - V', RefFlag = 0: Qset - Q, both filtered with Tfltr -> outside dbd1..dbd2 -> emin..emax
    -> [Kp + Ki/s], Qmin..Qmax -> [(1+sTft)/(1+sTfv)] -> Qext
FFlag = 1: Pset - P/(1+sTp) + droop(fset - f) -> femin..femax -> [Kpg + Kig/s], Pmin..Pmax -> [1/(1+sTg)] -> Pref
FFlag = 0: Pset -> Pref

V' = V + Kc Q, or |V - (Rc + j Xc) I| with VcFlag = 1, V the voltage of the regulated bus. droop(e) is Ddn e for e < 0
(frequency too high), Dup e for e > 0, and zero within fdbd1..fdbd2. Below Vfrz the integral Ki stays as it is. P, Q and
I are those of the converter; the flow on a monitored branch differs by the losses up to there.
Source: WECC Renewable Energy Modeling Task Force, WECC Solar Plant Dynamic Modeling Guidelines (2014), REPC_A; PSS/E
Model Library, REPCA1; NREL-Sienna/PowerSimulationsDynamics.jl, renewable controllers type AB.
"""

from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl.devices.blocks import (
    clip,
    deadband,
    lag,
    lead_lag,
    pi,
    regulated,
    two_slopes,
    while_within,
)
from stabctl.devices.ports import PORT, At, fixed

from .electrical import FLAG, behind

NAME = "REPC_A"
ROLE = "plant control"
DEADBANDS = ("dbd1", "dbd2", "fdbd1", "fdbd2")
DYR = {
    "REPCA1": "+bus +branch_from +branch_to 'circuit +VcFlag +RefFlag +FFlag Tfltr Kp Ki Tft Tfv Vfrz Rc Xc Kc emax "
    "emin dbd1 dbd2 Qmax Qmin Kpg Kig Tp fdbd1 fdbd2 femax femin Pmax Pmin Tg Ddn Dup"
}


class Par(NamedTuple):
    """Parameters of one plant controller, on the converter base."""

    bus: Annotated[int, "-", "regulated bus (0: that of the converter)", NOT_NEGATIVE] = 0
    VcFlag: Annotated[float, "-", "voltage (1: behind Rc + j Xc, 0: with droop Kc)", FLAG] = 0
    RefFlag: Annotated[float, "-", "what is held (1: voltage, 0: reactive power)", FLAG] = 0
    FFlag: Annotated[float, "-", "power control (1: on, 0: off)", FLAG] = 0
    Tfltr: Annotated[float, "s", "filter of voltage or reactive power", NOT_NEGATIVE] = 0.02
    Kp: Annotated[float, "pu", "proportional gain of reactive power", NOT_NEGATIVE] = 18.0
    Ki: Annotated[float, "1/s", "integral gain of reactive power", NOT_NEGATIVE] = 5.0
    Tft: Annotated[float, "s", "lead time constant", NOT_NEGATIVE] = 0.0
    Tfv: Annotated[float, "s", "lag time constant", NOT_NEGATIVE] = 0.05
    Vfrz: Annotated[float, "pu", "voltage below which the integral rests"] = 0.0
    Rc: Annotated[float, "pu", "compensation resistance"] = 0.0
    Xc: Annotated[float, "pu", "compensation reactance"] = 0.0
    Kc: Annotated[float, "pu", "reactive droop"] = 0.0
    emax: Annotated[float, "pu", "largest error"] = 0.1
    emin: Annotated[float, "pu", "smallest error"] = -0.1
    dbd1: Annotated[float, "pu", "lower edge of the deadband"] = 0.0
    dbd2: Annotated[float, "pu", "upper edge of the deadband"] = 0.0
    Qmax: Annotated[float, "pu", "largest reactive reference"] = 0.43
    Qmin: Annotated[float, "pu", "smallest reactive reference"] = -0.43
    Kpg: Annotated[float, "pu", "proportional gain of active power", NOT_NEGATIVE] = 0.1
    Kig: Annotated[float, "1/s", "integral gain of active power", NOT_NEGATIVE] = 0.05
    Tp: Annotated[float, "s", "power filter", NOT_NEGATIVE] = 0.25
    fdbd1: Annotated[float, "pu", "lower edge of the frequency deadband"] = 0.0
    fdbd2: Annotated[float, "pu", "upper edge of the frequency deadband"] = 0.0
    femax: Annotated[float, "pu", "largest power error"] = 99.0
    femin: Annotated[float, "pu", "smallest power error"] = -99.0
    Pmax: Annotated[float, "pu", "largest power reference"] = 1.0
    Pmin: Annotated[float, "pu", "smallest power reference"] = 0.0
    Tg: Annotated[float, "s", "lag of the power reference", NOT_NEGATIVE] = 0.1
    Ddn: Annotated[float, "pu", "power over frequency excess", NOT_NEGATIVE] = 20.0
    Dup: Annotated[float, "pu", "power over frequency deficit", NOT_NEGATIVE] = 0.0


class State(NamedTuple):
    """Filters, integrals and lags."""

    meas: Annotated[float, "pu", "filtered voltage or reactive power"]
    xq: Annotated[float, "pu", "integral of the reactive regulator"]
    xf: Annotated[float, "pu", "lagged output of the reactive regulator"]
    pf: Annotated[float, "pu", "filtered power"]
    xp: Annotated[float, "pu", "integral of the active regulator"]
    pg: Annotated[float, "pu", "lagged power reference"]


class Input(NamedTuple):
    """Signals that the plant controller reads, on the converter base."""

    Vset: Annotated[float, "pu", "voltage set-point", PORT]
    Qset: Annotated[float, "pu", "reactive power set-point", PORT]
    Pset: Annotated[float, "pu", "active power set-point", PORT]
    fset: Annotated[float, "pu", "frequency set-point", fixed(1.0)]
    V: Annotated[float, "pu", "voltage of the regulated bus", At("bus_voltage", "bus")]
    f: Annotated[float, "pu", "frequency of the regulated bus", At("bus_frequency", "bus")]
    P: Annotated[float, "pu", "active power"]
    Q: Annotated[float, "pu", "reactive power"]


class Output(NamedTuple):
    """References of the electrical control."""

    Pref: Annotated[float, "pu", "power reference"]
    Qext: Annotated[float, "pu", "reactive power or voltage reference"]


def loops(p: Par) -> dict[str, tuple[str, ...]]:
    """States of every control loop, which is named by what it holds."""
    held = "voltage control" if p.RefFlag > 0.5 else "reactive power control"
    return {held: ("meas", "xq", "xf"), "power control": ("pf", "xp", "pg")}


def from_record(_kind: str, values: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of a record; instead of a monitored branch it takes the converter's own power."""
    branch = values.pop("branch_from"), values.pop("branch_to"), values.pop("circuit")
    if not branch[0]:
        return values, []
    return values, [f"measures its own power instead of that of branch {branch[0]}-{branch[1]} ckt {branch[2]}."]


@inline
def measured(u, p):
    """Voltage with compensation, or reactive power (pu)."""
    if p.RefFlag < 0.5:
        return u.Q
    if p.VcFlag < 0.5:
        return u.V + p.Kc * u.Q
    return behind(u.V, u.P, u.Q, p)


@inline
def equations(x, u, p):
    """References (pu), and state derivatives (1/s); the active regulator rests where it is off."""
    meas, d_meas = lag(p.Tfltr, measured(u, p), x.meas)
    error = clip(deadband((u.Vset if p.RefFlag > 0.5 else u.Qset) - meas, p.dbd1, p.dbd2), p.emin, p.emax)
    q, d_xq = pi(p.Kp, p.Ki, error, regulated(p.Kp, p.Ki, x.xq), p.Qmin, p.Qmax)
    Qext, d_xf = lead_lag(p.Tft, p.Tfv, q, x.xf)

    on = 1.0 if p.FFlag > 0.5 else 0.0
    pf, d_pf = lag(p.Tp, u.P, x.pf)
    droop = two_slopes(deadband(u.fset - u.f, p.fdbd1, p.fdbd2), p.Ddn, p.Dup)
    error = clip(u.Pset - pf + droop, p.femin, p.femax)
    power, d_xp = pi(p.Kpg, p.Kig, error, regulated(p.Kpg, p.Kig, x.xp), p.Pmin, p.Pmax)
    pg, d_pg = lag(p.Tg, power, x.pg)

    d_xq = while_within(d_xq, u.V, p.Vfrz, 0.0)
    return Output(Pref=pg if p.FFlag > 0.5 else u.Pset, Qext=Qext), State(
        meas=d_meas, xq=d_xq, xf=d_xf, pf=d_pf, xp=on * d_xp, pg=on * d_pg
    )


def guess(V: complex, I: complex, p: Par) -> State:
    """States of the power flow, or between the limits, where those of a reference that nothing reads remain."""
    S = V * I.conjugate()
    Q = S.imag if p.Qmin <= S.imag <= p.Qmax else (p.Qmin + p.Qmax) / 2
    P = S.real if p.Pmin <= S.real <= p.Pmax else (p.Pmin + p.Pmax) / 2
    return State(S.imag, Q, Q, S.real, P, P)
