"""Controlled shunt: a susceptance that follows the bus voltage.

Vref - |V| -> [K/(1+sT)] -> b, current -j b V out of the bus.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import magnitude
from stabctl.devices.ports import PORT

NAME = "susceptance"
ROLE = "shunt"


class Par(NamedTuple):
    """Constants."""

    K: Annotated[float, "pu", "gain"]
    T: Annotated[float, "s", "time constant"]
    offset: Annotated[float, "pu", "susceptance that is always there"] = 0.0


class State(NamedTuple):
    """Its state."""

    b: Annotated[float, "pu", "susceptance"]


class Input(NamedTuple):
    """What it reads."""

    Vref: Annotated[float, "pu", "voltage reference", PORT]


class Output(NamedTuple):
    """What it gives."""

    Q: Annotated[float, "pu", "reactive power"]


@inline
def current(x, v, p):
    """Current into the network (pu)."""
    b = x.b + p.offset
    return b * v[1], -b * v[0]


@inline
def output(x, v, p):
    """Reactive power."""
    return Output((x.b + p.offset) * (v[0] * v[0] + v[1] * v[1]))


@inline
def derivatives(x, u, v, p):
    """Rate."""
    return State((p.K * (u.Vref - magnitude(v[0], v[1])) - x.b) / p.T)
