"""A current source behind a phase-locked loop: I = (ip - j iq) exp(j theta), P + jQ = V conj(I).

theta' = wb (Kp e + x), x' = Ki e, where e is the part of V across the axis of the loop.
"""

from typing import Annotated, NamedTuple

import numpy as np

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, POSITIVE
from stabctl.devices.blocks import magnitude
from stabctl.devices.ports import PORT

NAME = "source behind a loop"
ROLE = "converter"
PLL = "theta"
ANGLES = ("theta",)


class Par(NamedTuple):
    """Constants of one source."""

    mva: Annotated[float, "-", "rating over system MVA", FROM_CASE]
    wb: Annotated[float, "rad/s", "base speed", FROM_CASE]
    Kp: Annotated[float, "pu", "proportional gain", POSITIVE] = 0.05
    Ki: Annotated[float, "1/s", "integral gain", POSITIVE] = 0.5


class State(NamedTuple):
    """The loop."""

    theta: Annotated[float, "rad", "angle of the loop"]
    x: Annotated[float, "pu", "integral of the loop"]


class Input(NamedTuple):
    """Commands."""

    Ipcmd: Annotated[float, "pu", "active current", PORT]
    Iqcmd: Annotated[float, "pu", "reactive current", PORT]


class Output(NamedTuple):
    """Power, voltage and the part of it across the axis."""

    P: Annotated[float, "pu", "active power"]
    Q: Annotated[float, "pu", "reactive power"]
    vt: Annotated[float, "pu", "terminal voltage"]
    e: Annotated[float, "pu", "voltage across the axis"]


@inline
def along(x, re, im):
    """A phasor in the axes of the loop."""
    c, s = np.cos(x.theta), np.sin(x.theta)
    return re * c + im * s, im * c - re * s


@inline
def current(x, u, v, p):
    """Current (pu system)."""
    c, s = np.cos(x.theta), np.sin(x.theta)
    return p.mva * (u.Ipcmd * c + u.Iqcmd * s), p.mva * (u.Ipcmd * s - u.Iqcmd * c)


@inline
def output(x, u, v, p):
    """Power and voltage."""
    d, q = along(x, v[0], v[1])
    return Output(d * u.Ipcmd - q * u.Iqcmd, q * u.Ipcmd + d * u.Iqcmd, magnitude(v[0], v[1]), q)


@inline
def derivatives(x, y, p):
    """Rates (1/s)."""
    return State(p.wb * (p.Kp * y.e + x.x), p.Ki * y.e)


def guess(V, I, p):
    """The loop on the voltage."""
    return State(float(np.angle(V)), 0.0)
