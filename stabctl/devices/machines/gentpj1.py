"""GENTPJ1: synchronous machine whose reactances and time constants saturate; with Kis = 0 it is GENTPF.

E'q -> (+) Sd -> [1/(s T''d0)] -> psi''d     T'd0 dE'q/dt = Efd - Xad Ifd
       (-) Sd psi''d + (x'd - x''d) id       Xad Ifd = Sd (psi''d + (E'q - psi''d)(xd - x''d)/(x'd - x''d))
and likewise -E'd, psi''q, xq, x'q, x''q, T'q0, T''q0 with Sq and without a field voltage
vq = psi''d - ra iq - (xl + (x''d - xl)/Sd) id,    vd = -psi''q - ra id + (xl + (x''q - xl)/Sq) iq
Sd = 1 + S(m),  Sq = 1 + xq/xd S(m),  m = |V + (ra + j xl) I| + Kis |I|,  S(m) = B (m - A)^2 / m

S passes through S10 and S12 (one of them 0: none). Its argument depends on the current, which depends on it: the two
are solved by Newton's method. The source has no speed factor; the mechanical torque is Pm/omega, or Pm with torque = 1.
Per unit on the machine's own MVA; `mva` converts currents to the system base.
Source: J. Undrill, The gentpj model, WECC, 2007 (updated 2012), eq. (1)-(20).
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import at_least, circuit_rate, magnitude

from .genrou import from_record
from .saturation import mistakes, points
from .stator import Input, Internal, Output, absent, mean, norton, rest, solved, terminal, torque

NAME = "GENTPJ1"
ROLE = "machine"
CONTINUATION = ("SB",)
CLOSED = ("T1q",)
STEPS = 4  # of Newton's method; the error is squared by each of them
DYR = {
    "GENTPJ1": "T1d T2d T1q T2q H D xd xq x1d x1q x2d x2q xl S10 S12 Kis",
    "GENTPF": "T1d T2d T1q T2q H D xd xq x1d x1q x2d x2q xl S10 S12",
}
__all__ = [
    "CLOSED", "CONTINUATION", "DYR", "NAME", "ROLE", "Input", "Internal", "Output", "Par", "State", "admittance",
    "current", "derivatives", "fault_admittance", "from_record", "internal", "output", "source",
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
    x2d: Annotated[float, "pu", "subtransient reactance, d axis", POSITIVE]
    T1d: Annotated[float, "s", "transient open-circuit time constant, d axis", POSITIVE]
    T2d: Annotated[float, "s", "subtransient open-circuit time constant, d axis", POSITIVE]
    xq: Annotated[float, "pu", "synchronous reactance, q axis", POSITIVE]
    x1q: Annotated[float, "pu", "transient reactance, q axis", POSITIVE]
    x2q: Annotated[float, "pu", "subtransient reactance, q axis", POSITIVE]
    T1q: Annotated[float, "s", "transient open-circuit time constant, q axis (0: none, x1q = xq)", NOT_NEGATIVE]
    T2q: Annotated[float, "s", "subtransient open-circuit time constant, q axis", POSITIVE]
    S10: Annotated[float, "pu", "saturation at 1.0 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    S12: Annotated[float, "pu", "saturation at 1.2 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    Kis: Annotated[float, "pu", "flux equivalent of the stator current (0: GENTPF)", NOT_NEGATIVE] = 0.0
    torque: Annotated[int, "-", "1: Pm is a torque (textbooks), 0: a power, Pm/omega (PSS/E)", Interval(ge=0, le=1)] = 0
    SA: Annotated[float, "pu", "flux at which saturation begins, from S10 and S12", FROM_CASE] = 0.0
    SB: Annotated[float, "1/pu", "slope of saturation, from S10 and S12", FROM_CASE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and sentence of everything the equations cannot be formed with."""
        for name, low in (("x1d", "x2d"), ("x1q", "x2q")):
            if getattr(self, name) == getattr(self, low):
                yield name, f"must differ from {low} = {getattr(self, low):g}"
        yield from absent(self, ("T1q", "x1q", "xq"))
        yield from mistakes(self)


class State(NamedTuple):
    """Rotor angle and speed, transient and subtransient fluxes."""

    delta: Annotated[float, "rad", "rotor angle relative to the synchronous frame"]
    omega: Annotated[float, "pu", "speed"]
    eq: Annotated[float, "pu", "E'q"]
    kd: Annotated[float, "pu", "subtransient flux psi''d"]
    ed: Annotated[float, "pu", "-E'd"]
    kq: Annotated[float, "pu", "subtransient flux psi''q"]


def prepare(p):
    """The parameters, with those computed from others."""
    SA, SB = points(p.S10, p.S12)
    return p._replace(SA=SA, SB=SB)


