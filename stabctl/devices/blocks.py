"""Scalar blocks shared by every device, and the only place where a value is limited.

Each accepts a float or a complex-step number: no `abs`, `min`, `sign` or `conj`, and a branch looks only at
the real part. A limit is returned plain, never as `lo + 0*x` (which is nan at x = inf).
"""

import numpy as np

from stabctl._util.jit import inline

SHORT = 1e-3  # s   a control time constant below this bypasses its block


@inline
def copy(source, target):
    """target[:] = source for vectors (a slice assignment costs seconds of compile time)."""
    for k in range(len(target)):
        target[k] = source[k]


@inline
def magnitude(re, im):
    """Length of the phasor re + j im."""
    return np.sqrt(re * re + im * im)


@inline
def at_least(x, low):
    """x, but never below `low`."""
    return low if x.real < low.real else x


@inline
def clip(x, low, high):
    """x between its limits."""
    if x.real < low.real:
        return low
    if x.real > high.real:
        return high
    return x


@inline
def lag(T, u, x):
    """u -> [ 1/(1 + sT) ] -> y, state x; bypassed where T < SHORT."""
    return x if T >= SHORT else u


@inline
def lead_lag(T1, T2, u, x):
    """u -> [ (1 + s T1)/(1 + s T2) ] -> y, state x (the lagged input); bypassed where T2 < SHORT."""
    return x + T1 / T2 * (u - x) if T2 >= SHORT else u


@inline
def lag_rate(T, u, x):
    """State rate (1/s) of `lag`, and of `lead_lag` with T = T2; a bypassed state stands still."""
    return (u - x) / T if T >= SHORT else 0 * x


@inline
def circuit_rate(T, drive, x):
    """State rate (1/s) of a rotor circuit, drive/T; T = 0 means an open circuit, whose flux stays as it is."""
    return drive / T if T > 0 else 0 * x


def through(x1, s1, x2, s2):
    """A and B of the saturation B (x - A)^2 through (x1, s1 x1) and (x2, s2 x2); 0, 0 where s2 = 0 (none)."""
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
def angle(re, im):
    """Angle (rad) of the phasor re + j im, within half a turn: twice the arctangent of half of it."""
    return 2 * np.arctan(im / (magnitude(re, im) + re))
