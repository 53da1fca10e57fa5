"""One machine on an infinite bus: the swing equation (1)-(4), a fault, and the state at clearing (Table 1).

    V1 ---- X (pre-fault), Xfault, Xpost ---- V0 = infinite bus        Pe = Pmax sin(delta)
    2H/wb delta'' = Pm - Pe

delta is the rotor angle in rad, omega its rate in rad/s; powers are in pu on one base.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from scipy.integrate import solve_ivp

from stabctl._util.guard import guard
from stabctl.errors import StudyError

# Values outside these ranges are probably mistyped and would take hours to integrate.
INERTIA = Interval(ge=0.01, le=1e6)
POWER = Interval(ge=1e-6, le=1e3)
REACTANCE = Interval(ge=0.01, le=1e3)
VOLTAGE = Interval(ge=0.1, le=2.0)
FREQUENCY = Interval(ge=1.0, le=1e3)

LONGEST = 60.0  # s   longest fault

TIGHT: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}


@dataclass(frozen=True)
class OMIB:
    """A classical machine on an infinite bus.

    Parameters
    ----------
    H : float, s
        Inertia constant.
    Pm : float, pu
        Mechanical power.
    X : float, pu
        Reactance between the two voltages before the fault.
    V0, V1 : float, pu
        Voltages of the infinite bus and of the machine.
    Xpost : float, pu, optional
        Reactance after clearing; `X` by default.
    Xfault : float, pu, optional
        Reactance during the fault; without it the fault is bolted (Pe = 0).
    fb : float, Hz
        Base frequency.

    Raises
    ------
    StudyError
        If a value is out of range, or Pm has no equilibrium before or after the fault.
    """

    H: Annotated[float, "s", "inertia constant", INERTIA] = 3.0
    Pm: Annotated[float, "pu", "mechanical power", POWER] = 0.5
    X: Annotated[float, "pu", "reactance between the two voltages", REACTANCE] = 0.95
    V0: Annotated[float, "pu", "voltage of the infinite bus", VOLTAGE] = 1.0
    V1: Annotated[float, "pu", "voltage of the machine", VOLTAGE] = 1.0
    Xpost: Annotated[float | None, "pu", "reactance after clearing, X if omitted", REACTANCE] = None
    Xfault: Annotated[float | None, "pu", "reactance during the fault, bolted if omitted", REACTANCE] = None
    fb: Annotated[float, "Hz", "base frequency", FREQUENCY] = 60.0

    def __post_init__(self) -> None:
        guard(self)
        for when, Pmax in (("before the fault", self.Pmax), ("after the fault", self.Pmax_post)):
            if self.Pm >= Pmax:
                raise StudyError(f"Pm = {self.Pm:g} pu has no equilibrium {when}; choose Pm below Pmax = {Pmax:g} pu.")

    @property
    def M(self) -> float:
        """Inertia coefficient 2H/wb of (5), in s^2/rad."""
        return 2 * self.H / (2 * math.pi * self.fb)

    @property
    def Pmax(self) -> float:
        """Peak of the power-angle curve before the fault (4), pu."""
        return self.V0 * self.V1 / self.X

    @property
    def Pmax_fault(self) -> float:
        """Peak of the power-angle curve during the fault, pu."""
        return 0.0 if self.Xfault is None else self.V0 * self.V1 / self.Xfault

    @property
    def Pmax_post(self) -> float:
        """Peak of the power-angle curve after clearing, pu."""
        return self.Pmax if self.Xpost is None else self.V0 * self.V1 / self.Xpost

    @property
    def start(self) -> float:
        """Angle before the fault, rad."""
        return math.asin(self.Pm / self.Pmax)

    @property
    def stable(self) -> float:
        """Stable equilibrium after clearing, rad."""
        return math.asin(self.Pm / self.Pmax_post)

    @property
    def unstable(self) -> float:
        """Unstable equilibrium after clearing, rad."""
        return math.pi - self.stable

    def seconds(self, cycles: float) -> float:
        """Cycles in seconds."""
        return cycles / self.fb


@dataclass(frozen=True)
class ClearingState:
    """A row of Table 1: the state when a fault of so many cycles is cleared."""

    cycles: float
    angle: float  # rad
    speed: float  # rad/s

    def __str__(self) -> str:
        return f"{self.cycles:g} cycles: {self.angle:.4f} rad, {self.speed:.4f} rad/s"


def bolted_fault(m: OMIB, t: float) -> tuple[float, float]:
    """Angle (rad) and speed (rad/s) after a bolted fault of t seconds: constant acceleration Pm/M."""
    return m.start + m.Pm / m.M * t * t / 2, m.Pm / m.M * t


def during_fault(m: OMIB, t: float) -> tuple[float, float]:
    """Angle (rad) and speed (rad/s) after a fault of t seconds: (1)-(3) with the network during the fault."""
    if not 0 <= t <= LONGEST:
        raise StudyError(f"A fault of {t:g} s is not possible; give a duration from 0 to {LONGEST:g} s.")
    if m.Xfault is None:
        return bolted_fault(m, t)
    if t == 0:
        return m.start, 0.0
    y = solve_ivp(lambda _, y: (y[1], (m.Pm - m.Pmax_fault * np.sin(y[0])) / m.M), (0, t), (m.start, 0), **TIGHT).y
    return float(y[0, -1]), float(y[1, -1])


def table1(m: OMIB, cycles: tuple[float, ...] = (6, 12, 15)) -> tuple[ClearingState, ...]:
    """Table 1: angle and speed at the clearing of faults of so many cycles.

    The paper's speeds are 0.14 % below wb Pm/(2H) t, the exact speed of a bolted fault.
    """
    return tuple(ClearingState(n, *during_fault(m, m.seconds(n))) for n in cycles)
