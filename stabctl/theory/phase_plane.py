"""The phase plane after clearing: the energy function (10), and the stability region inside the separatrix (Figure 3).

    U = M omega^2 / 2  -  Pm (delta - delta_s)  -  Pmax (cos delta - cos delta_s)

with M, Pm, Pmax as in omib.py and the stable equilibrium delta_s. The paper's (8) and (9) omit the constant of
integration that (10) has. On the separatrix, U is that of the unstable equilibrium.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb

from .omib import OMIB, ClearingState, SwingCurve, swing_curve, table1

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Separatrix(Tabular):
    """The boundary of the stability region: its upper half as arrays (n,); the lower half has negative speed."""

    angle: NDArray[np.float64]  # rad, from the left end to the unstable equilibrium
    speed: NDArray[np.float64]  # rad/s, not negative

    @property
    def df(self) -> "pd.DataFrame":
        """The upper half of the boundary."""
        import pandas as pd

        return pd.DataFrame({"angle_rad": self.angle, "speed_rad_s": self.speed})

    def __str__(self) -> str:
        return (
            f"stability region from {self.angle[0]:.4f} to {self.angle[-1]:.4f} rad, up to {self.speed.max():.4f} rad/s"
        )


@dataclass(frozen=True, repr=False)
class PhasePortrait(Tabular):
    """Figure 3: the separatrix, and faults of several durations."""

    start: float  # rad
    separatrix: Separatrix
    cleared: tuple[ClearingState, ...]
    curves: tuple[SwingCurve, ...]

    plot = verb("stabctl.view.figures.one_machine:plot_phase_plane")

    @property
    def df(self) -> "pd.DataFrame":
        """A row per fault: the state at clearing, and whether the machine keeps synchronism."""
        import pandas as pd

        pairs = zip(self.cleared, self.curves, strict=True)
        rows = [(state.cycles, state.angle, state.speed, curve.stable) for state, curve in pairs]
        return pd.DataFrame(rows, columns=["cycles", "angle_rad", "speed_rad_s", "stable"])

    def __str__(self) -> str:
        pairs = zip(self.cleared, self.curves, strict=True)
        verdicts = (f"{state}, {'stable' if curve.stable else 'unstable'}" for state, curve in pairs)
        return "\n".join((str(self.separatrix), *verdicts))


def portrait(m: OMIB, cycles: tuple[float, ...] = (6, 12, 15), after: float = 1.5) -> PhasePortrait:
    """Figure 3: faults of so many cycles, simulated to `after` (s) after clearing."""
    curves = tuple(swing_curve(m, m.seconds(n), until=m.seconds(n) + after) for n in cycles)
    return PhasePortrait(m.start, separatrix(m), table1(m, cycles), curves)


def separatrix(m: OMIB, n: int = 401) -> Separatrix:
    """The curve of energy (10) equal to that at the unstable equilibrium, `n` points."""
    top = critical_energy(m)
    left = brentq(lambda d: float(potential(m, d)) - top, m.unstable - 2 * np.pi, m.stable, xtol=1e-14)
    middle, half = (left + m.unstable) / 2, (m.unstable - left) / 2
    angle = middle - half * np.cos(np.linspace(0, np.pi, n))
    return Separatrix(angle, np.sqrt(np.maximum(2 / m.M * (top - potential(m, angle)), 0)))


def inside(m: OMIB, angle: ArrayLike, speed: ArrayLike) -> NDArray[np.bool_]:
    """Whether states (rad, rad/s, broadcast against each other) after clearing lie in the stability region.

    Only the region around the stable equilibrium is considered, not its copies at multiples of 2 pi.
    """
    between = (np.asarray(angle) < m.unstable) & (np.asarray(angle) > separatrix(m, 2).angle[0])
    return between & (energy(m, angle, speed) < critical_energy(m))


def energy(m: OMIB, angle: ArrayLike, speed: ArrayLike) -> NDArray[np.float64]:
    """Energy (10), pu rad; `angle` in rad and `speed` in rad/s, broadcast against each other."""
    return m.M / 2 * np.square(speed) + potential(m, angle)


def potential(m: OMIB, angle: ArrayLike) -> NDArray[np.float64]:
    """Potential energy (6) relative to the stable equilibrium, pu rad; `angle` in rad, any shape."""
    return -m.Pm * (np.asarray(angle) - m.stable) - m.Pmax_post * (np.cos(angle) - np.cos(m.stable))


def critical_energy(m: OMIB) -> float:
    """Energy at the unstable equilibrium, pu rad: the most that the network can absorb."""
    return float(potential(m, m.unstable))
