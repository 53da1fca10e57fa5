"""The circuit of grid-forming converters, its current limited in magnitude, and limits of the steady current.

I = (E exp(j delta) - V)/(RL + jXL), reduced to the magnitude ImaxF where it is larger, at the same angle
"""

from typing import Annotated, Any, NamedTuple

import numpy as np

from stabctl._util.jit import inline

from ..blocks import at_least, beyond_rate, magnitude, shortened
from ..ports import PORT, fixed
from .electrical import root


class Input(NamedTuple):
    """References of a converter, on its base."""

    Pref: Annotated[float, "pu", "active power at nominal frequency", PORT]
    Qref: Annotated[float, "pu", "reactive power at the voltage Vref", fixed(0.0)]
    Vref: Annotated[float, "pu", "voltage reference", PORT]


class Output(NamedTuple):
    """Power and voltage at the terminals, virtual speed, and internal voltage."""

    P: Annotated[float, "pu", "active power delivered, converter base"]
    Q: Annotated[float, "pu", "reactive power delivered, converter base"]
    vt: Annotated[float, "pu", "terminal voltage"]
    omega: Annotated[float, "pu", "virtual speed"]
    E: Annotated[float, "pu", "internal voltage before the current limit"]


@inline
def through(re, im, p):
    """Current (pu converter) that a voltage drives through RL + jXL."""
    z2 = p.RL * p.RL + p.XL * p.XL
    return (p.RL * re + p.XL * im) / z2, (p.RL * im - p.XL * re) / z2


@inline
def short_circuit(E, delta, p):
    """Short-circuit current of the internal voltage without limit (pu system), real and imaginary part."""
    ir, ii = through(E * np.cos(delta), E * np.sin(delta), p)
    return p.mva * ir, p.mva * ii


@inline
def admittance(p):
    """Norton admittance 1/(RL + jXL) (pu system), real and imaginary part."""
    g, b = through(1.0, 0.0, p)
    return p.mva * g, p.mva * b


@inline
def unlimited(E, delta, v, p):
    """Current of the source (pu converter), real and imaginary part."""
    return through(E * np.cos(delta) - v[0], E * np.sin(delta) - v[1], p)


@inline
def limited(E, delta, v, p):
    """Current of the source within ImaxF (pu converter), real and imaginary part."""
    ir, ii = unlimited(E, delta, v, p)
    return shortened(ir, ii, p.ImaxF)


@inline
def correction(E, delta, v, p):
    """Current that the limit adds to that of the source (pu system), real and imaginary part."""
    ir, ii = unlimited(E, delta, v, p)
    jr, ji = shortened(ir, ii, p.ImaxF)
    return p.mva * (jr - ir), p.mva * (ji - ii)


@inline
def terminals(E, delta, v, p):
    """Active and reactive power and voltage at the terminals (pu converter)."""
    ir, ii = limited(E, delta, v, p)
    return v[0] * ir + v[1] * ii, v[1] * ir - v[0] * ii, magnitude(v[0], v[1])


# The limits of the steady current of REGFM_B1, through the angle ahead of the phase-locked loop and the voltage.
#
# Idmax = kf ImaxSS, Iqmax = sqrt(ImaxSS^2 - idf^2) with PQFlag = 1;  Idmax = sqrt(ImaxSS^2 - iqf^2), Iqmax = kf ImaxSS
# kI (Idmax - idf) -> [1/s], 0..asin(XL ImaxSS) -> dmax;   kI (-Ke Idmax - idf) -> [1/s], -asin(XL ImaxSS)..0 -> dmin
# Emax, Emin = sqrt((vm +/- Iqmax XL)^2 + (idf XL)^2)
#
# With ESFlag = 0, dmin is 0: no power is taken in. dmax and dmin are asin(XL ImaxSS) less the states `over` and
# `under`,
# which rest at 0.
# Source: see `regfm_b1`.


def widest(p: Any) -> Any:
    """Parameters with the largest angles that ImaxSS allows."""
    most = float(np.arcsin(min(p.XL * p.ImaxSS, 1.0)))
    return p._replace(deltamax=most, deltamin=-most if p.ESFlag > 0.5 else 0.0)


@inline
def most(x, p):
    """Limits of the active and the reactive current in steady state (pu)."""
    if p.PQFlag > 0.5:
        return p.kf * p.ImaxSS, root(p.ImaxSS, x.idf)
    return root(p.ImaxSS, x.iqf), p.kf * p.ImaxSS


@inline
def voltage_limits(x, p):
    """Emin and Emax (pu), at which the reactive current is at its limit."""
    _, iq = most(x, p)
    ahead = x.idf * p.XL
    return magnitude(at_least(x.vm - iq * p.XL, 0.0), ahead), magnitude(x.vm + iq * p.XL, ahead)


@inline
def leads(x, p):
    """Least and largest angle (rad) of the internal voltage ahead of the phase-locked loop."""
    return p.deltamin + x.under, p.deltamax - x.over


@inline
def reductions(x, p):
    """State derivatives (rad/s) of the reductions of both angles, while the active current is beyond its limit."""
    idmax, _ = most(x, p)
    taking = p.kI if p.ESFlag > 0.5 else 0.0
    return beyond_rate(p.kI, x.idf - idmax, x.over), beyond_rate(taking, -p.Ke * idmax - x.idf, x.under)