@inline
def internal(x, p):
    """Rotor position and subtransient flux linkages."""
    return Internal(np.sin(x.delta), np.cos(x.delta), x.kd, x.kq, 1.0)


@inline
def admittance(p):
    """Norton admittance 1/(ra + j x'') (pu system), real and imaginary part."""
    g, b = mean(p.ra, p.x2d, p.x2q)
    return p.mva * g, p.mva * b


def fault_admittance(p):
    """Admittance (pu system) of an unloaded machine, whose flux is on the d axis."""
    return p.mva / complex(p.ra, p.x2d)


@inline
def source(i, p):
    """Short-circuit current of the source psi'' (pu system), real and imaginary part."""
    return norton(i, p, p.x2d, p.x2q)


@inline
def stator(i, vr, vi, p):
    """Saturation S, and currents iq and id (pu machine), at a terminal voltage vr + j vi = vq - j vd."""
    S, er, ei, ratio = 0 * i.psid, i.psid - vr, i.psiq - vi, p.xq / p.xd
    for _ in range(STEPS if p.SB > 0 else 0):
        Sd, Sq = 1 + S, 1 + ratio * S
        xd, xq = p.xl + (p.x2d - p.xl) / Sd, p.xl + (p.x2q - p.xl) / Sq
        iq, id_ = solved(er, ei, p.ra, xd, xq)
        size = magnitude(iq, id_) + 1e-12
        fr, fi = vr + p.ra * iq + p.xl * id_, vi + p.xl * iq - p.ra * id_
        flux = magnitude(fr, fi)
        m = flux + p.Kis * size
        over = at_least(m - p.SA, 0.0)
        rise = (p.x2d - p.xl) / (Sd * Sd) * id_, ratio * (p.x2q - p.xl) / (Sq * Sq) * iq
        diq, did = solved(rise[0], rise[1], p.ra, xd, xq)
        dm = (fr * (p.ra * diq + p.xl * did) + fi * (p.xl * diq - p.ra * did)) / flux
        dm = dm + p.Kis * (iq * diq + id_ * did) / size
        S = S - (S - p.SB * over * over / m) / (1 - p.SB * over * (m + p.SA) / (m * m) * dm)
    xd, xq = p.xl + (p.x2d - p.xl) / (1 + S), p.xl + (p.x2q - p.xl) / (1 + ratio * S)
    iq, id_ = solved(er, ei, p.ra, xd, xq)
    return S, iq, id_


@inline
def current(i, v, p):
    """What saliency and saturation add to the current of the source (pu system), real and imaginary part."""
    vr, vi = terminal(i, v)
    S, iq, id_ = stator(i, vr, vi, p)
    return rest(i, v, p, (iq, id_), p.x2d, p.x2q)


@inline
def rotor(S, eq, k, x, x1, x2):
    """Rotor current of an axis from its fluxes."""
    return (1 + S) * (k + (eq - k) * (x - x2) / (x1 - x2))


@inline
def output(x, i, v, p):
    """Stator quantities, field current and q-axis rotor current (pu machine)."""
    vr, vi = terminal(i, v)
    S, iq, id_ = stator(i, vr, vi, p)
    P, vt = vr * iq - vi * id_, magnitude(vr, vi)
    Ifd = rotor(S, x.eq, x.kd, p.xd, p.x1d, p.x2d)
    Ilq = rotor(p.xq / p.xd * S, x.ed, x.kq, p.xq, p.x1q, p.x2q)
    return Output(id_, iq, P + p.ra * (iq * iq + id_ * id_), P, vr * id_ + vi * iq, vt, vt, Ifd, Ilq)


@inline
def derivatives(x, u, i, v, y, p):
    """State derivatives (1/s); y is this machine's own output."""
    vr, vi = terminal(i, v)
    S, iq, id_ = stator(i, vr, vi, p)
    return State(
        p.wb * (x.omega - 1),
        (torque(x, u, p) - y.Te - p.D * (x.omega - 1)) / (2 * p.H),
        (u.Efd - y.Ifd) / p.T1d,
        ((1 + S) * (x.eq - x.kd) - (p.x1d - p.x2d) * y.id) / p.T2d,
        circuit_rate(p.T1q, -y.Ilq, x.ed),
        ((1 + p.xq / p.xd * S) * (x.ed - x.kq) - (p.x1q - p.x2q) * y.iq) / p.T2q,
    )


def guess(V, I, p):
    """Initial guess: the rotor on the q axis of V + (ra + j xq) I, at synchronous speed, fluxes of 1 pu."""
    return State(float(np.angle(V + complex(p.ra, p.xq) * I)), 1.0, 1.0, 1.0, 0.3, 0.3)
