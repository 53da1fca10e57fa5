"""GGOV1: general governor and turbine, for gas turbines and diesel engines.

Pref + load - R y - (omega - 1), outside db, errmin..errmax -> [Kpgov + Kigov/s + sKdgov/(1+sTdgov)] -> fsrn
Ldref/Kturb + Wfnl - exhaust -> [Kpload + Kiload/s] -> fsrt;    fsra rises with Ka (Aset - s omega/(1+sTa))
least of fsrn, fsrt, fsra -> Vmin..Vmax -> fsr -> [1/(1+sTact)], rate Rmin..Rmax -> valve
valve, x omega with fuel = 1 -> q;   q - Wfnl -> [exp(-sTeng)] -> Kturb (1+sTc)/(1+sTb) -> (+) -> Pm
                                                                 Dm (omega - 1), Dm > 0 -> (-)
q, x omega^Dm for Dm < 0 -> [(1+sTsa)/(1+sTsb)] -> [1/(1+sTfload)] -> exhaust
Pref/R - P/(1+sTpelec) -> [Kimw/s], within 1.1 R -> load

y is the measured power (select = 1), nothing (0), fsr of 10 ms ago (-1) or the valve (-2). The integrals of governor
and load limiter follow fsr while another signal is the least, so they do not wind up. The delay is a Pade approximant.
Per unit on Trate, or the machine's base where that is 0. Ropen and Rclose of the source are Rmax and Rmin here.
Not represented: Kimw with another feedback than the power; Kpgov = 0; Kpload = 0 with Kiload > 0.
Source: PSS/E Model Library, GGOV1; OpenIPSL, Electrical.Controls.PSSE.TG.GGOV1; IEEE Task Force, Dynamic Models for
Turbine-Governors, PES-TR1 (2013), section 3.2; NERC, Gas Turbine Governor Modeling (2017).
"""

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import (
    clip,
    deadband,
    delay2,
    derivative,
    integral,
    lag,
    lag_rate,
    lead_lag,
    low_value,
    power,
    rate_limit,
)

from .shared import Metered as Input
from .shared import Output

NAME = "GGOV1"
ROLE = "governor"
LIMITS = {"load": ("loadmin", "loadmax")}
UPPER = ("Ldref", "Aset")
DEADBANDS = ("db",)
AGO = 0.01  # s   delay of fsr in the acceleration limit and the feedback of the requested stroke
DYR = {
    "GGOV1": "+select +fuel R Tpelec errmax errmin Kpgov Kigov Kdgov Tdgov Vmax Vmin Tact Kturb Wfnl Tb Tc Teng Tfload "
    "Kpload Kiload Ldref Dm Rmax Rmin Kimw Aset Ka Ta Trate db Tsa Tsb _Rup _Rdown"
}
__all__ = ["Input", "Output"]


