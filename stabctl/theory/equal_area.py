"""The equal-area criterion (11), (12): critical angle and time, with and without a constant absorbed power.

A device that absorbs P_C from clearing on adds P_C to the decelerating power. It must bring the machine to rest
before the unstable equilibrium of the network *without* it, from where the machine returns when the device lets go.

    A1 = integral of  Pm - Pfault sin d        from start to clearing
    A2 = integral of  Pmax sin d + P_C - Pm    from clearing to the unstable equilibrium
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq

from stabctl.errors import StudyError

from .omib import OMIB
from .trajectory import against_speed, simulate


@dataclass(frozen=True)
class Critical:
    """The longest fault that is survived."""

    angle: float  # rad
    time: float  # s
    cycles: float
    absorbed: float  # pu, P_C

    def __str__(self) -> str:
        return f"critical clearing at {self.angle:.6f} rad, {self.time:.6f} s ({self.cycles:.3f} cycles)"


@dataclass(frozen=True)
class EqualArea:
    """The power-angle picture of one clearing angle (Figures 4, 5a, 9); curves are arrays (n,)."""

    Pm: float  # pu
    absorbed: float  # pu, P_C
    start: float  # rad
    clearing: float  # rad
    stop: float  # rad where the machine rests, or the unstable equilibrium where it does not
    unstable: float  # rad
    A1: float  # pu rad
    A2: float  # pu rad, from clearing to stop
    angle: NDArray[np.float64]  # rad
    Pe_fault: NDArray[np.float64]  # pu
    Pe: NDArray[np.float64]  # pu, after clearing

    @property
    def stable(self) -> bool:
        """The decelerating area can match the accelerating one."""
        return self.A2 >= self.A1 * (1 - 1e-12)

    def __str__(self) -> str:
        fate = f"rests at {self.stop:.4f} rad" if self.stable else "is lost: A2 is too small"
        return f"cleared at {self.clearing:.4f} rad: A1 = {self.A1:.4f}, A2 = {self.A2:.4f} pu rad, the machine {fate}"


def accelerating(m: OMIB, clearing: float) -> float:
    """Area A1 (11) up to the clearing angle (rad), pu rad: the kinetic energy gained in the fault."""
    return m.Pm * (clearing - m.start) + m.Pmax_fault * (math.cos(clearing) - math.cos(m.start))


def decelerating(m: OMIB, clearing: float, stop: float, absorbed: float = 0.0) -> float:
    """Area A2 (12) from the clearing to the stop angle (rad) with P_C = `absorbed` (pu), pu rad, counted positive."""
    return m.Pmax_post * (math.cos(clearing) - math.cos(stop)) + (absorbed - m.Pm) * (stop - clearing)


def critical(m: OMIB, absorbed: float = 0.0) -> Critical:
    """Critical clearing angle and time with P_C = `absorbed` (pu) after clearing.

    Without P_C the angle has a closed form; with it, A1 = A2 is one equation in the angle. The time is closed for a
    bolted fault and otherwise the integral of d(delta)/omega along the fault. Raises StudyError where no clearing
    time is critical, or where even a fault cleared at once is lost.
    """
    _check_absorbed(absorbed)

    def short(angle: float) -> float:
        return accelerating(m, angle) - decelerating(m, angle, m.unstable, absorbed)

    if short(m.start) >= 0:
        raise StudyError("the machine is lost even when the fault is cleared at once: lower Pm or Xpost")
    if short(m.unstable) <= 0:
        raise StudyError("no clearing time is critical: the machine can stay in the fault for ever")
    if absorbed == 0:
        crests = m.Pmax_post * math.cos(m.unstable) - m.Pmax_fault * math.cos(m.start)
        angle = math.acos((m.Pm * (m.unstable - m.start) + crests) / (m.Pmax_post - m.Pmax_fault))
    else:
        angle = brentq(short, m.start, m.unstable, xtol=1e-14)
    time = _time_in_fault(m, angle)
    return Critical(angle, time, time * m.fb, absorbed)


def equal_area(m: OMIB, clearing: float, absorbed: float = 0.0) -> EqualArea:
    """The areas of a fault cleared at an angle (rad) with P_C = `absorbed` (pu) after clearing.

    Raises StudyError where the angle is not between the start and the unstable equilibrium.
    """
    _check_absorbed(absorbed)
    if not m.start <= clearing < m.unstable:
        raise StudyError(
            f"the clearing angle {clearing:g} rad must be from {m.start:.4f} to below {m.unstable:.4f} rad"
        )

    def missing(stop: float) -> float:
        return accelerating(m, clearing) - decelerating(m, clearing, stop, absorbed)

    lost = missing(m.unstable) > 0
    stop = m.unstable if lost else brentq(missing, max(clearing, m.stable), m.unstable, xtol=1e-14)
    d = np.union1d(np.linspace(0, math.pi, 361), [m.start, clearing, stop, m.unstable])
    Pe = m.Pmax_post * np.sin(d)
    areas = accelerating(m, clearing), decelerating(m, clearing, stop, absorbed)
    return EqualArea(m.Pm, absorbed, m.start, clearing, stop, m.unstable, *areas, d, m.Pmax_fault * np.sin(d), Pe)


def simulated_critical_time(m: OMIB, absorbed: float = 0.0, resolution: float = 1e-9) -> float:
    """The critical time (s) by bisection on simulations, to the relative `resolution`; a check of `critical`."""
    _check_absorbed(absorbed)
    law, unit = against_speed(absorbed), math.sqrt(m.M / m.Pmax_post)

    def survives(t: float) -> bool:
        return simulate(m, t, law, t + 1e3 * unit, decide=True).stable

    low, high = 0.0, unit
    while survives(high):
        low, high = high, 2 * high
        if high > 1e4 * unit:
            raise StudyError("no clearing time is critical: the machine can stay in the fault for ever")
    while high - low > resolution * high:
        middle = (low + high) / 2
        low, high = (middle, high) if survives(middle) else (low, middle)
    return (low + high) / 2


def _check_absorbed(power: float) -> None:
    if not 0 <= power < math.inf:
        raise StudyError(f"the absorbed power P_C = {power:g} pu must be a finite number, at least 0")


def _time_in_fault(m: OMIB, angle: float) -> float:
    """Time (s) from the start of the fault to `angle` (rad)."""
    if m.Xfault is None:
        return math.sqrt(2 * m.M * (angle - m.start) / m.Pm)
    turn = math.pi - math.asin(m.Pm / m.Pmax_fault) if m.Pmax_fault > m.Pm else angle
    if accelerating(m, min(angle, turn)) <= 0 or accelerating(m, angle) <= 0:
        raise StudyError("no clearing time is critical: the machine can stay in the fault for ever")

    def rate(z: float) -> float:  # d = start + z^2 takes away the root at the start, where the speed is zero
        if z == 0:
            return math.sqrt(2 * m.M / (m.Pm - m.Pmax_fault * math.sin(m.start)))
        # the area without its cancelling cosines
        area = m.Pm * z**2 - 2 * m.Pmax_fault * math.sin(m.start + z**2 / 2) * math.sin(z**2 / 2)
        return 2 * z / math.sqrt(2 / m.M * area)

    return quad(rate, 0, math.sqrt(angle - m.start), epsabs=1e-13, epsrel=1e-12, limit=200)[0]
