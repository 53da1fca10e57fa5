"""One machine on an infinite bus: the swing equation (1)-(4), a fault (Table 1), and the swing curve after it (12).

    V1 ---- X (pre-fault), Xfault, Xpost ---- V0 = infinite bus        Pe = Pmax sin(delta)
    2H/wb delta'' = Pm - Pe - P_C

delta is the rotor angle in rad, omega its rate in rad/s; powers are in pu on one base. P_C is the power that a device
absorbs after clearing.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import OptimizeResult

from stabctl._util.errors import StudyError
from stabctl._util.tabular import Tabular
from stabctl._util.validation import guard
from stabctl._util.verbs import verb

if TYPE_CHECKING:
    import pandas as pd


# Values outside these ranges are probably mistyped and would take hours to integrate.
INERTIA = Interval(ge=0.01, le=1e6)
POWER = Interval(ge=1e-6, le=1e3)
REACTANCE = Interval(ge=1e-4, le=1e3)
VOLTAGE = Interval(ge=0.1, le=2.0)
FREQUENCY = Interval(ge=1.0, le=1e3)
LONGEST = 60.0  # s   longest fault
TIGHT: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
EXTREME, REST, LIMIT = 0, 1, 2  # solve_ivp events: zero acceleration, zero speed, unstable equilibrium


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
        Reactance during the fault; without it the fault is bolted.
    fb : float, Hz
        Base frequency.
    Pfault : float, pu
        Part of Pe during the fault that does not depend on the angle.

    Raises
    ------
    StudyError
        If a value is out of range, Pm has no equilibrium before or after the fault, or Pfault is not below Pm.
    """

    H: Annotated[float, "s", "inertia constant", INERTIA] = 3.0
    Pm: Annotated[float, "pu", "mechanical power", POWER] = 0.5
    X: Annotated[float, "pu", "reactance between the two voltages", REACTANCE] = 0.95
    V0: Annotated[float, "pu", "voltage of the infinite bus", VOLTAGE] = 1.0
    V1: Annotated[float, "pu", "voltage of the machine", VOLTAGE] = 1.0
    Xpost: Annotated[float | None, "pu", "reactance after clearing, X if omitted", REACTANCE] = None
    Xfault: Annotated[float | None, "pu", "reactance during the fault, bolted if omitted", REACTANCE] = None
    fb: Annotated[float, "Hz", "base frequency", FREQUENCY] = 60.0
    Pfault: Annotated[float, "pu", "constant part of Pe during the fault"] = 0.0

    def __post_init__(self) -> None:
        guard(self)
        if self.Pfault >= self.Pm:
            raise StudyError(f"Pfault = {self.Pfault:g} pu leaves nothing to accelerate; choose it below Pm.")
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
    def driving(self) -> float:
        """Accelerating power of a bolted fault, pu."""
        return self.Pm - self.Pfault

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


def table1(m: OMIB, cycles: tuple[float, ...] = (6, 12, 15)) -> tuple[ClearingState, ...]:
    """Table 1: angle and speed at the clearing of faults of so many cycles.

    The paper's speeds are 0.14 % below wb Pm/(2H) t, the exact speed of a bolted fault.
    """
    return tuple(ClearingState(n, *during_fault(m, m.seconds(n))) for n in cycles)


def during_fault(m: OMIB, t: float) -> tuple[float, float]:
    """Angle (rad) and speed (rad/s) after a fault of t seconds: (1)-(3) with the network during the fault."""
    if not 0 <= t <= LONGEST:
        raise StudyError(f"A fault of {t:g} s is not possible; give a duration from 0 to {LONGEST:g} s.")
    if m.Xfault is None:
        return bolted_fault(m, t)
    if t == 0:
        return m.start, 0.0
    y = solve_ivp(lambda _, y: (y[1], (m.driving - m.Pmax_fault * np.sin(y[0])) / m.M), (0, t), (m.start, 0), **TIGHT).y
    return float(y[0, -1]), float(y[1, -1])


def bolted_fault(m: OMIB, t: float) -> tuple[float, float]:
    """Angle (rad) and speed (rad/s) after a bolted fault of t seconds: constant acceleration."""
    return m.start + m.driving / m.M * t * t / 2, m.driving / m.M * t


PowerLaw = Callable[[float, int, float], float]
"""P_C (pu) as a function of the speed (rad/s), its sign (+1 or -1), and Pm - Pe (pu).

The sign is a separate argument because a law may jump at zero speed.
"""


@dataclass(frozen=True, repr=False)
class SwingCurve(Tabular):
    """A simulated fault: arrays (n,) from the start of the fault to the end of the simulation."""

    t: NDArray[np.float64]  # s
    angle: NDArray[np.float64]  # rad
    speed: NDArray[np.float64]  # rad/s
    acceleration: NDArray[np.float64]  # rad/s^2
    power: NDArray[np.float64]  # pu, absorbed by the device
    clearing: float  # s
    lost: float  # s   when an unstable equilibrium is passed, in either direction; inf if never
    rests: tuple[tuple[float, float], ...]  # (s, rad) at which the speed is zero after clearing

    plot = verb("stabctl.view.figures.one_machine:plot_swing_curve")

    @property
    def df(self) -> "pd.DataFrame":
        """A row per instant."""
        import pandas as pd

        motion = {"angle_rad": self.angle, "speed_rad_s": self.speed, "acceleration_rad_s2": self.acceleration}
        return pd.DataFrame({"time_s": self.t} | motion | {"absorbed_pu": self.power})

    @property
    def stable(self) -> bool:
        """The machine never passes an unstable equilibrium."""
        return self.lost == np.inf

    def __str__(self) -> str:
        result = "keeps synchronism" if self.stable else f"loses synchronism at {self.lost:.3f} s"
        return (
            f"Fault cleared at {self.clearing:.4f} s: the machine {result}; largest angle {self.angle.max():.4f} rad."
        )


