"""GENSAL: salient-pole synchronous machine with one field circuit and one damper circuit per axis, x''q = x''d.

Efd -> (+) -> [1/(s T'd0)] -> E'q            E'q -> (+) -> [1/(s T''d0)] -> psi_kd
       (-) <- Xad Ifd                              (-) <- psi_kd + (x'd - xl) id
psi''d = E'q (x''-xl)/(x'd-xl) + psi_kd (x'd-x'')/(x'd-xl)
psi''q = [1/(1 + s T''q0)] <- -(xq - x'') iq
Xad Ifd = E'q + S(E'q) + (xd - x'd) (id + (x'd-x'')/(x'd-xl)^2 (E'q - psi_kd - (x'd-xl) id))

S is the saturation of E'q alone, B (E'q - A)^2 through S10 and S12 (one of them 0: none). The q axis has no field and
is unsaturated. The source behind ra + j x'' is psi''. The mechanical torque is Pm/omega, or Pm with torque = 1. Per
unit on the machine's own MVA; `mva` converts currents to the system base.
Source: PSS/E Model Library, GENSAL; Kundur, Power System Stability and Control, sections 3.4-3.6 and 5.3.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import circuit_rate, quadratic

from .saturation import mistakes, points
from .stator import Input, Internal, Output, absent, admittance, source, stator, torque

NAME = "GENSAL"
ROLE = "machine"
CONTINUATION = ("SB",)
CLOSED = ("T2d", "T2q")
DYR = {"GENSAL": "T1d T2d T2q H D xd xq x1d x2 xl S10 S12"}
__all__ = [
    "CLOSED", "CONTINUATION", "DYR", "NAME", "ROLE", "Input", "Internal", "Output", "Par", "State", "admittance",
    "derivatives", "internal", "output", "source",
]  # fmt: skip


class Par(NamedTuple):
    """Parameters of one machine."""

    mva: Annotated[float, "-", "machine MVA over system MVA", FROM_CASE]
    wb: Annotated[float, "rad/s", "base speed, 2 pi f", FROM_CASE]
    H: Annotated[float, "s", "inertia constant", Ge(0.01)]
    D: Annotated[float, "pu", "damping torque over speed deviation"]
    ra: Annotated[float, "pu", "armature resistance", NOT_NEGATIVE]
    xl: Annotated[float, "pu", "leakage reactance", NOT_NEGATIVE]
    xd: Annotated[float, "pu", "synchronous reactance, d axis", POSITIVE]
    x1d: Annotated[float, "pu", "transient reactance, d axis", POSITIVE]
    x2: Annotated[float, "pu", "subtransient reactance, both axes", POSITIVE]
    T1d: Annotated[float, "s", "transient open-circuit time constant, d axis", POSITIVE]
    T2d: Annotated[float, "s", "subtransient open-circuit time constant, d axis (0: none, x2 = x1d)", NOT_NEGATIVE]
    xq: Annotated[float, "pu", "synchronous reactance, q axis", POSITIVE]
    T2q: Annotated[float, "s", "subtransient open-circuit time constant, q axis (0: none, x2 = xq)", NOT_NEGATIVE]
    S10: Annotated[float, "pu", "saturation at E'q = 1.0 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    S12: Annotated[float, "pu", "saturation at E'q = 1.2 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    torque: Annotated[int, "-", "1: Pm is a torque (textbooks), 0: a power, Pm/omega (PSS/E)", Interval(ge=0, le=1)] = 0
    SA: Annotated[float, "pu", "E'q at which saturation begins, from S10 and S12", FROM_CASE] = 0.0
    SB: Annotated[float, "1/pu", "slope of saturation, from S10 and S12", FROM_CASE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and sentence of everything the equations cannot be formed with."""
        if self.x1d == self.xl:
            yield "x1d", f"must differ from the leakage reactance xl = {self.xl:g}"
        yield from absent(self, ("T2d", "x2", "x1d"), ("T2q", "x2", "xq"))
        yield from mistakes(self)


class State(NamedTuple):
    """Rotor angle and speed, field and damper fluxes."""

    delta: Annotated[float, "rad", "rotor angle relative to the synchronous frame"]
    omega: Annotated[float, "pu", "speed"]
    eq: Annotated[float, "pu", "E'q"]
    kd: Annotated[float, "pu", "damper flux, d axis"]
    kq: Annotated[float, "pu", "subtransient flux psi''q"]


def prepare(p):
    """The parameters, with those computed from others."""
    SA, SB = points(p.S10, p.S12)
    return p._replace(SA=SA, SB=SB)


@inline
def internal(x, p):
    """Rotor position, and subtransient flux linkages psi''d, psi''q (pu)."""
    a = (p.x2 - p.xl) / (p.x1d - p.xl)
    return Internal(np.sin(x.delta), np.cos(x.delta), a * x.eq + (1 - a) * x.kd, x.kq, 1.0)


@inline
def damping(x, id_, p):
    """Input of the integrator of the d-axis damper flux (pu)."""
    return x.eq - x.kd - (p.x1d - p.xl) * id_


@inline
def output(x, i, v, p):
    """Stator quantities and field current (pu machine); the q axis has no field circuit."""
    return currents(x, i, v, p, quadratic(x.eq, p.SA, p.SB))


@inline
def currents(x, i, v, p, iron):
    """The same for an extra excitation of the d axis."""
    id_, iq, Te, P, Q, vt, ve = stator(i, v, p)
    a = p.x1d - p.xl
    Ifd = x.eq + iron + (p.xd - p.x1d) * (id_ + (p.x1d - p.x2) / (a * a) * damping(x, id_, p))
    return Output(id_, iq, Te, P, Q, vt, ve, Ifd, 0 * Ifd)


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is this machine's own output."""
    return rates(x, u, y, p, 0.0)


@inline
def rates(x, u, y, p, iron):
    """The same for an extra excitation of the q axis."""
    return State(
        p.wb * (x.omega - 1),
        (torque(x, u, p) - y.Te - p.D * (x.omega - 1)) / (2 * p.H),
        (u.Efd - y.Ifd) / p.T1d,
        circuit_rate(p.T2d, damping(x, y.id, p), x.kd),
        circuit_rate(p.T2q, -x.kq - (p.xq - p.x2) * y.iq - iron, x.kq),
    )


def guess(V, I, p):
    """Initial guess: the rotor on the q axis of V + (ra + j xq) I, at synchronous speed, fluxes of 1 pu."""
    return State(float(np.angle(V + complex(p.ra, p.xq) * I)), 1.0, 1.0, 1.0, 1.0)
