"""GENSAE: the salient-pole machine GENSAL with an exponential saturation of both axes, S10 |psi''|^n.

n follows from S12, the saturation at 1.2 pu; with S10 = 0 or S12 = 0 there is none. The saturation acts along psi'', on
the d axis as field current, on the q axis as the damper current of (xq - xl)/(xd - xl) times the flux:

psi''q = [1/(1 + s T''q0)] <- -(xq - x'') iq - S psi''q (xq - xl)/(xd - xl)

Everything else is as in GENSAL.
Source: PSS/E Model Library, GENSAE.
"""

from stabctl._util.jit import inline
from stabctl.devices.blocks import magnitude, power

from .gensal import CLOSED, CONTINUATION, Par, State, currents, guess, internal, rates
from .saturation import along, exponent
from .stator import Input, Internal, Output, admittance, source

NAME = "GENSAE"
ROLE = "machine"
DYR = {"GENSAE": "T1d T2d T2q H D xd xq x1d x2 xl S10 S12"}
__all__ = [
    "CLOSED", "CONTINUATION", "DYR", "NAME", "ROLE", "Input", "Internal", "Output", "Par", "State", "admittance",
    "derivatives", "guess", "internal", "output", "source",
]  # fmt: skip


def prepare(p):
    """The parameters, with those computed from others."""
    SA, SB = exponent(p.S10, p.S12)
    return p._replace(SA=SA, SB=SB)


@inline
def saturation(i, p):
    """Extra excitation of the d and q axis (pu)."""
    return along(i, p.SB * power(magnitude(i.psid, i.psiq), p.SA), p)


@inline
def output(x, i, v, p):
    """Stator quantities and field current (pu machine); the q axis has no field circuit."""
    return currents(x, i, v, p, saturation(i, p)[0])


@inline
def derivatives(x, u, i, y, p):
    """State derivatives (1/s); y is this machine's own output."""
    return rates(x, u, y, p, saturation(i, p)[1])
