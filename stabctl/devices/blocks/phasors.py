"""Phasors as pairs of real and imaginary part, and a copy of a vector."""

import numpy as np

from stabctl._util.jit import inline


@inline
def copy(source, target):
    """target[:] = source for vectors (a slice assignment costs seconds of compile time)."""
    for k in range(len(target)):
        target[k] = source[k]


@inline
def magnitude(re, im):
    """Magnitude of the phasor re + j im."""
    return np.sqrt(re * re + im * im)


@inline
def shortened(re, im, most):
    """The phasor re + j im, where it is longer than `most` that of this length in the same direction."""
    square = re * re + im * im
    if square.real > most * most:
        k = most / np.sqrt(square)
        return k * re, k * im
    return re, im


@inline
def angle(re, im):
    """Angle (rad) of the phasor re + j im, within half a turn: twice the arctangent of half of it; 0 of no phasor."""
    along = magnitude(re, im) + re
    return 0 * im if along.real <= 0 else 2 * np.arctan(im / along)
