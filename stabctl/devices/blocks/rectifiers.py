"""Rectifier of an excitation system, the source that supplies it, and the field it demands of its exciter.

Source: IEEE Std 421.5, annex D (rectifier regulation), annex C (saturation), types AC and ST.
"""

import numpy as np

from stabctl._util.jit import inline

from .curves import quadratic
from .phasors import magnitude


@inline
def regulation(IN):
    """FEX(IN): mean voltage of a three-phase bridge over its no-load voltage, at the normalized load current IN."""
    if IN.real <= 0:
        return 1.0 + 0 * IN
    if IN.real > 1:
        return 0 * IN
    if IN.real >= 0.75:
        return 1.732 * (1.0 - IN)
    if IN.real > 0.433:
        return np.sqrt(0.75 - IN * IN)
    return 1.0 - 0.577 * IN


@inline
def rectified(ve, KC, Ifd):
    """Mean voltage VE FEX(KC Ifd/VE) of a rectifier supplied with VE; 0 where VE is not positive."""
    if ve.real <= 0:
        return 0 * ve
    return ve * regulation(KC * Ifd / ve)


@inline
def compound(v, u, KP, angle, KI, XL):
    """VE = |KP VT + j (KI + KP XL) IT|, KP at `angle` degrees: the voltage of a source fed by voltage and current.

    `v` is the terminal voltage (re, im); delta, id and iq in `u` give the current out of the machine.
    """
    ar, ai = KP * np.cos(np.pi / 180 * angle), KP * np.sin(np.pi / 180 * angle)
    zr, zi = KI + ar * XL, ai * XL
    sin, cos = np.sin(u.delta), np.cos(u.delta)
    ir, ii = u.iq * cos + u.id * sin, u.iq * sin - u.id * cos
    return magnitude(ar * v[0] - ai * v[1] - zi * ir - zr * ii, ai * v[0] + ar * v[1] + zr * ir - zi * ii)


@inline
def field_demand(ve, KE, SA, SB):
    """VFE = (KE + SE(VE)) VE: what an exciter at the voltage VE needs at its field, SE(VE) VE = SB (VE - SA)^2."""
    return KE * ve + quadratic(ve, SA, SB)


@inline
def crowbar(efd, Ifd, ratio):
    """Efd of a rectifier with a field resistor: -ratio Ifd while the field current is negative; ratio = 0: none."""
    if ratio > 0 and Ifd.real < 0:
        return -ratio * Ifd
    return efd
