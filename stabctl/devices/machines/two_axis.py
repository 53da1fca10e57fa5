"""Two-axis machine: a field winding and one damper winding on the q axis, x'q different from x'd, no subtransients.

Efd -> (+) -> [1/(1+sT'd0)] -> E'q      (xq - x'q) iq -> [1/(1+sT'q0)] -> E'd
       (-) (xd - x'd) id
E'q = vq + ra iq + x'd id,    E'd = vd + ra id - x'q iq
Pm -> (+) -> [1/(2Hs)] -> omega - 1 -> [wb/s] -> delta
      (-) E'd id + E'q iq + (x'q - x'd) id iq + D (omega - 1)

The source of the network equations is E' = E'q - j E'd behind ra + j x', 1/x' the mean of 1/x'd and 1/x'q; what the
saliency adds depends on the voltage and is a current. Pm is a torque: as in the textbook, it is not divided by the
speed. Unsaturated. Per unit on the machine's own MVA; `mva` converts currents to the system base.
Source: Sauer, Pai, Power System Dynamics and Stability, sections 5.4 and 7.6.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import circuit_rate, magnitude

from . import stator
from .stator import Input, Internal, Output

NAME = "two-axis machine"
ROLE = "machine"
CLOSED = ("T1q",)
__all__ = [
    "CLOSED", "NAME", "ROLE", "Input", "Internal", "Output", "Par", "State", "admittance", "current", "derivatives",
    "fault_admittance", "internal", "output", "source",
]  # fmt: skip


class Par(NamedTuple):
    """Parameters of one machine."""

    mva: Annotated[float, "-", "machine MVA over system MVA", FROM_CASE]
    wb: Annotated[float, "rad/s", "base speed, 2 pi f", FROM_CASE]
    H: Annotated[float, "s", "inertia constant", Ge(0.01)]
    D: Annotated[float, "pu", "damping torque over speed deviation"]
    ra: Annotated[float, "pu", "armature resistance", NOT_NEGATIVE]
    xd: Annotated[float, "pu", "synchronous reactance, d axis", POSITIVE]
    x1d: Annotated[float, "pu", "transient reactance, d axis", POSITIVE]
    T1d: Annotated[float, "s", "transient open-circuit time constant, d axis", POSITIVE]
    xq: Annotated[float, "pu", "synchronous reactance, q axis", POSITIVE]
    x1q: Annotated[float, "pu", "transient reactance, q axis", POSITIVE]
    T1q: Annotated[float, "s", "transient open-circuit time constant, q axis (0: none, x1q = xq)", NOT_NEGATIVE]

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and sentence of everything the equations cannot be formed with."""
        yield from stator.absent(self, ("T1q", "x1q", "xq"))


class State(NamedTuple):
    """Rotor angle and speed, transient voltages."""

    delta: Annotated[float, "rad", "rotor angle relative to the synchronous frame"]
    omega: Annotated[float, "pu", "speed"]
    eq: Annotated[float, "pu", "E'q"]
    ed: Annotated[float, "pu", "-E'd"]


@inline
def internal(x, p):
    """Rotor position, and E'q and -E'd as fluxes of the d and q axis."""
    return Internal(np.sin(x.delta), np.cos(x.delta), x.eq, x.ed, 1.0)


@inline
def admittance(p):
    """Norton admittance 1/(ra + j x') (pu system), real and imaginary part."""
    g, b = stator.mean(p.ra, p.x1d, p.x1q)
    return p.mva * g, p.mva * b


def fault_admittance(p):
    """Admittance (pu system) of an unloaded machine, whose flux is on the d axis."""
    return p.mva / complex(p.ra, p.x1d)


@inline
def source(i, p):
    """Short-circuit current of the source E' (pu system), real and imaginary part."""
    return stator.norton(i, p, p.x1d, p.x1q)


@inline
def current(i, v, p):
    """What the saliency adds to the current of the source (pu system), real and imaginary part."""
    vr, vi = stator.terminal(i, v)
    flow = stator.solved(i.psid - vr, i.psiq - vi, p.ra, p.x1d, p.x1q)
    return stator.rest(i, v, p, flow, p.x1d, p.x1q)


@inline
def output(i, v, p):
    """Stator quantities, field current and q-axis rotor current (pu machine)."""
    vr, vi = stator.terminal(i, v)
    iq, id_ = stator.solved(i.psid - vr, i.psiq - vi, p.ra, p.x1d, p.x1q)
    Te = i.psid * iq - i.psiq * id_ + (p.x1q - p.x1d) * id_ * iq
    vt = magnitude(vr, vi)
    Ifd, Ilq = i.psid + (p.xd - p.x1d) * id_, i.psiq + (p.xq - p.x1q) * iq
    return Output(id_, iq, Te, vr * iq - vi * id_, vr * id_ + vi * iq, vt, vt, Ifd, Ilq)


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is this machine's own output."""
    slip = x.omega - 1
    return State(
        p.wb * slip,
        (u.Pm - y.Te - p.D * slip) / (2 * p.H),
        (u.Efd - y.Ifd) / p.T1d,
        circuit_rate(p.T1q, -y.Ilq, x.ed),
    )


def guess(V, I, p):
    """Initial guess: the rotor on the q axis of V + (ra + j xq) I, at synchronous speed."""
    return State(float(np.angle(V + complex(p.ra, p.xq) * I)), 1.0, 1.0, 0.0)
