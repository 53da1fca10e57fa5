"""WPIDHY: Woodward hydro governor with three terms, droop of the electrical power and a nonlinear gate.

P - Pref -> [Reg/(1+sTreg)] -> (+) e -> [(Kp + Ki/s + sKd)/(1+sTa)^2] -> [1/(1+sTb)], Velmin to Velmax -> a
              omega - 1 -----> (-)
a -> [1/s], Gatmin to Gatmax -> gate -> [curve] -> [(1-sTw)/(1+sTw/2)], held between Pmin and Pmax -> (+) -> Pm
                                                                                D (omega - 1) -->  (-)

Reg is the droop with a negative sign. The curve leads through (G0, 0), (G1, P1), (G2, P2) and (1, P3).
Source: PSS/E Model Library, WPIDHY.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Lt

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE
from stabctl.devices.blocks import clip, lag, lag_rate, lead_lag, polyline, washout

from .shared import Metered as Input
from .shared import Output, ascending, opening

NAME = "WPIDHY"
ROLE = "governor"
LIMITS = {"gate": ("Gatmin", "Gatmax")}
DYR = {"WPIDHY": "Treg Reg Kp Ki Kd Ta Tb Velmax Velmin Gatmax Gatmin Tw Pmax Pmin D G0 G1 P1 G2 P2 P3"}
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "derivatives", "output"]


class Par(NamedTuple):
    """Parameters of one governor, on the machine's base."""

    Treg: Annotated[float, "s", "droop filter", NOT_NEGATIVE]
    Reg: Annotated[float, "pu", "permanent droop, negative", Lt(0)]
    Kp: Annotated[float, "1/s", "proportional gain", NOT_NEGATIVE]
    Ki: Annotated[float, "1/s^2", "integral gain", Ge(1e-6)]
    Kd: Annotated[float, "pu", "derivative gain", NOT_NEGATIVE]
    Ta: Annotated[float, "s", "controller", Ge(1e-3)]
    Tb: Annotated[float, "s", "gate servo", NOT_NEGATIVE]
    Tw: Annotated[float, "s", "water starting time", NOT_NEGATIVE]
    D: Annotated[float, "pu", "turbine damping, power over speed deviation"]
    G0: Annotated[float, "pu", "gate without load"]
    G1: Annotated[float, "pu", "gate at P1"]
    P1: Annotated[float, "pu", "power at G1"]
    G2: Annotated[float, "pu", "gate at P2"]
    P2: Annotated[float, "pu", "power at G2"]
    P3: Annotated[float, "pu", "power at full gate"]
    Velmax: Annotated[float, "pu/s", "largest opening rate"] = 0.1
    Velmin: Annotated[float, "pu/s", "largest closing rate, negative"] = -0.1
    Gatmax: Annotated[float, "pu", "gate limit"] = 1.0
    Gatmin: Annotated[float, "pu", "gate limit"] = 0.0
    Pmax: Annotated[float, "pu", "power limit"] = 1.0
    Pmin: Annotated[float, "pu", "power limit"] = 0.0
    mva: Annotated[float, "-", "machine MVA over system MVA", FROM_CASE] = 1.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and sentence of everything the equations cannot be formed with."""
        return ascending(self)


class State(NamedTuple):
    """Droop filter, controller, gate and water column."""

    droop: Annotated[float, "pu", "filtered droop signal"]
    integral: Annotated[float, "pu/s", "integral of the error"]
    derivative: Annotated[float, "pu", "lagged error of the derivative part"]
    one: Annotated[float, "pu/s", "output of the controller"]
    two: Annotated[float, "pu/s", "output of the servo, rate of the gate"]
    gate: Annotated[float, "pu", "gate opening"]
    water: Annotated[float, "pu", "lagged power of the water column"]


@inline
def head(x, p):
    """Power at the gate (pu)."""
    return polyline(clip(x.gate, p.Gatmin, p.Gatmax), (p.G0, p.G1, p.G2, 1.0), (0.0, p.P1, p.P2, p.P3))


@inline
def output(x, omega, p):
    """Mechanical power (pu machine)."""
    power, _ = lead_lag(-p.Tw, p.Tw / 2, head(x, p), x.water)
    return Output(clip(power, p.Pmin, p.Pmax) - p.D * (omega - 1))


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    droop, d_droop = lag(p.Treg, p.Reg * (u.P - u.Pref), x.droop)
    e = droop - (u.omega - 1)
    Kp, Kd = p.Kp - p.Ta * p.Ki, p.Kd - p.Ta * (p.Kp - p.Ta * p.Ki)
    fast, d_derivative = washout(p.Ta, e, x.derivative)
    d_one = lag_rate(p.Ta, Kp * e + x.integral + Kd / p.Ta * fast, x.one)
    two, d_two = lag(p.Tb, x.one, x.two)
    d_gate, d_water = clip(two, p.Velmin, p.Velmax), lag_rate(p.Tw / 2, head(x, p), x.water)
    return State(
        droop=d_droop, integral=p.Ki * e, derivative=d_derivative, one=d_one, two=d_two, gate=d_gate, water=d_water
    )


def guess(V, I, p):
    """Initial guess: the gate at the power at the terminals, on its own piece of the curve."""
    gate = opening((V * np.conj(I)).real, p)
    return State(0.0, 0.0, 0.0, 0.0, 0.0, gate, 1.0)
