"""Minimum-time control of the two-machine equivalent (29)-(39): bring the speed to zero as early as possible.

    x1' = x2                                            lambda1' = lambda2 (Pmax/M) cos x1
    x2' = (Pm - Pmax sin x1)/M - P_C/M1                 lambda2' = -lambda1
    H   = 1 + lambda1 x2 + lambda2 x2' = 0              P_C = Pc_max where lambda2 > 0, else Pc_min

P_C enters with 1/M1 while Pm - Pe has 1/M, as in (32). At the end x2 = 0 and lambda1 = 0 (36)-(38).

How often can P_C switch? Between switches x2 and lambda2 solve the same linear equation y'' = -(Pmax/M) cos(x1) y,
and H = 0 says that their Wronskian x2 lambda2' - x2' lambda2 is 1. Where lambda2 = 0, then, x2 lambda2' = 1: while
x2 > 0, lambda2 only ever rises through zero. So there is at most one switch, from injecting to absorbing.

The machine must come to rest no further than the unstable equilibrium pi - asin(Pm/Pmax), from where it returns when
the device lets go. A solution that this limit stops ends there with lambda1 >= 0 instead of lambda1 = 0.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import brentq

from stabctl._util.guard import guard
from stabctl.errors import StudyError
from stabctl.schema import ANY, POSITIVE, Range

Array = NDArray[np.float64]
Arcs = list[tuple[Array, Array, float]]  # times (n,), (x1, x2, lambda1, lambda2) (4, n), P_C
TIGHT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
DEVICE = Range(-1e3, 1e3)  # pu, wide enough for every device
TOL = 1e-8  # relative residual of the collocation


@dataclass(frozen=True)
class Problem:
    """The state when the fault is released and the plant from then on.

    Raises StudyError where a value is out of range, the plant has no equilibrium or the speed is zero already.
    """

    x1: Annotated[float, "rad", "angle at release", ANY]
    x2: Annotated[float, "rad/s", "speed at release", ANY]
    M: Annotated[float, "s^2/rad", "moment of inertia of the equivalent", POSITIVE]
    M1: Annotated[float, "s^2/rad", "moment of inertia of the machine with the device", POSITIVE]
    Pm: Annotated[float, "pu", "mechanical power", ANY]
    Pmax: Annotated[float, "pu", "crest of the power-angle curve", POSITIVE]
    Pc_min: Annotated[float, "pu", "least absorbed power", DEVICE]
    Pc_max: Annotated[float, "pu", "greatest absorbed power", DEVICE]

    def __post_init__(self) -> None:
        guard(self)
        if self.Pc_min > self.Pc_max:
            raise StudyError(f"Pc_min = {self.Pc_min:g} pu must not be above Pc_max = {self.Pc_max:g} pu")
        if abs(self.Pm) >= self.Pmax:
            raise StudyError(f"Pm = {self.Pm:g} pu has no equilibrium: it must be below Pmax = {self.Pmax:g} pu")
        if self.x2 == 0:
            raise StudyError("the speed at release is zero: there is nothing to control")

    @property
    def limit(self) -> float:
        """Unstable equilibrium, rad, on the side to which the machine moves."""
        return math.copysign(math.pi, self.x2) - math.asin(self.Pm / self.Pmax)

    def acceleration(self, x1: ArrayLike, Pc: ArrayLike) -> Array:
        """x2' of (28), rad/s^2; angle in rad and P_C in pu, shapes that broadcast."""
        return (self.Pm - self.Pmax * np.sin(x1)) / self.M - np.asarray(Pc) / self.M1

    def mirrored(self) -> "Problem":
        """The same problem with angle, speed and every power of the opposite sign."""
        low, high = -self.Pc_max, -self.Pc_min
        return replace(self, x1=-self.x1, x2=-self.x2, Pm=-self.Pm, Pc_min=low, Pc_max=high)


