"""GENROE: the round-rotor machine GENROU with an exponential saturation, S10 |psi''|^n.

n follows from S12, the saturation at 1.2 pu; with S10 = 0 or S12 = 0 there is none. The saturation acts along psi'' on
both axes, that of the q axis scaled by its air gap. Everything else is as in GENROU.
Source: PSS/E Model Library, GENROE.
"""

from stabctl._util.jit import inline
from stabctl.devices.blocks import magnitude, power

from .genrou import CLOSED, CONTINUATION, Par, State, currents, derivatives, from_record, guess, internal
from .saturation import along, exponent
from .stator import Input, Internal, Output, admittance, source

NAME = "GENROE"
ROLE = "machine"
DYR = {"GENROE": "T1d T2d T1q T2q H D xd xq x1d x1q x2 xl S10 S12"}
__all__ = [
    "CLOSED", "CONTINUATION", "DYR", "NAME", "ROLE", "Input", "Internal", "Output", "Par", "State", "admittance",
    "derivatives", "from_record", "guess", "internal", "output", "source",
]  # fmt: skip


def prepare(p):
    """The parameters, with those computed from others."""
    SA, SB = exponent(p.S10, p.S12)
    return p._replace(SA=SA, SB=SB)


@inline
def output(x, i, v, p):
    """Stator quantities, field current and q-axis rotor current (pu machine)."""
    return currents(x, i, v, p, along(i, p.SB * power(magnitude(i.psid, i.psiq), p.SA), p))
