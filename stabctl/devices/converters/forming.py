"""The circuit of grid-forming converters, with the current limited in magnitude.

I = (E exp(j delta) - V)/(RL + jXL), reduced to the magnitude ImaxF where it is larger, at the same angle
"""

from typing import Annotated, NamedTuple

import numpy as np

from stabctl._util.jit import inline
from stabctl.devices.blocks import magnitude, shortened
from stabctl.devices.ports import PORT, fixed


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
