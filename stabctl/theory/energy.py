"""The energy function (10) of the network after clearing; M, Pm, Pmax as in omib.py.

    U = M omega^2 / 2  -  Pm (delta - delta_s)  -  Pmax (cos delta - cos delta_s)

The paper's (8) and (9) omit the constant of integration that (10) has.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .omib import OMIB


def potential(m: OMIB, angle: ArrayLike) -> NDArray[np.float64]:
    """Potential energy (6) relative to the stable equilibrium, pu rad; `angle` in rad, any shape."""
    return -m.Pm * (np.asarray(angle) - m.stable) - m.Pmax_post * (np.cos(angle) - np.cos(m.stable))


def energy(m: OMIB, angle: ArrayLike, speed: ArrayLike) -> NDArray[np.float64]:
    """Energy (10), pu rad; `angle` in rad and `speed` in rad/s, broadcast against each other."""
    return m.M / 2 * np.square(speed) + potential(m, angle)


def critical_energy(m: OMIB) -> float:
    """Energy at the unstable equilibrium, pu rad: the most that the network can absorb."""
    return float(potential(m, m.unstable))
