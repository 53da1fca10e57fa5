"""Quantities computed from the reports of a frame: internal voltages, powers, and their variances."""

from typing import NamedTuple

import numpy as np

from .frame_kernels import Constants, see
from .instrument import Frame
from .noise import computed_current_variance, computed_power_variance


class Measured(NamedTuple):
    """A frame and what follows from it, arrays (seeds, machines)."""

    frame: Frame
    V: np.ndarray  # pu
    ZI: np.ndarray  # pu
    E: np.ndarray  # pu   internal voltage V + ZI
    I: np.ndarray  # pu machine   current
    P: np.ndarray  # pu machine   air-gap power
    variance: np.ndarray  # of P
    of_current: np.ndarray  # (pu machine)^2   variance of a part of I, if it is computed, else 0


def measured(frame: Frame, known: Constants, noise: dict[str, float], power: bool) -> Measured:
    """The internal voltages of a frame, and with `power` the powers; `noise` as in `noise.power_variance`."""
    ZI, E, I = np.empty((3, *frame.V.shape), complex)
    P, variance, none = np.zeros((3, *frame.V.shape))
    V, current = np.ascontiguousarray(frame.V), np.ascontiguousarray(frame.I)
    see(V, current, known, noise["angle"], noise["magnitude"], ZI, E, I, P, variance)
    if not power:
        return Measured(frame, V, ZI, E, I, none, none, none)
    parts = frame.parts
    if parts is None:
        return Measured(frame, V, ZI, E, I, P, variance, none)
    of_power = computed_power_variance(parts.V, parts.I, (frame.V, frame.I), **noise) / known.mva**2
    of_current = computed_current_variance(parts.I, **noise) / known.mva**2
    variance = np.where(parts.computed, of_power, variance)
    return Measured(frame, V, ZI, E, I, P, variance, of_current * parts.computed)
