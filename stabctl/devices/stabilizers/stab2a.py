"""STAB2A: power system stabilizer with power input (ASEA).

-P -> [K2 sT2/(1+sT2)] three times -> [K3/(1+sT3) + K4] -> [K5/(1+sT5)] twice -> limited -Hmax..Hmax -> Vs

P is the electrical power on the machine's base.
Source: PSS/E Model Library, STAB2A.
"""

from typing import Annotated, NamedTuple

from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl.devices.blocks import clip, lag, washout

from .signals import Output

NAME = "STAB2A"
ROLE = "stabilizer"
DYR = {"STAB2A": "K2 T2 K3 T3 K4 K5 T5 Hmax"}
__all__ = ["DYR", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations"]


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
def equations(x, P, p):
    """Stabilizing signal (pu), and state derivatives (1/s)."""
    one, d_slow1 = washout(p.T2, -P, x.slow1)
    two, d_slow2 = washout(p.T2, p.K2 * one, x.slow2)
    three, d_slow3 = washout(p.T2, p.K2 * two, x.slow3)
    three = p.K2 * three
    lagged, d_lagged = lag(p.T3, three, x.lagged)
    first, d_out1 = lag(p.T5, p.K5 * (p.K3 * lagged + p.K4 * three), x.out1)
    second, d_out2 = lag(p.T5, p.K5 * first, x.out2)
    rates = State(slow1=d_slow1, slow2=d_slow2, slow3=d_slow3, lagged=d_lagged, out1=d_out1, out2=d_out2)
    return Output(clip(second, -p.Hmax, p.Hmax)), rates
