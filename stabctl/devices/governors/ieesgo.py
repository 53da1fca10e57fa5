"""IEESGO: IEEE standard governor of a steam or hydro turbine.

omega - 1 -> [K1 (1+sT2)/((1+sT1)(1+sT3))] -> (-)
Pref ---------------------------------------> (+), held between Pmin and Pmax -> [1/(1+sT4)] -> a
a -> [1/(1+sT5)] -> b -> [1/(1+sT6)] -> c,    Pm = (1 - K2) a + K2 (1 - K3) b + K2 K3 c

Source: PSS/E Model Library, IEESGO; IEEE Committee Report, IEEE Trans. PAS-92 (1973).
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl.devices.blocks import clip, lag, lead_lag

from .shared import Input, Output

NAME = "IEESGO"
ROLE = "governor"
DYR = {"IEESGO": "T1 T2 T3 T4 T5 T6 K1 K2 K3 Pmax Pmin"}
__all__ = ["DYR", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations"]


class Par(NamedTuple):
    """Parameters of one governor, on the machine's base."""

    T1: Annotated[float, "s", "controller lag", NOT_NEGATIVE]
    T2: Annotated[float, "s", "controller lead", NOT_NEGATIVE]
    T3: Annotated[float, "s", "governor lag", NOT_NEGATIVE]
    T4: Annotated[float, "s", "inlet piping and steam bowl, or gate", NOT_NEGATIVE]
    T5: Annotated[float, "s", "reheater, or half of the water starting time", NOT_NEGATIVE]
    T6: Annotated[float, "s", "crossover", NOT_NEGATIVE]
    K1: Annotated[float, "pu", "inverse droop 1/R (0: no speed control)", NOT_NEGATIVE]
    K2: Annotated[float, "pu", "share behind the reheater"] = 0.0
    K3: Annotated[float, "pu", "part of K2 behind the crossover"] = 0.0
    Pmax: Annotated[float, "pu", "demand limit"] = 1.0
    Pmin: Annotated[float, "pu", "demand limit"] = 0.0


class State(NamedTuple):
    """Controller, governor and stages."""

    controller: Annotated[float, "pu", "lagged speed signal"]
    governor: Annotated[float, "pu", "twice lagged speed signal"]
    one: Annotated[float, "pu", "output of the first stage"]
    two: Annotated[float, "pu", "output of the reheater"]
    three: Annotated[float, "pu", "output of the crossover"]


@inline
def equations(x, u, p):
    """Mechanical power (pu machine), and state derivatives (1/s)."""
    signal, d_controller = lead_lag(p.T2, p.T1, p.K1 * (u.omega - 1), x.controller)
    signal, d_governor = lag(p.T3, signal, x.governor)
    one, d_one = lag(p.T4, clip(u.Pref - signal, p.Pmin, p.Pmax), x.one)
    two, d_two = lag(p.T5, one, x.two)
    three, d_three = lag(p.T6, two, x.three)
    power = (1 - p.K2) * one + p.K2 * (1 - p.K3) * two + p.K2 * p.K3 * three
    return Output(power), State(controller=d_controller, governor=d_governor, one=d_one, two=d_two, three=d_three)
