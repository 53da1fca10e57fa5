"""STAB2A: power system stabilizer with power input (ASEA).

-P -> [K2 sT2/(1+sT2)] three times -> [K3/(1+sT3) + K4] -> [K5/(1+sT5)] twice -> limited -Hmax..Hmax -> Vs

P is the electrical power on the machine's base.
Source: PSS/E Model Library, STAB2A.
"""

from typing import Annotated, NamedTuple

from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl.devices.blocks import clip, lag, lag_rate, washout

from .signals import Output

NAME = "STAB2A"
ROLE = "stabilizer"
DYR = {"STAB2A": "K2 T2 K3 T3 K4 K5 T5 Hmax"}
__all__ = ["DYR", "NAME", "ROLE", "Input", "Output", "Par", "State", "derivatives", "output"]


class Par(NamedTuple):
    """Parameters of one stabilizer."""

    K2: Annotated[float, "pu", "gain of each washout"]
    T2: Annotated[float, "s", "washout", Ge(1e-3)]
    K3: Annotated[float, "pu", "gain of the lagged signal"]
    T3: Annotated[float, "s", "lag", NOT_NEGATIVE]
    K4: Annotated[float, "pu", "gain of the direct signal"]
    K5: Annotated[float, "pu", "gain of each output lag"]
    T5: Annotated[float, "s", "output lag", NOT_NEGATIVE]
    Hmax: Annotated[float, "pu", "output limit", NOT_NEGATIVE] = 0.1


class State(NamedTuple):
    """Three washouts, lag, and two output lags."""

    slow1: Annotated[float, "pu", "slow part of the power"]
    slow2: Annotated[float, "pu", "slow part of the first washout"]
    slow3: Annotated[float, "pu", "slow part of the second washout"]
    lagged: Annotated[float, "pu", "lagged signal"]
    out1: Annotated[float, "pu", "first output lag"]
    out2: Annotated[float, "pu", "second output lag"]


class Input(NamedTuple):
    """Signals at a stabilizer."""

    P: Annotated[float, "pu", "electrical power"]


@inline
def stages(x, P, p):
    """Signals after each washout, and at the output lags (pu)."""
    one = p.K2 * washout(p.T2, -P, x.slow1)
    two = p.K2 * washout(p.T2, one, x.slow2)
    three = p.K2 * washout(p.T2, two, x.slow3)
    both = p.K5 * (p.K3 * lag(p.T3, three, x.lagged) + p.K4 * three)
    first = p.K5 * lag(p.T5, both, x.out1)
    return one, two, three, both, first


@inline
def output(x, P, p):
    """Stabilizing signal (pu)."""
    return Output(clip(lag(p.T5, stages(x, P, p)[4], x.out2), -p.Hmax, p.Hmax))


@inline
def derivatives(x, P, p):
    """State derivatives (1/s)."""
    one, two, three, both, first = stages(x, P, p)
    return State(
        lag_rate(p.T2, -P, x.slow1),
        lag_rate(p.T2, one, x.slow2),
        lag_rate(p.T2, two, x.slow3),
        lag_rate(p.T3, three, x.lagged),
        lag_rate(p.T5, both, x.out1),
        lag_rate(p.T5, first, x.out2),
    )
