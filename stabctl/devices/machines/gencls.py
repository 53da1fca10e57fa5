"""GENCLS: classical machine, a constant voltage E' behind ra + j x'd.

Pm -> (+) -> [1/(2Hs)] -> omega - 1 -> [wb/s] -> delta
      (-) Pe + D (omega - 1)

Pe is the power of the source. The source voltage does not depend on the speed, so that a lossless system conserves its
energy function. With H = 0 it is an infinite bus: a source of constant voltage, angle and frequency. Per unit on the
machine's own MVA; `mva` converts currents to the system base.
Source: Kundur, Power System Stability and Control, section 12.3.1; the paper, eq. (1)-(4).
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import circuit_rate, magnitude

from .stator import Input, Output

NAME = "GENCLS"
ROLE = "machine"
CONTROLS = ("governor",)  # E' is constant
CLOSED = ("H",)
SHORTEST = 0.01  # s
DYR = {"GENCLS": "H D"}
__all__ = [
    "CLOSED", "CONTROLS", "DYR", "NAME", "ROLE", "Input", "Output", "Par", "State", "derivatives", "internal", "output",
    "source",
]  # fmt: skip


class Par(NamedTuple):
    """Parameters of one machine."""

    mva: Annotated[float, "-", "machine MVA over system MVA", FROM_CASE]
    wb: Annotated[float, "rad/s", "base speed, 2 pi f", FROM_CASE]
    H: Annotated[float, "s", "inertia constant (0: infinite)", NOT_NEGATIVE]
    D: Annotated[float, "pu", "damping power over speed deviation"]
    ra: Annotated[float, "pu", "armature resistance", NOT_NEGATIVE]
    x1d: Annotated[float, "pu", "transient reactance", POSITIVE]

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and sentence of everything the equations cannot be formed with."""
        if 0 < self.H < SHORTEST:
            yield "H", f"must be at least {SHORTEST:g} s, or 0 for an infinite bus"


class State(NamedTuple):
    """Rotor angle and speed."""

    delta: Annotated[float, "rad", "rotor angle relative to the synchronous frame"]
    omega: Annotated[float, "pu", "speed"]


class Internal(NamedTuple):
    """Rotor position, used by source and stator."""

    sin: Annotated[float, "-", "sine of the rotor angle"]
    cos: Annotated[float, "-", "cosine of the rotor angle"]


@inline
def internal(x, p):
    """Rotor position."""
    return Internal(np.sin(x.delta), np.cos(x.delta))


@inline
def source(i, Efd, p):
    """Short-circuit current of the source (pu system), real and imaginary part."""
    er, ei = Efd * i.cos, Efd * i.sin
    k = p.mva / (p.ra * p.ra + p.x1d * p.x1d)
    return k * (p.ra * er + p.x1d * ei), k * (p.ra * ei - p.x1d * er)


@inline
def output(i, Efd, v, p):
    """Stator: (ra + j x'd)(iq - j id) = E' - V exp(-j delta); Te is the power of the source."""
    vr, vi = i.cos * v[0] + i.sin * v[1], i.cos * v[1] - i.sin * v[0]
    er, ei = Efd - vr, -vi
    k = 1 / (p.ra * p.ra + p.x1d * p.x1d)
    iq, id_ = k * (p.ra * er + p.x1d * ei), k * (p.x1d * er - p.ra * ei)
    vt = magnitude(vr, vi)
    return Output(id_, iq, Efd * iq, vr * iq - vi * id_, vr * id_ + vi * iq, vt, vt, Efd, 0 * Efd)


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is this machine's own output."""
    slip = x.omega - 1
    return State(p.wb * slip, circuit_rate(2 * p.H, u.Pm - y.Te - p.D * slip, x.omega))


@inline
def admittance(p):
    """Norton admittance 1/(ra + j x'd) (pu system), real and imaginary part."""
    k = p.mva / (p.ra * p.ra + p.x1d * p.x1d)
    return k * p.ra, -k * p.x1d


def guess(V, I, p):
    """Initial guess: the rotor at the angle of V + (ra + j x'd) I, at synchronous speed."""
    return State(float(np.angle(V + complex(p.ra, p.x1d) * I)), 1.0)
