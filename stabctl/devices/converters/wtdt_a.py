"""WTDT_A: drive train of a wind turbine, two masses and a shaft, or one mass.

2 Ht dwt/dt = Pm/wt - S
2 Hg dwg/dt = S - P/wg - D (wg - 1)
   dtwist/dt = wt - wg
S = K twist + Dshaft (wt - wg)

Ht = Htfrac H, Hg = H - Ht, K = 2 (2 pi Freq1)^2 Ht Hg/H; twist in seconds. With Htfrac = 0 or Freq1 = 0 there is one
mass: 2 H dwg/dt = Pm/wg - P/wg - D (wg - 1), wt = wg. The mechanical power Pm is that of the start; both masses then
turn at 1 pu. Per unit on the converter base.
Source: WECC Renewable Energy Modeling Task Force, WECC Wind Plant Dynamic Modeling Guidelines (2014), WTGT_A; PSS/E
Model Library, WTDTA1; P. Pourbeik et al., Generic Dynamic Models for Modeling Wind Power Plants and other Renewable
Technologies in Large-Scale Power System Studies, IEEE Trans. Energy Conversion 32(3), 2017.
"""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE

NAME = "WTDT_A"
ROLE = "drive train"
DYR = {"WTDTA1": "H D Htfrac Freq1 Dshaft"}
LOOPS = {"drive train": ("wt", "wg", "twist")}


class Par(NamedTuple):
    """Parameters of one drive train."""

    Pm: Annotated[float, "pu", "mechanical power", FROM_CASE]
    turning: Annotated[float, "-", "whether Pm is known; before, the turbine is held at 1 pu", FROM_CASE]
    H: Annotated[float, "s", "inertia constant of turbine and generator", POSITIVE]
    D: Annotated[float, "pu", "damping", NOT_NEGATIVE] = 0.0
    Htfrac: Annotated[float, "-", "share of the turbine in H", Interval(ge=0, le=0.999)] = 0.9
    Freq1: Annotated[float, "Hz", "torsional frequency", NOT_NEGATIVE] = 1.5
    Dshaft: Annotated[float, "pu", "damping of the shaft", NOT_NEGATIVE] = 1.5


class State(NamedTuple):
    """Speeds and twist."""

    wt: Annotated[float, "pu", "speed of the turbine"]
    wg: Annotated[float, "pu", "speed of the generator"]
    twist: Annotated[float, "s", "twist of the shaft over the base speed"]


class Input(NamedTuple):
    """Signal that the drive train reads."""

    P: Annotated[float, "pu", "electrical power, converter base"]


class Output(NamedTuple):
    """Speed for the electrical control."""

    wg: Annotated[float, "pu", "speed of the generator"]


@inline
def output(x):
    """Speed (pu)."""
    return Output(x.wg)


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    Ht = p.Htfrac * p.H if p.Freq1 > 0 else 0.0
    Hg = p.H - Ht
    w = 2 * np.pi * p.Freq1
    shaft = 2 * w * w * Ht * Hg / p.H * x.twist + p.Dshaft * (x.wt - x.wg)
    generator = -u.P / x.wg - p.D * (x.wg - 1)
    if p.turning < 0.5:
        return State(1 - x.wt, x.wt - x.wg, shaft + generator if Ht > 0 else 0 * x.twist)
    if Ht > 0:
        return State((p.Pm / x.wt - shaft) / (2 * Ht), (shaft + generator) / (2 * Hg), x.wt - x.wg)
    return State(0 * x.wt, (p.Pm / x.wg + generator) / (2 * p.H), 0 * x.twist)


def automatic(p: Par, u: Input) -> Par:
    """Parameters with the mechanical power of the start."""
    return p._replace(Pm=float(u.P), turning=1.0)
