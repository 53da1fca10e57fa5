"""The swing curve of a fault: the machine of omib.py with a device that absorbs P_C after clearing (12)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import OptimizeResult

from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb
from stabctl.errors import StudyError

from .omib import OMIB, TIGHT
from .stops import stops

if TYPE_CHECKING:
    import pandas as pd

EXTREME, REST, LIMIT = 0, 1, 2  # solve_ivp events: zero acceleration, zero speed, unstable equilibrium

PowerLaw = Callable[[float, int, float], float]
"""P_C (pu) as a function of the speed (rad/s), its sign (+1 or -1), and Pm - Pe (pu).

The sign is a separate argument because a law may jump at zero speed.
"""


def idle(_speed: float, _sign: int, _Pa: float) -> float:
    """No device: P_C = 0."""
    return 0.0


def against_speed(power: float) -> PowerLaw:
    """Bang-bang without deadband (39): absorb `power` (pu) while the machine is fast, inject it while it is slow."""
    return lambda _speed, sign, _Pa: sign * power


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

    plot = verb("stabctl.plotting.swing_curve:plot")

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
    faulted = _Arc(m, m.Pmax_fault, idle, 1)
    rows, run = faulted.integrate((0.0, clearing), (m.start, 0.0))
    rests: list[tuple[float, float]] = []
    parts, sign = [rows], 1 if run.y[1, -1] >= 0 else -1
    lost = run.t_events[LIMIT]
    while (t := run.t[-1]) < until and not (decide and lost.size):
        arc = _Arc(m, m.Pmax_post, law, sign)
        rows, run = arc.integrate((t, until), run.y[:, -1], to_rest=True, to_limit=decide)
        parts.append(rows)
        lost = np.append(lost, run.t_events[LIMIT])
        if run.t_events[REST].size == 0:
            break
        t, rest = float(run.t[-1]), float(run.y[0, -1])
        rests.append((t, rest))
        if abs(rest - m.unstable + np.pi) > np.pi:  # passed and returned within one step, which gives no event
            lost = np.append(lost, t)
        forward, backward = (_Arc(m, m.Pmax_post, law, s).acceleration(rest, 0.0)[0] for s in (1, -1))
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
    Pmax: float  # pu
    law: PowerLaw
    sign: int

    def acceleration(self, angle: float, speed: float) -> tuple[float, float]:
        """Acceleration (rad/s^2) and P_C (pu)."""
        Pa = self.m.Pm - self.Pmax * np.sin(angle)
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