class Par(NamedTuple):
    """Parameters of one governor, on the turbine's rating."""

    R: Annotated[float, "pu", "permanent droop", NOT_NEGATIVE] = 0.04
    Tpelec: Annotated[float, "s", "power transducer", NOT_NEGATIVE] = 1.0
    errmax: Annotated[float, "pu", "largest error"] = 0.05
    errmin: Annotated[float, "pu", "smallest error"] = -0.05
    Kpgov: Annotated[float, "pu", "proportional gain", POSITIVE] = 10.0
    Kigov: Annotated[float, "1/s", "integral gain", NOT_NEGATIVE] = 2.0
    Kdgov: Annotated[float, "s", "derivative gain", NOT_NEGATIVE] = 0.0
    Tdgov: Annotated[float, "s", "derivative lag", NOT_NEGATIVE] = 1.0
    Vmax: Annotated[float, "pu", "largest valve position"] = 1.0
    Vmin: Annotated[float, "pu", "smallest valve position"] = 0.15
    Tact: Annotated[float, "s", "actuator", Ge(1e-3)] = 0.5
    Kturb: Annotated[float, "pu", "turbine gain", POSITIVE] = 1.5
    Wfnl: Annotated[float, "pu", "fuel flow without load"] = 0.2
    Tb: Annotated[float, "s", "turbine lag", NOT_NEGATIVE] = 0.1
    Tc: Annotated[float, "s", "turbine lead", NOT_NEGATIVE] = 0.0
    Teng: Annotated[float, "s", "delay of a diesel engine", NOT_NEGATIVE] = 0.0
    Tfload: Annotated[float, "s", "exhaust temperature lag", NOT_NEGATIVE] = 3.0
    Kpload: Annotated[float, "pu", "proportional gain of the load limiter (0: none)", NOT_NEGATIVE] = 2.0
    Kiload: Annotated[float, "1/s", "integral gain of the load limiter", NOT_NEGATIVE] = 0.67
    Ldref: Annotated[float, "pu", "load limit"] = 1.0
    Dm: Annotated[float, "pu", "damping; below 0 the exponent of the speed in the exhaust"] = 0.0
    Rmax: Annotated[float, "pu/s", "largest opening rate, Ropen"] = 0.1
    Rmin: Annotated[float, "pu/s", "largest closing rate, Rclose, negative"] = -0.1
    Kimw: Annotated[float, "1/s", "integral gain of the load controller (0: none)", NOT_NEGATIVE] = 0.0
    Aset: Annotated[float, "pu/s", "acceleration limit"] = 99.0
    Ka: Annotated[float, "pu", "gain of the acceleration limiter (0: none)", NOT_NEGATIVE] = 10.0
    Ta: Annotated[float, "s", "acceleration filter", NOT_NEGATIVE] = 0.1
    Trate: Annotated[float, "MW", "rating of the turbine (0: the machine's base)", NOT_NEGATIVE] = 0.0
    db: Annotated[float, "pu", "deadband on either side", NOT_NEGATIVE] = 0.0
    Tsa: Annotated[float, "s", "lead of the temperature detection", NOT_NEGATIVE] = 4.0
    Tsb: Annotated[float, "s", "lag of the temperature detection", NOT_NEGATIVE] = 5.0
    select: Annotated[int, "-", "droop feedback (1 power, 0 none, -1 fsr, -2 valve)", Interval(ge=-2, le=1)] = 1
    fuel: Annotated[int, "-", "fuel flow (1: proportional to speed, 0: not)", Interval(ge=0, le=1)] = 0
    base: Annotated[float, "MVA", "machine base", FROM_CASE] = 100.0
    loadmax: Annotated[float, "pu", "largest output of the load controller, 1.1 R", FROM_CASE] = 0.0
    loadmin: Annotated[float, "pu", "smallest output of the load controller", FROM_CASE] = 0.0


class State(NamedTuple):
    """Measured power, controllers, actuator, turbine and exhaust."""

    pe: Annotated[float, "pu", "measured power"]
    lagged: Annotated[float, "pu", "lagged error of the derivative part"]
    gov: Annotated[float, "pu", "integral of the governor"]
    valve: Annotated[float, "pu", "valve position"]
    delayed: Annotated[float, "pu", "power in the delay"]
    ddelayed: Annotated[float, "pu/s", "its rate"]
    turbine: Annotated[float, "pu", "lagged power of the turbine"]
    detected: Annotated[float, "pu", "lagged exhaust of the detection"]
    exhaust: Annotated[float, "pu", "measured exhaust"]
    limiter: Annotated[float, "pu", "integral of the load limiter"]
    load: Annotated[float, "pu", "output of the load controller"]
    swing: Annotated[float, "pu", "lagged speed of the acceleration filter"]
    ago: Annotated[float, "pu", "fsr a moment ago"]