def idle(_speed: float, _sign: int, _Pa: float) -> float:
    """No device: P_C = 0."""
    return 0.0


def against_speed(power: float) -> PowerLaw:
    """Bang-bang without deadband (39): absorb `power` (pu) while the machine is fast, inject it while it is slow."""
    return lambda _speed, sign, _Pa: sign * power


def swing_curve(
    m: OMIB, clearing: float, law: PowerLaw = idle, *, until: float = 5.0, decide: bool = False
) -> SwingCurve:
    """Integrate (1)-(4) and (12) from the start of a fault.

    Parameters
    ----------
    m : OMIB
        The machine.
    clearing : float, s
        Duration of the fault.
    law : PowerLaw
        Power absorbed by the device after clearing.
    until : float, s
        End of the simulation.
    decide : bool
        Stop at the first zero of the speed after clearing or at the unstable equilibrium, whichever comes first.

    Returns
    -------
    SwingCurve
        If a law that jumps at zero speed pushes the machine back from both sides, it is held at zero speed.

    Raises
    ------
    StudyError
        Unless 0 < clearing < until.
    """
    if not 0 < clearing < until < np.inf:
        raise StudyError(f"The fault must be cleared after 0 s and before {until:g} s, not at {clearing:g} s.")
    faulted = _Arc(m, m.driving, m.Pmax_fault, idle, 1)
    rows, run = faulted.integrate((0.0, clearing), (m.start, 0.0))
    rests: list[tuple[float, float]] = []
    parts, sign = [rows], 1 if run.y[1, -1] >= 0 else -1
    lost = run.t_events[LIMIT]
    while (t := run.t[-1]) < until and not (decide and lost.size):
        arc = _Arc(m, m.Pm, m.Pmax_post, law, sign)
        rows, run = arc.integrate((t, until), run.y[:, -1], to_rest=True, to_limit=decide)
        parts.append(rows)
        lost = np.append(lost, run.t_events[LIMIT])
        if run.t_events[REST].size == 0:
            break
        t, rest = float(run.t[-1]), float(run.y[0, -1])
        rests.append((t, rest))
        if abs(rest - m.unstable + np.pi) > np.pi:  # passed and returned within one step, which gives no event
            lost = np.append(lost, t)
        forward, backward = (_Arc(m, m.Pm, m.Pmax_post, law, s).acceleration(rest, 0.0)[0] for s in (1, -1))
        if decide or forward <= 0 <= backward:
            break
        sign = -sign if (backward < 0 if sign > 0 else forward > 0) else sign
    rows = np.hstack(parts)
    if rests and not decide and rows[0, -1] == rests[-1][0] < until:
        rows = np.column_stack([rows, (until, rest, 0.0, 0.0, m.Pm - m.Pmax_post * np.sin(rest))])
    t, angle, speed, acceleration, power = rows
    return SwingCurve(t, angle, speed, acceleration, power, clearing, min(lost, default=np.inf), tuple(rests))


@dataclass(frozen=True)
class _Arc:
    """A part of the swing curve with one network and one sign of the speed."""

    m: OMIB
    Pm: float  # pu, less the constant part of Pe
    Pmax: float  # pu
    law: PowerLaw
    sign: int

    def acceleration(self, angle: float, speed: float) -> tuple[float, float]:
        """Acceleration (rad/s^2) and P_C (pu)."""
        Pa = self.Pm - self.Pmax * np.sin(angle)
        power = self.law(speed, self.sign, Pa)
        return (Pa - power) / self.m.M, power

    def integrate(
        self, span: tuple[float, float], y: ArrayLike, *, to_rest: bool = False, to_limit: bool = False
    ) -> tuple[NDArray[np.float64], OptimizeResult]:
        """Rows (5, n) of the swing curve over `span` (s), and the solver's result."""
        unstable = self.m.unstable

        def rates(_t: float, y: NDArray[np.float64]) -> tuple[float, float]:
            return y[1], self.acceleration(*y)[0]

        def extreme(_t: float, y: NDArray[np.float64]) -> float:
            return self.acceleration(*y)[0]

        def rest(_t: float, y: NDArray[np.float64]) -> float:
            return y[1]

        def limit(_t: float, y: NDArray[np.float64]) -> float:
            return (unstable - y[0]) * (y[0] - unstable + 2 * np.pi)

        stops(rest, -self.sign, when=to_rest)
        stops(limit, when=to_limit)
        step = 0.2 * np.sqrt(self.m.M / self.m.Pmax_post)
        run: Any = solve_ivp(
            rates, span, np.asarray(y, float), events=(extreme, rest, limit), dense_output=True, max_step=step, **TIGHT
        )
        even = np.linspace(run.t[0], run.t[-1], 2 + int(20 * (run.t[-1] - run.t[0]) / step))
        t = run.t if to_limit else np.union1d(np.union1d(even, run.t), run.t_events[EXTREME])
        angle, speed = run.sol(t)
        if run.t_events[REST].size and to_rest:
            speed[-1] = run.y[1, -1] = 0.0
        acceleration, power = np.transpose([self.acceleration(*y) for y in zip(angle, speed, strict=True)])
        return np.vstack([t, angle, speed, acceleration, power]), run


def stops(event: Any, direction: float = 0.0, *, when: bool = True) -> None:
    """Let an event of `solve_ivp` end the integration: rising (1), falling (-1) or either (0), if `when`."""
    event.terminal, event.direction = when, direction