@dataclass(frozen=True)
class MinimumTime:
    """The optimal control from release on; the arrays (n,) are empty and the duration is nan where there is none."""

    outcome: str
    duration: float  # s, T of (29)
    switches: tuple[float, ...]  # s after release
    t: Array  # s after release
    x1: Array  # rad
    x2: Array  # rad/s
    lambda1: Array  # s/rad
    lambda2: Array  # s^2/rad
    Pc: Array  # pu
    hamiltonian: Array  # (32)

    @property
    def feasible(self) -> bool:
        """There is a control that brings the speed to zero in time."""
        return math.isfinite(self.duration)

    def __str__(self) -> str:
        return self.outcome

    def mirrored(self) -> "MinimumTime":
        """Angle, speed, co-states and power with the opposite sign."""
        return replace(self, x1=-self.x1, x2=-self.x2, lambda1=-self.lambda1, lambda2=-self.lambda2, Pc=-self.Pc)


def rates(p: Problem, y: Array, Pc: float) -> Array:
    """(27), (28), (33), (34) for y = (x1, x2, lambda1, lambda2), shape (4,) or (4, n), with P_C given."""
    x1, x2, lambda1, lambda2 = y
    return np.array([x2, p.acceleration(x1, Pc), lambda2 * p.Pmax / p.M * np.cos(x1), -lambda1])


def hamiltonian(p: Problem, y: Array, Pc: ArrayLike) -> Array:
    """(32) for y of shape (4,) or (4, n) and P_C (pu)."""
    return 1 + y[2] * y[1] + y[3] * p.acceleration(y[0], Pc)


def stop_angle(p: Problem) -> float:
    """Angle (rad) where the machine rests when the device brakes with all its power; nan where it does not in time.

    No control makes it rest nearer to the release, so where this is nan there is no control at all.
    """
    if p.x2 < 0:
        return -stop_angle(p.mirrored())
    decelerate = p.Pm - p.Pc_max * p.M / p.M1

    def square(x1: float) -> float:  # x2^2 M/2, by the energy (24)
        return p.M * p.x2**2 / 2 + decelerate * (x1 - p.x1) + p.Pmax * (math.cos(x1) - math.cos(p.x1))

    if p.x1 >= p.limit:
        return math.nan
    grid = np.linspace(p.x1, p.limit, 2001)
    below = next((i for i, x1 in enumerate(grid) if square(x1) <= 0), None)
    return math.nan if below is None else brentq(square, grid[below - 1], grid[below], xtol=1e-15)


def by_shooting(p: Problem) -> MinimumTime:
    """Minimum time by shooting back from the end.

    The end angle alone fixes all of the end (x2 = lambda1 = 0, and H = 0 scales the co-states), so the extremals are
    one family; the one that passes through the state at release is found. Where an extremal would end past the limit
    the family goes on with lambda1 >= 0 at the limit. Of several extremals the shortest is taken. Raises StudyError
    where none is found although one exists, which only rounding at the very limit can cause.
    """
    nearest = stop_angle(p)
    if math.isnan(nearest):
        return infeasible(p)
    if p.x2 < 0:
        return by_shooting(p.mirrored()).mirrored()

    first = nearest - 1e-6 * (nearest - p.x1)  # just too near, so that the misses change sign

    def end(s: float) -> Array:  # co-states in any scale: s to 1 is the end angle, from 1 to 2 lambda1 at the limit
        x1 = first + min(s, 1 - 1e-9) * (p.limit - first)
        slope = math.pi / 2 * max(s - 1, 0.0)
        scale = math.sqrt(p.Pmax / p.M)
        return np.array([x1, 0.0, scale * math.sin(slope), math.cos(slope)])

    def miss(s: float) -> float:
        return float(_back(p, end(s))[-1][1][1, -1]) - p.x2

    grid = np.concatenate([np.linspace(0, 1, 33), np.linspace(1, 2, 9)[1:]])
    misses = [miss(s) for s in grid]
    pairs = zip(pairwise(grid), pairwise(misses), strict=True)
    hits = [brentq(miss, *ends, xtol=1e-15) for ends, (low, high) in pairs if low * high <= 0]
    if not hits:
        raise StudyError(f"no control was found to stop before {p.limit:.4f} rad: move the release a little")
    T, s = min((_back(p, end(s))[-1][0][-1], s) for s in hits)
    arcs = _back(p, end(s), T / 200)
    return _solution(p, [(T - t[::-1], y[:, ::-1], Pc) for t, y, Pc in arcs[::-1]])


