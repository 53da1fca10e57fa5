"""GENROU: round-rotor synchronous machine with a field winding and three damper windings, x''q = x''d.

Tm -> (+) -> [1/(2Hs)] -> omega - 1 -> [wb/s] -> delta
            (-) Te + D (omega - 1)
Efd -> (+) -> [1/(s T'd0)] -> E'q            E'q -> (+) -> [1/(s T''d0)] -> psi_kd
       (-) <- Xad Ifd                               (-) <- psi_kd + (x'd - xl) id
       (-) Xaq I1q -> [1/(s T'q0)] -> -E'd  -E'd -> (+) -> [1/(s T''q0)] -> psi_kq
                                                    (-) <- psi_kq + (x'q - xl) iq
psi''d = E'q (x''-xl)/(x'd-xl) + psi_kd (x'd-x'')/(x'd-xl);  psi''q likewise from -E'd and psi_kq

The source behind ra + j x'' is (psi''d + j psi''q) exp(j delta), times omega with speed_factor = 1 (PST). Saturation
depends on the magnitude of psi'' and acts on both axes, B (|psi''| - A)^2 through S10 and S12 (one of them 0: none).
With x'q = xq it is a salient-pole machine. Per unit on the machine's own MVA; `mva` converts currents to the system
base. Tm is Pm/omega, or Pm with torque = 1 (textbooks).
Source: Kundur, Power System Stability and Control, ch. 3-5; PSS/E Model Library, GENROU; Power System Toolbox (PST).
"""

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import circuit_rate, magnitude, quadratic

from .saturation import along, mistakes, points
from .stator import Input, Internal, Output, absent, admittance, source, stator, torque

NAME = "GENROU"
ROLE = "machine"
CONTINUATION = ("SB",)
CLOSED = ("T2d", "T1q", "T2q")
DYR = {"GENROU": "T1d T2d T1q T2q H D xd xq x1d x1q x2 xl S10 S12"}
__all__ = [
    "CLOSED", "CONTINUATION", "DYR", "NAME", "ROLE", "Input", "Internal", "Output", "Par", "State", "admittance",
    "derivatives", "from_record", "internal", "output", "source",
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
    x1q: Annotated[float, "pu", "transient reactance, q axis", POSITIVE]
    T1q: Annotated[float, "s", "transient open-circuit time constant, q axis (0: none, x1q = xq)", NOT_NEGATIVE]
    T2q: Annotated[float, "s", "subtransient open-circuit time constant, q axis (0: none, x2 = x1q)", NOT_NEGATIVE]
    S10: Annotated[float, "pu", "saturation at flux 1.0 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    S12: Annotated[float, "pu", "saturation at flux 1.2 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    speed_factor: Annotated[int, "-", "1: stator voltage omega psi'' (PST), 0: psi'' (PSS/E)", Interval(ge=0, le=1)] = 0
    torque: Annotated[int, "-", "1: Pm is a torque (textbooks), 0: a power, Pm/omega (PSS/E)", Interval(ge=0, le=1)] = 0
    SA: Annotated[float, "pu", "flux at which saturation begins, from S10 and S12", FROM_CASE] = 0.0
    SB: Annotated[float, "1/pu", "slope of saturation, from S10 and S12", FROM_CASE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and sentence of everything the equations cannot be formed with."""
        for name in ("x1d", "x1q"):
            if getattr(self, name) == self.xl:
                yield name, f"must differ from the leakage reactance xl = {self.xl:g}"
        yield from absent(self, ("T2d", "x2", "x1d"), ("T1q", "x1q", "xq"), ("T2q", "x2", "x1q"))
        if self.T1q == 0 and self.x1q == self.xq and self.S10 > 0 and self.S12 > 0:
            yield "T1q", "must be above 0 where there is saturation, which moves the flux of the q axis, too"
        yield from mistakes(self)


class State(NamedTuple):
    """Rotor angle and speed, field and damper fluxes."""

    delta: Annotated[float, "rad", "rotor angle relative to the synchronous frame"]
    omega: Annotated[float, "pu", "speed"]
    eq: Annotated[float, "pu", "E'q"]
    kd: Annotated[float, "pu", "damper flux, d axis"]
    ed: Annotated[float, "pu", "-E'd"]
    kq: Annotated[float, "pu", "damper flux, q axis"]


def prepare(p):
    """The parameters, with those computed from others."""
    SA, SB = points(p.S10, p.S12)
    return p._replace(SA=SA, SB=SB)


@inline
def internal(x, p):
    """Rotor position, subtransient flux linkages psi''d, psi''q (pu) and factor of the stator voltage."""
    a = (p.x2 - p.xl) / (p.x1d - p.xl)
    b = (p.x2 - p.xl) / (p.x1q - p.xl)
    psid, psiq = a * x.eq + (1 - a) * x.kd, b * x.ed + (1 - b) * x.kq
    return Internal(np.sin(x.delta), np.cos(x.delta), psid, psiq, 1 + p.speed_factor * (x.omega - 1))


@inline
def saturation(i, p):
    """Extra excitation on the d and q axis, S(|psi''|) along the flux; the q axis scaled by its air gap."""
    if p.SB <= 0:
        return 0 * i.psid, 0 * i.psiq
    flux = magnitude(i.psid, i.psiq)
    return along(i, quadratic(flux, p.SA, p.SB) / flux, p)


@inline
def damping(x, id_, iq, p):
    """Inputs of the integrators of the damper fluxes, d and q axis (pu)."""
    return x.eq - x.kd - (p.x1d - p.xl) * id_, x.ed - x.kq - (p.x1q - p.xl) * iq


@inline
def output(x, i, v, p):
    """Stator quantities, field current and q-axis rotor current (pu machine)."""
    return currents(x, i, v, p, saturation(i, p))


@inline
def currents(x, i, v, p, iron):
    """The same for an extra excitation of the two axes."""
    id_, iq, Te, P, Q, vt, ve = stator(i, v, p)
    damp_d, damp_q = damping(x, id_, iq, p)
    a, b = p.x1d - p.xl, p.x1q - p.xl
    Ifd = x.eq + (p.xd - p.x1d) * (id_ + (p.x1d - p.x2) / (a * a) * damp_d) + iron[0]
    Ilq = x.ed + (p.xq - p.x1q) * (iq + (p.x1q - p.x2) / (b * b) * damp_q) + iron[1]
    return Output(id_, iq, Te, P, Q, vt, ve, Ifd, Ilq)


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is this machine's own output."""
    damp_d, damp_q = damping(x, y.id, y.iq, p)
    return State(
        p.wb * (x.omega - 1),
        (torque(x, u, p) - y.Te - p.D * (x.omega - 1)) / (2 * p.H),
        (u.Efd - y.Ifd) / p.T1d,
        circuit_rate(p.T2d, damp_d, x.kd),
        circuit_rate(p.T1q, -y.Ilq, x.ed),
        circuit_rate(p.T2q, damp_q, x.kq),
    )


def from_record(_kind: str, values: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of a record. T'q0 = L/R = 0: a circuit of infinite resistance, which is absent."""
    if values["T1q"]:
        return values, []
    said = "T'q0 = 0: there is no such circuit; x'q becomes xq, T'q0 becomes T''q0."
    return values | {"x1q": values["xq"], "T1q": values["T2q"]}, [said]


def guess(V, I, p):
    """Initial guess: the rotor on the q axis of V + (ra + j xq) I, at synchronous speed, fluxes of 1 pu."""
    return State(float(np.angle(V + complex(p.ra, p.xq) * I)), 1.0, 1.0, 1.0, 1.0, 1.0)
