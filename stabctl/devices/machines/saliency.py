"""Stator of a machine whose source has another reactance on the d than on the q axis.

vq = psid - ra iq - xd id,    vd = -psiq - ra id + xq iq

The network equations have psi = psid + j psiq behind ra + j x, 1/x the mean of 1/xd and 1/xq; the rest of the current
depends on the angle between voltage and rotor.
"""

from stabctl._util.jit import inline


@inline
def terminal(i, v):
    """Terminal voltage in the rotor frame, vq and -vd."""
    return i.cos * v[0] + i.sin * v[1], i.cos * v[1] - i.sin * v[0]


@inline
def solved(er, ei, ra, xd, xq):
    """Currents iq and id (pu machine) from the voltages er + j ei over the impedances."""
    k = 1 / (ra * ra + xd * xq)
    return k * (ra * er + xd * ei), k * (xq * er - ra * ei)


@inline
def mean(ra, xd, xq):
    """Conductance and susceptance of ra + j x (pu machine)."""
    x = 2 * xd * xq / (xd + xq)
    k = 1 / (ra * ra + x * x)
    return k * ra, -k * x


@inline
def norton(i, p, xd, xq):
    """Short-circuit current of the source behind ra + j x (pu system), real and imaginary part."""
    g, b = mean(p.ra, xd, xq)
    er, ei = i.cos * i.psid - i.sin * i.psiq, i.sin * i.psid + i.cos * i.psiq
    return p.mva * (g * er - b * ei), p.mva * (g * ei + b * er)


@inline
def rest(i, v, p, flow, xd, xq):
    """What the stator currents `flow`, iq and id, have beyond those through ra + j x (pu system)."""
    vr, vi = terminal(i, v)
    g, b = mean(p.ra, xd, xq)
    er, ei = i.psid - vr, i.psiq - vi
    re, im = flow[0] - (g * er - b * ei), -flow[1] - (g * ei + b * er)
    return p.mva * (i.cos * re - i.sin * im), p.mva * (i.sin * re + i.cos * im)