def by_collocation(p: Problem, guess: tuple[float, float] | None = None) -> MinimumTime:
    """Minimum time as a boundary-value problem with free durations, by `scipy.integrate.solve_bvp`.

    Starts from a device that absorbs all the while, with its own co-states or those of `guess`, (lambda1, lambda2) at
    release. Where the solution has lambda2 < 0 somewhere, an injecting arc is put in front and its power moved from
    Pc_max to Pc_min in steps. Where there are several extremals this is one of them, not always the shortest.
    Raises StudyError where the collocation does not converge.
    """
    if math.isnan(stop_angle(p)):
        return infeasible(p)
    if p.x2 < 0:
        return by_collocation(p.mirrored(), guess and (-guess[0], -guess[1])).mirrored()
    t, y = _absorbing(p)
    if guess is not None:
        y[2:] = guess[0] * (1 - t / t[-1]), np.full(t.size, guess[1])
    arcs = _collocate(p, (p.Pc_max,), [(t, y)], TOL)
    t, y, _ = arcs[0]
    if (y[3] < 0).any():
        rise = int(np.flatnonzero(y[3] < 0)[-1]) + 1
        arcs = [(t[: rise + 1], y[:, : rise + 1], p.Pc_max), (t[rise:], y[:, rise:], p.Pc_max)]
        for part in np.linspace(0, 1, 9):  # with both powers equal the guess is a solution; then they part
            first = p.Pc_max + part * (p.Pc_min - p.Pc_max)
            arcs = _collocate(p, (first, p.Pc_max), [(t, y) for t, y, _ in arcs], TOL if part == 1 else 1e-3)
        if arcs[-1][1][0, -1] > p.limit:
            arcs = _collocate(p, (p.Pc_min, p.Pc_max), [(t, y) for t, y, _ in arcs], TOL, at_limit=True)
    return _solution(p, arcs)


def infeasible(p: Problem) -> MinimumTime:
    """The outcome where not even the greatest absorbed power brings the speed to zero in time."""
    side = "greatest" if p.x2 > 0 else "least"
    power = p.Pc_max if p.x2 > 0 else p.Pc_min
    outcome = (
        f"the speed cannot be brought to zero before the unstable equilibrium at {p.limit:.4f} rad: the {side} "
        f"absorbed power, {power:g} pu, is too little for {p.x2:.4f} rad/s at {p.x1:.4f} rad"
    )
    return MinimumTime(outcome, math.nan, (), *(np.empty(0) for _ in range(7)))


def _absorbing(p: Problem) -> tuple[Array, Array]:
    """Times (n,) from release to rest and (4, n) states and co-states while the device absorbs Pc_max throughout."""

    def rest(_t: float, y: Array) -> float:
        return y[1]

    rest.terminal, rest.direction = True, -1
    span, start = (0, 100 * math.sqrt(p.M / p.Pmax)), (p.x1, p.x2, 0.0, 0.0)
    T = solve_ivp(lambda _, y: rates(p, y, p.Pc_max), span, start, events=rest, **TIGHT).t[-1]
    end = np.array([stop_angle(p), 0.0, 0.0, 1.0])
    run = solve_ivp(lambda _, y: rates(p, y, p.Pc_max), (T, 0), end, max_step=T / 40, **TIGHT)
    y = run.y[:, ::-1].copy()
    y[2:] /= 1 - hamiltonian(p, y[:, -1], p.Pc_max)
    return run.t[::-1], y


