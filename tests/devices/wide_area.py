"""A stabilizer on signals from elsewhere: voltage and frequency of a bus, and the speed of another machine.

Vs = Kv (V - slow) + Kf (f - 1) + Kw (own speed - far speed), slow' = (V - slow) / T
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl.devices.blocks import clip, lag_rate
from stabctl.devices.ports import At

NAME = "wide-area stabilizer"
ROLE = "stabilizer"


class Par(NamedTuple):
    """Constants of one stabilizer."""

    bus: Annotated[int, "-", "bus whose voltage and frequency it reads (0: its own)", NOT_NEGATIVE]
    other: Annotated[int, "-", "machine whose speed it reads (0: its own)", NOT_NEGATIVE]
    Kv: Annotated[float, "pu", "gain on the voltage"] = 0.0
    Kf: Annotated[float, "pu", "gain on the frequency"] = 0.0
    Kw: Annotated[float, "pu", "gain on the difference of speeds"] = 0.0
    T: Annotated[float, "s", "washout of the voltage"] = 1.0
    Vmax: Annotated[float, "pu", "output limit"] = 0.2
    Vmin: Annotated[float, "pu", "output limit"] = -0.2


class State(NamedTuple):
    """State of one stabilizer."""

    slow: Annotated[float, "pu", "slow part of the voltage"]


class Input(NamedTuple):
    """Signals at a stabilizer."""

    omega: Annotated[float, "pu", "own speed"]
    V: Annotated[float, "pu", "voltage of the bus", At("bus_voltage", "bus")]
    f: Annotated[float, "pu", "frequency of the bus", At("bus_frequency", "bus")]
    far: Annotated[float, "pu", "speed of the machine", At("omega", "other")]


class Output(NamedTuple):
    """Signal of a stabilizer."""

    Vs: Annotated[float, "pu", "stabilizing signal"]


@inline
def output(x, u, p):
    """Stabilizing signal (pu)."""
    return Output(clip(p.Kv * (u.V - x.slow) + p.Kf * (u.f - 1) + p.Kw * (u.omega - u.far), p.Vmin, p.Vmax))


@inline
def derivatives(x, u, p):
    """State rate (1/s)."""
    return State(lag_rate(p.T, u.V, x.slow))
