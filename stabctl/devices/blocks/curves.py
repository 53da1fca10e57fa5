"""Curves: saturation, tables, rectifiers and the sources of an exciter."""

import numpy as np

from stabctl._util.jit import inline

from .limits import at_least
from .phasors import magnitude


def through(x1, s1, x2, s2):
    """A and B of the saturation B (x - A)^2 through (x1, s1 x1) and (x2, s2 x2); 0, 0 if s2 = 0 (none)."""
    if s2 <= 0:
        return 0.0, 0.0
    ratio = float(np.sqrt(s1 * x1 / (s2 * x2)))
    start = (x1 - ratio * x2) / (1 - ratio)
    return start, s2 * x2 / (x2 - start) ** 2


@inline
def quadratic(x, A, B):
    """Extra excitation B (x - A)^2 for x > A."""
    if x.real <= A:
        return 0 * x
    return B * (x - A) * (x - A)


@inline
def line(x, x1, y1, x2, y2):
    """The straight line through (x1, y1) and (x2, y2), x1 < x2; y1 before it and y2 beyond."""
    if x.real <= x1:
        return y1 + 0 * x
    if x.real < x2:
        return y1 + (y2 - y1) / (x2 - x1) * (x - x1)
    return y2 + 0 * x


@inline
def lookup(x, xs, ys):
    """Piecewise linear curve through points (xs ascending); beyond the ends it is constant."""
    y = ys[0] + 0 * x
    for k in range(1, len(xs)):
        y = y + line(x, xs[k - 1], 0.0, xs[k], ys[k] - ys[k - 1])
    return y


@inline
def polyline(x, xs, ys):
    """Piecewise linear curve through points (xs ascending); its first and last segments go on beyond the ends."""
    slope = (ys[1] - ys[0]) / (xs[1] - xs[0])
    y = ys[0] + slope * (x - xs[0])
    for k in range(2, len(xs)):
        steeper = (ys[k] - ys[k - 1]) / (xs[k] - xs[k - 1])
        y, slope = y + (steeper - slope) * at_least(x - xs[k - 1], 0.0), steeper
    return y


@inline
def power(x, n):
    """x^n for x > 0, otherwise 0."""
    if x.real <= 0:
        return 0 * x
    return np.exp(n * np.log(x))


# Rectifier of an excitation system, the source that supplies it, and the field it demands of its exciter.
#
# Source: IEEE Std 421.5, annex D (rectifier regulation), annex C (saturation), types AC and ST.


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