def _back(p: Problem, end: Array, step: float = math.inf) -> Arcs:
    """The extremal that ends in `end`, as arcs back to the angle at release; their times (s) count from the end."""

    def angle(_t: float, y: Array) -> float:
        return y[0] - p.x1

    def rest(_t: float, y: Array) -> float:
        return y[1]

    def switch(_t: float, y: Array) -> float:
        return y[3]

    angle.terminal = rest.terminal = switch.terminal = True
    rest.direction = switch.direction = -1
    longest = 100 * math.sqrt(p.M / p.Pmax)
    arcs, t, y = [], 0.0, end
    for Pc, events in ((p.Pc_max, (angle, rest, switch)), (p.Pc_min, (angle, rest))):
        run = solve_ivp(
            lambda _, y, Pc=Pc: -rates(p, y, Pc),
            (t, longest),
            y,
            events=events,
            max_step=step,
            dense_output=True,
            **TIGHT,
        )
        times, path = run.t, run.y
        if run.t_events[0].size == 0 and path[0, -1] < p.x1:  # the angle was passed both ways within the last step
            t = brentq(lambda t, run=run: run.sol(t)[0] - p.x1, times[-2], times[-1], xtol=1e-15)
            times, path = np.append(times[:-1], t), np.column_stack([path[:, :-1], run.sol(t)])
        arcs.append((times, path, Pc))
        t, y = times[-1], path[:, -1]
        if run.t_events[0].size or run.t_events[1].size or y[0] <= p.x1:
            break
    return arcs


def _collocate(
    p: Problem, powers: tuple[float, ...], guess: list[tuple[Array, Array]], tol: float, at_limit: bool = False
) -> Arcs:
    """Solve the arcs of given powers together, each over tau in [0, 1] with its duration unknown."""

    def field(_tau: Array, y: Array, T: Array) -> Array:
        return np.vstack([T[k] * rates(p, y[4 * k : 4 * k + 4], Pc) for k, Pc in enumerate(powers)])

    def ends(a: Array, b: Array, _T: Array) -> Array:
        last = b[-4:]
        joints = [a[4:] - b[:-4], b[3:-4:4]]
        edge = last[0] - p.limit if at_limit else last[2]
        return np.concatenate([[a[0] - p.x1, a[1] - p.x2], *joints, [last[1], edge, hamiltonian(p, last, powers[-1])]])

    tau = np.linspace(0, 1, 41)
    lengths = np.array([t[-1] - t[0] for t, _ in guess])
    y = np.vstack([[np.interp(t[0] + tau * (t[-1] - t[0]), t, row) for row in y] for t, y in guess])
    found = solve_bvp(field, ends, tau, y, p=lengths, tol=tol, max_nodes=20000)
    if not found.success or found.p.min() <= 0 or found.y[1::4].min() < -1e-6 * p.x2:
        raise StudyError(f"the collocation found no solution ({found.message.rstrip('.')}): use shooting")
    begins = np.concatenate([[0.0], np.cumsum(found.p)])
    pieces = enumerate(powers)
    return [(begins[k] + found.p[k] * found.x, found.y[4 * k : 4 * k + 4], Pc) for k, Pc in pieces]


def _solution(p: Problem, arcs: Arcs) -> MinimumTime:
    """The record of arcs in the order of time, with the co-states scaled so that H = 0."""
    t = np.concatenate([t for t, _, _ in arcs])
    y = np.hstack([y for _, y, _ in arcs])
    Pc = np.concatenate([np.full(t.size, Pc) for t, _, Pc in arcs])
    y[2:] *= -1 / (hamiltonian(p, y[:, 0], Pc[0]) - 1)
    switches = tuple(float(t[0]) for t, _, _ in arcs[1:])
    how = (
        "no switch" if not switches else f"one switch, at {switches[0]:.6f} s from {arcs[0][2]:g} to {arcs[1][2]:g} pu"
    )
    outcome = f"speed brought to zero {t[-1]:.6f} s after release at {y[0, -1]:.6f} rad, {how}"
    return MinimumTime(outcome, float(t[-1]), switches, t, *y, Pc, hamiltonian(p, y, Pc))
