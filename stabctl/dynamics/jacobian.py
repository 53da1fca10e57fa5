"""Exact derivatives of the system by complex step: J[:, k] = Im f(z + j h e_k)/h, h = 1e-30."""

import numpy as np

from stabctl._util.jit import entry

from . import system
from .system import Buffers, Plant

STEP = 1e-30


@entry
def jacobian(b, plant, on, columns, J):
    """Fill J[:, k] with the derivative of f along the places `columns[k]` of z (a row of -1 ends a shorter one).

    Each row of `columns` is perturbed at once: its places must not act on the same rows of f. f(z) is left in b.f.
    """
    for k in range(len(columns)):
        for c in columns[k]:
            if c >= 0:
                b.z[c] += 1j * STEP
        system.rates(b.s, plant, b.w, b.r)
        system.hold(b.z, b.f, plant, b.w)
        system.sources(b.s, plant, on, b.r.g)
        system.draws(b.s, plant, b.r.g)
        for c in columns[k]:
            if c >= 0:
                b.z[c] = b.z[c].real
        for i in range(len(b.f)):
            J[i, k] = b.f[i].imag / STEP


def columns_of(b: Buffers, plant: Plant, places: np.ndarray) -> np.ndarray:
    """Columns of the Jacobian (len(f), len(places)) at b.z, one place at a time."""
    J = np.empty((len(b.f), len(places)))
    on = np.zeros(len(plant.machine_bus), np.int64)
    jacobian(b, plant, on, places.astype(np.int64)[:, None], J)
    return J
