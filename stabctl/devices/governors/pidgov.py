"""PIDGOV: hydro governor with three terms and a nonlinear gate.

Pref - f -> [Rperm/(1+sTreg)] -> (+) e -> [(Kp + Ki/s)/(1+sTa) + sKd/(1+sTa)] -> [1/(1+sTa)] -> (+)
                omega - 1 -----> (-)                                                  gate ---> (-)
-> [1/Tb], held between Velmin and Velmax -> [1/s], Gmin to Gmax -> gate -> [curve] -> [(1-sTz)/(1+sTz/2)] -> (+) -> Pm
                                                                                        Dturb (omega - 1) -> (-)

The feedback f is the electrical power or, with feedback = 1, the gate. The curve leads through (G0, 0), (G1, P1),
(G2, P2) and (1, P3); Tz = Atw Tw.
Source: PSS/E Model Library, PIDGOV; IEEE Task Force, Dynamic Models for Turbine-Governors, PES-TR1 (2013), section 4.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE
from stabctl.devices.blocks import clip, lag, lag_rate, lead_lag, polyline, washout

from .shared import Metered as Input
from .shared import Output, ascending, opening

NAME = "PIDGOV"
ROLE = "governor"
LIMITS = {"gate": ("Gmin", "Gmax")}
DYR = {"PIDGOV": "+feedback Rperm Treg Kp Ki Kd Ta Tb Dturb G0 G1 P1 G2 P2 P3 Gmax Gmin Atw Tw Velmax Velmin"}
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "derivatives", "output"]


class Par(NamedTuple):
    """Parameters of one governor, on the machine's base."""

    feedback: Annotated[int, "-", "0 electrical power, 1 gate", Interval(ge=0, le=1)]
    Rperm: Annotated[float, "pu", "permanent droop", NOT_NEGATIVE]
    Treg: Annotated[float, "s", "droop filter", NOT_NEGATIVE]
    Kp: Annotated[float, "pu", "proportional gain", NOT_NEGATIVE]
    Ki: Annotated[float, "1/s", "integral gain", Ge(1e-6)]
    Kd: Annotated[float, "s", "derivative gain", NOT_NEGATIVE]
    Ta: Annotated[float, "s", "controller", Ge(1e-3)]
    Tb: Annotated[float, "s", "gate servo", Ge(1e-3)]
    Dturb: Annotated[float, "pu", "turbine damping, power over speed deviation", NOT_NEGATIVE]
    G0: Annotated[float, "pu", "gate without load"]
    G1: Annotated[float, "pu", "gate at P1"]
    P1: Annotated[float, "pu", "power at G1"]
    G2: Annotated[float, "pu", "gate at P2"]
    P2: Annotated[float, "pu", "power at G2"]
    P3: Annotated[float, "pu", "power at full gate"]
    Atw: Annotated[float, "pu", "factor of Tw", NOT_NEGATIVE] = 1.0
    Tw: Annotated[float, "s", "water starting time", NOT_NEGATIVE] = 1.0
    Gmax: Annotated[float, "pu", "gate limit"] = 1.0
    Gmin: Annotated[float, "pu", "gate limit"] = 0.0
    Velmax: Annotated[float, "pu/s", "largest opening rate"] = 0.1
    Velmin: Annotated[float, "pu/s", "largest closing rate, negative"] = -0.1
    mva: Annotated[float, "-", "machine MVA over system MVA", FROM_CASE] = 1.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and sentence of everything the equations cannot be formed with."""
        return ascending(self)


class State(NamedTuple):
    """Droop filter, controller, gate and water column."""

    droop: Annotated[float, "pu", "filtered droop signal"]
    integral: Annotated[float, "pu", "integral of the error"]
    proportional: Annotated[float, "pu", "filtered proportional and integral part"]
    derivative: Annotated[float, "pu", "lagged error of the derivative part"]
    desired: Annotated[float, "pu", "desired gate opening"]
    gate: Annotated[float, "pu", "gate opening"]
    water: Annotated[float, "pu", "lagged power of the water column"]


@inline
def head(x, p):
    """Power at the gate (pu)."""
    return polyline(clip(x.gate, p.Gmin, p.Gmax), (p.G0, p.G1, p.G2, 1.0), (0.0, p.P1, p.P2, p.P3))


@inline
def output(x, omega, p):
    """Mechanical power (pu machine)."""
    Tz = p.Atw * p.Tw
    power, _ = lead_lag(-Tz, Tz / 2, head(x, p), x.water)
    return Output(power - p.Dturb * (omega - 1))


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    feedback = clip(x.gate, p.Gmin, p.Gmax) if p.feedback == 1 else u.P
    droop, d_droop = lag(p.Treg, p.Rperm * (u.Pref - feedback), x.droop)
    e = droop - (u.omega - 1)
    fast, d_derivative = washout(p.Ta, e, x.derivative)
    return State(
        droop=d_droop,
        integral=p.Ki * e,
        proportional=lag_rate(p.Ta, p.Kp * e + x.integral, x.proportional),
        derivative=d_derivative,
        desired=lag_rate(p.Ta, x.proportional + p.Kd / p.Ta * fast, x.desired),
        gate=clip((x.desired - x.gate) / p.Tb, p.Velmin, p.Velmax),
        water=lag_rate(p.Atw * p.Tw / 2, head(x, p), x.water),
    )


def guess(V, I, p):
    """Initial guess: the gate at the power at the terminals, on its own piece of the curve."""
    gate = opening((V * np.conj(I)).real, p)
    return State(0.0, gate, gate, 0.0, gate, gate, 1.0)
