"""What follows from the reports of a frame: internal voltages, powers, and their variances."""

from typing import NamedTuple

import numpy as np

from .instrument import Frame
from .noise import computed_current_variance, computed_power_variance, power_variance
from .rotor_units import RotorUnits


class Measured(NamedTuple):
    """A frame and what follows from it, arrays (seeds, machines)."""

    frame: Frame
    ZI: np.ndarray  # pu
    E: np.ndarray  # pu   internal voltage V + ZI
    I: np.ndarray  # pu machine   current
    P: np.ndarray  # pu machine   air-gap power
    variance: np.ndarray  # of P
    of_current: np.ndarray  # (pu machine)^2   variance of a part of I, if it is computed, else 0


def measured(frame: Frame, known: RotorUnits, noise: dict[str, float], power: bool) -> Measured:
    """The internal voltages of a frame, and with `power` the powers; `noise` as in `noise.power_variance`."""
    ZI = known.impedance * frame.I
    E = frame.V + ZI
    E = np.where(np.abs(E) < 1e-3, 1e-3, E)
    I = frame.I / known.mva
    none = np.zeros(E.shape)
    if not power:
        return Measured(frame, ZI, E, I, none, none, none)
    variance = power_variance(frame.V * I.conj(), **noise)
    parts = frame.parts
    if parts is None:
        return Measured(frame, ZI, E, I, (E * I.conj()).real, variance, none)
    of_power = computed_power_variance(parts.V, parts.I, (frame.V, frame.I), **noise) / known.mva**2
    of_current = computed_current_variance(parts.I, **noise) / known.mva**2
    variance = np.where(parts.computed, of_power, variance)
    return Measured(frame, ZI, E, I, (E * I.conj()).real, variance, of_current * parts.computed)
