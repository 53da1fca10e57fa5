"""Curves: saturation, a straight segment, piecewise linear tables, a power."""

import numpy as np

from stabctl._util.jit import inline

from .limits import at_least


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
