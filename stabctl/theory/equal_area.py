"""The equal-area criterion (11), (12): critical angle and time, with and without a constant absorbed power.

A device that absorbs P_C after clearing adds P_C to the decelerating power. It must stop the machine before the
unstable equilibrium of the network *without* it, because the device switches off when the machine is at rest.

    A1 = integral of  Pm - Pe of the fault     from start to clearing
    A2 = integral of  Pmax sin d + P_C - Pm    from clearing to the unstable equilibrium
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import bisect, brentq

from stabctl._util.errors import StudyError
from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb

from .omib import OMIB, against_speed, swing_curve

if TYPE_CHECKING:
    import pandas as pd

ALWAYS_STABLE = "The machine stays in synchronism however long the fault lasts, so there is no critical clearing time."


@dataclass(frozen=True)
class CriticalClearing:
    """The longest fault that the machine survives."""

    angle: float  # rad
    time: float  # s
    cycles: float
    absorbed: float  # pu, P_C

    def __str__(self) -> str:
        return f"critical clearing at {self.angle:.6f} rad, {self.time:.6f} s ({self.cycles:.3f} cycles)"


@dataclass(frozen=True, repr=False)
class EqualArea(Tabular):
    """The power-angle curves and areas of one clearing angle (Figures 4, 5a, 9); curves are arrays (n,)."""

    Pm: float  # pu
    absorbed: float  # pu, P_C
    start: float  # rad
    clearing: float  # rad
    stop: float  # rad   where the machine stops; the unstable equilibrium if it does not
    unstable: float  # rad
    A1: float  # pu rad
    A2: float  # pu rad, from clearing to stop
    angle: NDArray[np.float64]  # rad
    Pe_fault: NDArray[np.float64]  # pu
    Pe: NDArray[np.float64]  # pu, after clearing

    plot = verb("stabctl.view.figures.one_machine:plot_equal_area")

    @property
    def df(self) -> "pd.DataFrame":
        """The power-angle curves during and after the fault, with and without P_C."""
        import pandas as pd

        curves = {"pe_fault_pu": self.Pe_fault, "pe_pu": self.Pe, "pe_with_pc_pu": self.Pe + self.absorbed}
        return pd.DataFrame({"angle_rad": self.angle} | curves)

    @property
    def stable(self) -> bool:
        """A2 is at least as large as A1."""
        return self.A2 >= self.A1 * (1 - 1e-12)

    def __str__(self) -> str:
        stop, clearing = math.degrees(self.stop), math.degrees(self.clearing)
        result = f"stops at {stop:.1f} degrees" if self.stable else "loses synchronism because A2 is too small"
        return (
            f"Cleared at {clearing:.1f} degrees: A1 = {self.A1:.4f}, A2 = {self.A2:.4f} pu rad; the machine {result}."
        )


def accelerating(m: OMIB, clearing: float) -> float:
    """Area A1 (11) up to the clearing angle (rad), pu rad: the kinetic energy gained in the fault."""
    return m.driving * (clearing - m.start) + m.Pmax_fault * (math.cos(clearing) - math.cos(m.start))


def decelerating(m: OMIB, clearing: float, stop: float, absorbed: float = 0.0) -> float:
    """Area A2 (12) from the clearing to the stop angle (rad) with P_C = `absorbed` (pu), pu rad, positive."""
    return m.Pmax_post * (math.cos(clearing) - math.cos(stop)) + (absorbed - m.Pm) * (stop - clearing)


def critical_clearing(m: OMIB, absorbed: float = 0.0) -> CriticalClearing:
    """The critical clearing angle and time.

    A1 = A2 is one equation in the angle. The time has a closed form for a bolted fault; otherwise it is the integral of
    d(delta)/omega during the fault.

    Parameters
    ----------
    m : OMIB
        The machine.
    absorbed : float, pu
        P_C after clearing.

    Raises
    ------
    StudyError
        If there is no critical clearing time, or the machine loses synchronism even if the fault is cleared at once.
    """
    _check_absorbed(absorbed)

    def excess(angle: float) -> float:
        return accelerating(m, angle) - decelerating(m, angle, m.unstable, absorbed)

    if excess(m.start) >= 0:
        raise StudyError("The machine loses synchronism even if the fault is cleared at once; lower Pm or Xpost.")
    if excess(m.unstable) <= 0:
        raise StudyError(ALWAYS_STABLE)
    angle = brentq(excess, m.start, m.unstable, xtol=1e-14)
    time = _time_in_fault(m, angle)
    return CriticalClearing(angle, time, time * m.fb, absorbed)


def equal_area(m: OMIB, clearing: float, absorbed: float = 0.0) -> EqualArea:
    """The areas of a fault cleared at an angle (rad) with P_C = `absorbed` (pu) after clearing.

    Raises StudyError unless the angle is between the start and the unstable equilibrium and reached during the fault.
    """
    _check_absorbed(absorbed)
    if not m.start <= clearing < m.unstable:
        raise StudyError(
            f"The clearing angle {clearing:g} rad is not possible; it must be at least {m.start:.4f} and below "
            f"{m.unstable:.4f} rad."
        )
    if _least_area(m, clearing) < 0:
        raise StudyError(
            f"The machine does not reach {clearing:g} rad during the fault; choose a smaller clearing angle."
        )

    def excess(stop: float) -> float:
        return accelerating(m, clearing) - decelerating(m, clearing, stop, absorbed)

    lost = excess(m.unstable) > 0
    slowing = math.asin(max(m.Pm - absorbed, 0.0) / m.Pmax_post)  # from this angle on, the machine decelerates
    stop = m.unstable if lost else brentq(excess, max(clearing, slowing), m.unstable, xtol=1e-14)
    d = np.union1d(np.linspace(0, math.pi, 361), [m.start, clearing, stop, m.unstable])
    Pe = m.Pmax_post * np.sin(d)
    areas = accelerating(m, clearing), decelerating(m, clearing, stop, absorbed)
    Pe_fault = m.Pfault + m.Pmax_fault * np.sin(d)
    return EqualArea(m.Pm, absorbed, m.start, clearing, stop, m.unstable, *areas, d, Pe_fault, Pe)


def simulated_critical_time(m: OMIB, absorbed: float = 0.0, resolution: float = 1e-9) -> float:
    """The critical time (s) by bisection with simulations, to the relative `resolution`; a check of the criterion."""
    _check_absorbed(absorbed)
    law, unit = against_speed(absorbed), math.sqrt(m.M / m.Pmax_post)

    def verdict(t: float) -> float:
        return 1.0 if t == 0 or swing_curve(m, t, law, until=t + 1e3 * unit, decide=True).stable else -1.0

    low, high = 0.0, unit
    while verdict(high) > 0:
        low, high = high, 2 * high
        if high > 1e4 * unit:
            raise StudyError(ALWAYS_STABLE)
    return float(bisect(verdict, low, high, xtol=resolution * high / 4, rtol=resolution / 4))


def _check_absorbed(power: float) -> None:
    if not 0 <= power < math.inf:
        raise StudyError(f"The absorbed power P_C = {power:g} pu is not allowed; it must be finite and at least 0.")


def _least_area(m: OMIB, angle: float) -> float:
    """The least A1 at `angle` (rad) and where the fault decelerates before it; below 0, the machine returns earlier."""
    turn = math.pi - math.asin(m.driving / m.Pmax_fault) if m.Pmax_fault > m.driving else angle
    return min(accelerating(m, min(angle, turn)), accelerating(m, angle))


def _time_in_fault(m: OMIB, angle: float) -> float:
    """Time (s) from the start of the fault to `angle` (rad)."""
    if m.Xfault is None:
        return math.sqrt(2 * m.M * (angle - m.start) / m.driving)
    if _least_area(m, angle) <= 0:
        raise StudyError(ALWAYS_STABLE)

    def integrand(z: float) -> float:  # d = start + z^2 removes the singularity at the start, where the speed is zero
        if z == 0:
            return math.sqrt(2 * m.M / (m.driving - m.Pmax_fault * math.sin(m.start)))
        # A1 written without a difference of cosines, which would cancel
        area = m.driving * z**2 - 2 * m.Pmax_fault * math.sin(m.start + z**2 / 2) * math.sin(z**2 / 2)
        return 2 * z / math.sqrt(2 / m.M * area)

    return quad(integrand, 0, math.sqrt(angle - m.start), epsabs=1e-13, epsrel=1e-12, limit=200)[0]