def from_record(_kind: str, values: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of a record; some combinations of gains and feedbacks are not modeled."""
    if values["Kpgov"] <= 0:
        raise ValueError(f"Kpgov = {values['Kpgov']:g} is not modeled")
    if values["Kimw"] and values["select"] != 1:
        raise ValueError(f"Kimw = {values['Kimw']:g} with Rselect = {values['select']} is not modeled")
    if values["Kiload"] and not values["Kpload"]:
        raise ValueError(f"Kpload = 0 with Kiload = {values['Kiload']:g} is not modeled")
    return values, []


def prepare(p: Par) -> Par:
    """Parameters with the limits of the load controller and the rating of the turbine."""
    return p._replace(loadmax=1.1 * p.R, loadmin=-1.1 * p.R, Trate=p.Trate if p.Trate > 0 else p.base)


@inline
def governor(x, u, p):
    """Derivative part and request fsrn of the governor (pu), and the derivatives (1/s) of pe, of lagged and of load."""
    pe, d_pe = lag(p.Tpelec, u.P * p.base / p.Trate, x.pe)
    y = pe if p.select == 1 else x.ago if p.select == -1 else x.valve if p.select == -2 else 0 * x.valve
    e = clip(deadband(u.Pref + integral(p.Kimw, x.load) - p.R * y - (u.omega - 1), -p.db, p.db), p.errmin, p.errmax)
    part, d_lagged = derivative(p.Kdgov, p.Tdgov, e, x.lagged)
    d_load = p.Kimw * (u.Pref / p.R - pe) if p.Kimw > 0 else 0 * x.load
    return part, p.Kpgov * e + part + integral(p.Kigov, x.gov), d_pe, d_lagged, d_load


@inline
def flow(x, omega, p):
    """Fuel flow (pu)."""
    return x.valve * omega if p.fuel == 1 else x.valve


@inline
def output(x, omega, p):
    """Mechanical power (pu machine)."""
    generated, _, _ = delay2(p.Teng, p.Kturb * (flow(x, omega, p) - p.Wfnl), x.delayed, x.ddelayed)
    turbine, _ = lead_lag(p.Tc, p.Tb, generated, x.turbine)
    damping = p.Dm * (omega - 1) if p.Dm > 0 else 0 * omega
    return Output((turbine - damping) * p.Trate / p.base)


@inline
def derivatives(x, u, p):
    """State derivatives (1/s); fsr is the least request within the valve limits."""
    part, fsr, d_pe, d_lagged, d_load = governor(x, u, p)
    if p.Kpload > 0:
        fsr = low_value(fsr, p.Kpload * (p.Ldref / p.Kturb + p.Wfnl - x.exhaust) + x.limiter)
    acceleration, d_swing = derivative(1.0, p.Ta, u.omega, x.swing)
    if p.Ka > 0:
        fsr = low_value(fsr, x.ago + AGO * p.Ka * (p.Aset - acceleration))
    fsr = clip(fsr, p.Vmin, p.Vmax)

    q = flow(x, u.omega, p)
    after, d_delayed, d_ddelayed = delay2(p.Teng, p.Kturb * (q - p.Wfnl), x.delayed, x.ddelayed)
    hot, d_detected = lead_lag(p.Tsa, p.Tsb, q * power(u.omega, p.Dm) if p.Dm < 0 else q, x.detected)
    return State(
        pe=d_pe,
        lagged=d_lagged,
        gov=p.Kigov / p.Kpgov * (fsr - part - x.gov),
        valve=rate_limit((fsr - x.valve) / p.Tact, p.Rmin, p.Rmax),
        delayed=d_delayed,
        ddelayed=d_ddelayed,
        turbine=lag_rate(p.Tb, after, x.turbine),
        detected=d_detected,
        exhaust=lag_rate(p.Tfload, hot, x.exhaust),
        limiter=p.Kiload / p.Kpload * (fsr - x.limiter) if p.Kpload > 0 else 0 * x.limiter,
        load=d_load,
        swing=d_swing,
        ago=(fsr - x.ago) / AGO,
    )


def guess(V: complex, I: complex, p: Par) -> State:
    """States at the power at the terminals, the limiters out of action."""
    generated = float((V * np.conj(I)).real) * p.base / p.Trate
    valve = generated / p.Kturb + p.Wfnl
    one, two = (generated, 0.0), (valve, valve)
    return State(generated, 0.0, valve, valve, *one, generated, *two, valve, 0.0, 1.0, valve)
