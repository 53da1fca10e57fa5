"""A fault and what follows, in time: the machine of omib.py with a device that absorbs P_C after clearing (12)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import OptimizeResult

from stabctl.errors import StudyError

from .omib import OMIB, TIGHT

EXTREME, REST, LIMIT = 0, 1, 2  # the events of a run

Law = Callable[[float, int, float], float]
"""P_C (pu) from the speed (rad/s), the side of zero it is on (+1 or -1), and Pm - Pe (pu).

The side is given apart from the speed because a law may jump where the speed is zero.
"""


def idle(_speed: float, _side: int, _Pa: float) -> float:
    """No device: P_C = 0."""
    return 0.0


def against_speed(power: float) -> Law:
    """Bang-bang without deadband (39): absorb `power` (pu) while the machine is fast, inject it while it is slow."""
    return lambda _speed, side, _Pa: side * power


@dataclass(frozen=True)
class Trajectory:
    """A simulated fault: arrays of one length (n,) from its start to the end of the simulation."""

    t: NDArray[np.float64]  # s
    angle: NDArray[np.float64]  # rad
    speed: NDArray[np.float64]  # rad/s
    acceleration: NDArray[np.float64]  # rad/s^2
    power: NDArray[np.float64]  # pu, absorbed by the device
    clearing: float  # s
    lost: float  # s when the unstable equilibrium is passed, forwards or one turn behind; inf where it never is
    rests: tuple[tuple[float, float], ...]  # (s, rad) where the speed is zero after clearing

    @property
    def stable(self) -> bool:
        """Never passes an unstable equilibrium."""
        return self.lost == np.inf

    def __str__(self) -> str:
        fate = "keeps synchronism" if self.stable else f"loses synchronism at {self.lost:.3f} s"
        return f"fault cleared at {self.clearing:.4f} s: {fate}, angle up to {self.angle.max():.4f} rad"


def simulate(m: OMIB, clearing: float, law: Law = idle, until: float = 5.0, decide: bool = False) -> Trajectory:
    """Simulate (1)-(4) and (12) from the start of a fault cleared at `clearing` (s) up to `until` (s).

    With `decide` the run ends at the first rest after clearing or at the unstable equilibrium, whichever is first.
    Where both sides of a law that jumps at zero speed push back to it, the machine is held there.
    Raises StudyError where the times are not 0 < clearing < until.
    """
    if not 0 < clearing < until < np.inf:
        raise StudyError(f"the fault must be cleared after 0 and before {until:g} s, not at {clearing:g} s")
    pieces, run = _advance(m, m.Pmax_fault, idle, 1, (0.0, clearing), (m.start, 0.0))
    rests: list[tuple[float, float]] = []
    parts, side = [pieces], 1 if run.y[1, -1] >= 0 else -1
    lost = run.t_events[LIMIT]
    while (t := run.t[-1]) < until and not (decide and lost.size):
        y = run.y[:, -1]
        pieces, run = _advance(m, m.Pmax_post, law, side, (t, until), y, to_rest=True, to_limit=decide)
        parts.append(pieces)
        lost = np.append(lost, run.t_events[LIMIT])
        if run.t_events[REST].size == 0:
            break
        t, rest = float(run.t[-1]), float(run.y[0, -1])
        rests.append((t, rest))
        if abs(rest - m.unstable + np.pi) > np.pi:  # there and back within one step leaves no event
            lost = np.append(lost, t)
        forward, backward = (_acceleration(m, m.Pmax_post, law, s, rest, 0.0)[0] for s in (1, -1))
        if decide or forward <= 0 <= backward:
            break
        side = -side if (backward < 0 if side > 0 else forward > 0) else side
    rows = np.hstack(parts)
    if rests and not decide and rows[0, -1] == rests[-1][0] < until:
        rows = np.column_stack([rows, (until, rest, 0.0, 0.0, m.Pm - m.Pmax_post * np.sin(rest))])
    return Trajectory(*rows, clearing, min(lost, default=np.inf), tuple(rests))


def _acceleration(m: OMIB, Pmax: float, law: Law, side: int, angle: float, speed: float) -> tuple[float, float]:
    """Acceleration (rad/s^2) and P_C (pu)."""
    Pa = m.Pm - Pmax * np.sin(angle)
    power = law(speed, side, Pa)
    return (Pa - power) / m.M, power


def _advance(
    m: OMIB,
    Pmax: float,
    law: Law,
    side: int,
    span: tuple[float, float],
    y: ArrayLike,
    to_rest: bool = False,
    to_limit: bool = False,
) -> tuple[NDArray[np.float64], OptimizeResult]:
    """Integrate over `span` on one side of zero speed; rows (5, n) of the trajectory and the run itself."""

    def rates(_t: float, y: NDArray[np.float64]) -> tuple[float, float]:
        return y[1], _acceleration(m, Pmax, law, side, y[0], y[1])[0]

    def extreme(_t: float, y: NDArray[np.float64]) -> float:
        return _acceleration(m, Pmax, law, side, y[0], y[1])[0]

    def rest(_t: float, y: NDArray[np.float64]) -> float:
        return y[1]

    def limit(_t: float, y: NDArray[np.float64]) -> float:
        return (m.unstable - y[0]) * (y[0] - m.unstable + 2 * np.pi)

    rest.terminal, rest.direction, limit.terminal = to_rest, -side, to_limit
    step = 0.2 * np.sqrt(m.M / m.Pmax_post)
    run = solve_ivp(rates, span, y, events=(extreme, rest, limit), dense_output=True, max_step=step, **TIGHT)
    even = np.linspace(*run.t[[0, -1]], 2 + int(20 * (run.t[-1] - run.t[0]) / step))
    t = run.t if to_limit else np.union1d(np.union1d(even, run.t), run.t_events[EXTREME])
    angle, speed = run.sol(t)
    if run.t_events[REST].size and to_rest:
        speed[-1] = run.y[1, -1] = 0.0
    acceleration, power = np.transpose(
        [_acceleration(m, Pmax, law, side, a, w) for a, w in zip(angle, speed, strict=True)]
    )
    return np.vstack([t, angle, speed, acceleration, power]), run
