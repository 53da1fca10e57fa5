"""Minimum time by shooting backwards from the end.

The end angle alone determines the end state (x2 = lambda1 = 0, and H = 0 scales the co-states), so the extremals form a
one-parameter family; the method finds the one that passes through the state at clearing. If an extremal would end
beyond the limit angle, the family continues with lambda1 >= 0 at the limit. Of several extremals the shortest is taken.
"""

import math
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from stabctl.errors import StudyError

from .minimum_time import TIGHT, Arcs, Array, MinimumTime, MinimumTimeProblem, infeasible, rates, solution, stop_angle
from .stops import stops


def by_shooting(p: MinimumTimeProblem) -> MinimumTime:
    """Minimum time by shooting.

    Raises StudyError if no extremal is found although a control exists, which only rounding at the limit can cause.
    """
    nearest = stop_angle(p)
    if math.isnan(nearest):
        return infeasible(p)
    if p.x2 < 0:
        return by_shooting(p.mirrored()).mirrored()

    first = nearest - 1e-6 * (nearest - p.x1)  # slightly too close, so that the errors change sign

    def end(s: float) -> Array:  # 0 <= s <= 1 moves the end angle; 1 <= s <= 2 raises lambda1 at the limit
        x1 = first + min(s, 1 - 1e-9) * (p.limit - first)
        slope = math.pi / 2 * max(s - 1, 0.0)
        scale = math.sqrt(p.Pmax / p.M)
        return np.array([x1, 0.0, scale * math.sin(slope), math.cos(slope)])

    def error(s: float) -> float:
        return float(_backward(p, end(s))[-1][1][1, -1]) - p.x2

    grid = np.concatenate([np.linspace(0, 1, 33), np.linspace(1, 2, 9)[1:]])
    errors = [error(s) for s in grid]
    pairs = zip(pairwise(grid), pairwise(errors), strict=True)
    found = [brentq(error, *ends, xtol=1e-15) for ends, (low, high) in pairs if low * high <= 0]
    if not found:
        raise StudyError(
            f"Shooting found no control that stops the machine before {p.limit:.4f} rad; change the state at clearing "
            "slightly."
        )
    T, s = min((_backward(p, end(s))[-1][0][-1], s) for s in found)
    arcs = _backward(p, end(s), T / 200)
    return solution(p, [(T - t[::-1], y[:, ::-1], Pc) for t, y, Pc in arcs[::-1]])


def _backward(p: MinimumTimeProblem, end: Array, step: float = math.inf) -> Arcs:
    """The extremal that ends in `end`, as arcs back to the angle at clearing; their times (s) count from the end."""

    def angle(_t: float, y: Array) -> float:
        return y[0] - p.x1

    def rest(_t: float, y: Array) -> float:
        return y[1]

    def switch(_t: float, y: Array) -> float:
        return y[3]

    stops(angle)
    stops(rest, -1)
    stops(switch, -1)
    longest = 100 * math.sqrt(p.M / p.Pmax)
    arcs, t, y = [], 0.0, end
    options: dict[str, Any] = {"max_step": step, "dense_output": True, **TIGHT}
    for Pc, events in ((p.Pc_max, (angle, rest, switch)), (p.Pc_min, (angle, rest))):
        run: Any = solve_ivp(lambda _, y, Pc=Pc: -rates(p, y, Pc), (t, longest), y, events=events, **options)
        times, path = run.t, run.y
        if run.t_events[0].size == 0 and path[0, -1] < p.x1:  # the angle was passed twice within the last step
            t = brentq(lambda t, run=run: run.sol(t)[0] - p.x1, times[-2], times[-1], xtol=1e-15)
            times, path = np.append(times[:-1], t), np.column_stack([path[:, :-1], run.sol(t)])
        arcs.append((times, path, Pc))
        t, y = times[-1], path[:, -1]
        if run.t_events[0].size or run.t_events[1].size or y[0] <= p.x1:
            break
    return arcs
