"""Minimum-time control of the two-machine equivalent (29)-(39): bring the speed to zero as early as possible.

    x1' = x2                                            lambda1' = lambda2 (Pmax/M) cos x1
    x2' = (Pm - Pmax sin x1)/M - P_C/M1                 lambda2' = -lambda1
    H   = 1 + lambda1 x2 + lambda2 x2' = 0              P_C = Pc_max if lambda2 > 0, else Pc_min

P_C acts with 1/M1 while Pm - Pe acts with 1/M, as in (32). At the end x2 = 0 and lambda1 = 0 (36)-(38).

How often can P_C switch? Between switches x2 and lambda2 satisfy the same linear equation y'' = -(Pmax/M) cos(x1) y,
and H = 0 says that their Wronskian x2 lambda2' - x2' lambda2 is 1. So x2 lambda2' = 1 wherever lambda2 = 0: while
x2 > 0, lambda2 only crosses zero upwards. There is at most one switch, from injecting to absorbing.

The machine must stop before the unstable equilibrium pi - asin(Pm/Pmax), so that it swings back when the device
switches off. A solution that reaches this limit ends there with lambda1 >= 0 instead of lambda1 = 0.

The problem is solved here by shooting and by collocation; convex_program.py solves it without co-states.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import brentq

from stabctl._util.errors import StudyError
from stabctl._util.schema import POSITIVE
from stabctl._util.tabular import Tabular
from stabctl._util.validation import guard
from stabctl._util.verbs import verb

from .omib import stops

if TYPE_CHECKING:
    import pandas as pd


Array = NDArray[np.float64]
Arcs = list[tuple[Array, Array, float]]  # times (n,), (x1, x2, lambda1, lambda2) (4, n), P_C
TIGHT: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
TOL = 1e-8  # relative residual of the collocation
SMALLEST = 1e-6  # rad/s   a lower speed counts as rest
DEVICE = Interval(ge=-1e3, le=1e3)  # pu, wide enough for every device


@dataclass(frozen=True)
class MinimumTimeProblem:
    """The state when the fault is cleared, and the network from then on.

    Raises StudyError if a value is out of range, there is no equilibrium, or the speed is already zero.
    """

    x1: Annotated[float, "rad", "angle at clearing"]
    x2: Annotated[float, "rad/s", "speed at clearing"]
    M: Annotated[float, "s^2/rad", "inertia coefficient of the equivalent", POSITIVE]
    M1: Annotated[float, "s^2/rad", "inertia coefficient of the machine with the device", POSITIVE]
    Pm: Annotated[float, "pu", "mechanical power"]
    Pmax: Annotated[float, "pu", "peak of the power-angle curve", POSITIVE]
    Pc_min: Annotated[float, "pu", "smallest absorbed power", DEVICE]
    Pc_max: Annotated[float, "pu", "largest absorbed power", DEVICE]

    def __post_init__(self) -> None:
        guard(self)
        if self.Pc_min > self.Pc_max:
            raise StudyError(f"Pc_min = {self.Pc_min:g} pu is above Pc_max = {self.Pc_max:g} pu; swap them.")
        if abs(self.Pm) >= self.Pmax:
            raise StudyError(f"Pm = {self.Pm:g} pu has no equilibrium; choose Pm below Pmax = {self.Pmax:g} pu.")
        if abs(self.x2) < SMALLEST:
            raise StudyError(
                f"The speed at clearing, {self.x2:g} rad/s, is practically zero; there is nothing to control. Give a "
                "longer fault."
            )

    @property
    def limit(self) -> float:
        """Unstable equilibrium, rad, in the direction of motion."""
        return math.copysign(math.pi, self.x2) - math.asin(self.Pm / self.Pmax)

    @property
    def Pm_least(self) -> float:
        """Pm less what acts of the largest absorbed power, pu."""
        return self.Pm - self.Pc_max * self.M / self.M1

    def acceleration(self, x1: ArrayLike, Pc: ArrayLike) -> Array:
        """x2' of (28), rad/s^2; angle in rad and P_C in pu, broadcast against each other."""
        return (self.Pm - self.Pmax * np.sin(x1)) / self.M - np.asarray(Pc) / self.M1

    def mirrored(self) -> "MinimumTimeProblem":
        """The same problem with angle, speed and every power of the opposite sign."""
        low, high = -self.Pc_max, -self.Pc_min
        return replace(self, x1=-self.x1, x2=-self.x2, Pm=-self.Pm, Pc_min=low, Pc_max=high)


@dataclass(frozen=True, repr=False)
class MinimumTime(Tabular):
    """The optimal control from clearing on; without a solution the arrays (n,) are empty and the duration is NaN."""

    outcome: str
    duration: float  # s, T of (29)
    switches: tuple[float, ...]  # s after clearing
    t: Array  # s after clearing
    x1: Array  # rad
    x2: Array  # rad/s
    lambda1: Array  # s/rad
    lambda2: Array  # s^2/rad
    Pc: Array  # pu
    hamiltonian: Array  # (32)

    plot = verb("stabctl.view.figures.one_machine:plot")

    @property
    def df(self) -> "pd.DataFrame":
        """States, co-states and absorbed power from clearing on."""
        import pandas as pd

        states = {"x1_rad": self.x1, "x2_rad_s": self.x2, "lambda1": self.lambda1, "lambda2": self.lambda2}
        return pd.DataFrame({"time_s": self.t} | states | {"absorbed_pu": self.Pc})

    @property
    def feasible(self) -> bool:
        """Some control brings the speed to zero in time."""
        return math.isfinite(self.duration)

    def __str__(self) -> str:
        return self.outcome

    def mirrored(self) -> "MinimumTime":
        """Angle, speed, co-states and power with the opposite sign."""
        signed = {name: -getattr(self, name) for name in ("x1", "x2", "lambda1", "lambda2", "Pc")}
        outcome = _outcome(self.t, signed["x1"], signed["Pc"], self.switches) if self.feasible else self.outcome
        return replace(self, outcome=outcome, **signed)


def by_shooting(p: MinimumTimeProblem) -> MinimumTime:
    """Minimum time by shooting backwards from the end.

    The end angle alone determines the end state (x2 = lambda1 = 0, and H = 0 scales the co-states), so the extremals
    form a one-parameter family; the method finds the one that passes through the state at clearing. If an extremal
    would end beyond the limit angle, the family continues with lambda1 >= 0 at the limit. Of several extremals the
    shortest is taken. If the device must inject (Pc_max < 0), the machine accelerates near the limit and cannot end
    there; the family ends where it no longer decelerates.

    Raises StudyError if no extremal is found although a control exists, which only rounding at the limit can cause.
    """
    nearest = stop_angle(p)
    if math.isnan(nearest):
        return infeasible(p)
    if p.x2 < 0:
        return by_shooting(p.mirrored()).mirrored()

    first = nearest - 1e-6 * (nearest - p.x1)  # slightly too close, so that the errors change sign
    last = p.limit if p.Pc_max >= 0 else math.pi - math.asin(p.Pm_least / p.Pmax)

    def end(s: float) -> Array:  # 0 <= s <= 1 moves the end angle; 1 <= s <= 2 raises lambda1 at the limit
        x1 = first + min(s, 1 - 1e-9) * (last - first)
        slope = math.pi / 2 * max(s - 1, 0.0)
        scale = math.sqrt(p.Pmax / p.M)
        return np.array([x1, 0.0, scale * math.sin(slope), math.cos(slope)])

    def error(s: float) -> float:
        return float(_backward(p, end(s))[-1][1][1, -1]) - p.x2

    grid = np.concatenate([np.linspace(0, 1, 33), np.linspace(1, 2, 9)[1:] if last == p.limit else []])
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


def by_collocation(p: MinimumTimeProblem, guess: tuple[float, float] | None = None) -> MinimumTime:
    """Minimum time by collocation: a boundary-value problem with free durations, solved by `scipy.integrate.solve_bvp`.

    Starts from a device that absorbs throughout. If that solution has lambda2 < 0 somewhere, an injecting arc is added
    at the beginning, and its power is changed from Pc_max to Pc_min in steps. If there are several extremals, the
    result is one of them, not necessarily the shortest.

    Parameters
    ----------
    p : MinimumTimeProblem
        The problem.
    guess : (lambda1, lambda2), optional
        Co-states at clearing to start from; by default those of the absorbing device.

    Raises
    ------
    StudyError
        If the collocation does not converge.
    """
    if math.isnan(stop_angle(p)):
        return infeasible(p)
    if p.x2 < 0:
        return by_collocation(p.mirrored(), guess and (-guess[0], -guess[1])).mirrored()
    t, y = _absorbing(p)
    if guess is not None:
        y[2:] = guess[0] * (1 - t / t[-1]), np.full(t.size, guess[1])
    arcs = _collocate(p, (p.Pc_max,), [(t, y)])
    t, y, _ = arcs[0]
    if (y[3] < 0).any():
        rise = int(np.flatnonzero(y[3] < 0)[-1]) + 1
        arcs = [(t[: rise + 1], y[:, : rise + 1], p.Pc_max), (t[rise:], y[:, rise:], p.Pc_max)]
        for part in np.linspace(0, 1, 9):  # with equal powers the guess is a solution
            first = p.Pc_max + part * (p.Pc_min - p.Pc_max)
            arcs = _collocate(p, (first, p.Pc_max), [(t, y) for t, y, _ in arcs], tol=TOL if part == 1 else 1e-3)
        if arcs[-1][1][0, -1] > p.limit:
            arcs = _collocate(p, (p.Pc_min, p.Pc_max), [(t, y) for t, y, _ in arcs], at_limit=True)
    return solution(p, arcs)


def _absorbing(p: MinimumTimeProblem) -> tuple[Array, Array]:
    """Times (n,) from clearing to rest and (4, n) states and co-states while the device absorbs Pc_max throughout."""

    def rest(_t: float, y: Array) -> float:
        return y[1]

    stops(rest, -1)
    span, start = (0, 100 * math.sqrt(p.M / p.Pmax)), (p.x1, p.x2, 0.0, 0.0)
    T = solve_ivp(lambda _, y: rates(p, y, p.Pc_max), span, start, events=rest, **TIGHT).t[-1]
    end = np.array([stop_angle(p), 0.0, 0.0, 1.0])
    run = solve_ivp(lambda _, y: rates(p, y, p.Pc_max), (T, 0), end, max_step=T / 40, **TIGHT)
    y = run.y[:, ::-1].copy()
    y[2:] /= 1 - hamiltonian(p, y[:, -1], p.Pc_max)
    return run.t[::-1], y


def _collocate(
    p: MinimumTimeProblem,
    powers: tuple[float, ...],
    guess: list[tuple[Array, Array]],
    *,
    tol: float = TOL,
    at_limit: bool = False,
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
    lengths = np.asarray(found.p)
    if not found.success or lengths.min() <= 0 or found.y[1::4].min() < -1e-6 * p.x2:
        raise StudyError(f"The collocation did not converge ({found.message.rstrip('.')}); use shooting.")
    begins = np.concatenate([[0.0], np.cumsum(lengths)])
    return [(begins[k] + lengths[k] * found.x, found.y[4 * k : 4 * k + 4], Pc) for k, Pc in enumerate(powers)]


def stop_angle(p: MinimumTimeProblem) -> float:
    """Angle (rad) where the machine stops if the device absorbs its largest power; NaN if it does not stop in time.

    No control makes it stop at a smaller angle, so NaN means that there is no control at all.
    """
    if p.x2 < 0:
        return -stop_angle(p.mirrored())

    def energy(x1: float) -> float:  # x2^2 M/2 by (24)
        return p.M * p.x2**2 / 2 + p.Pm_least * (x1 - p.x1) + p.Pmax * (math.cos(x1) - math.cos(p.x1))

    if p.x1 >= p.limit:
        return math.nan
    grid = np.linspace(p.x1, p.limit, 2001)
    below = next((i for i, x1 in enumerate(grid) if energy(x1) <= 0), None)
    return math.nan if below is None else brentq(energy, grid[below - 1], grid[below], xtol=1e-15)


def infeasible(p: MinimumTimeProblem) -> MinimumTime:
    """The result if no absorbed power brings the speed to zero in time."""
    which, power = ("largest", p.Pc_max) if p.x2 > 0 else ("smallest", p.Pc_min)
    why = f"the {which} absorbed power, {power:g} pu, is too small for {p.x2:.4f} rad/s at {p.x1:.4f} rad"
    if (p.x1 - p.limit) * p.x2 >= 0:
        why = f"the angle at clearing, {p.x1:.4f} rad, is already beyond it"
    outcome = f"The speed cannot be brought to zero before the unstable equilibrium at {p.limit:.4f} rad: {why}."
    return MinimumTime(outcome, math.nan, (), *(np.empty(0) for _ in range(7)))


def solution(p: MinimumTimeProblem, arcs: Arcs) -> MinimumTime:
    """The result of arcs in order of time, with the co-states scaled so that H = 0."""
    t = np.concatenate([t for t, _, _ in arcs])
    y = np.hstack([y for _, y, _ in arcs])
    Pc = np.concatenate([np.full(t.size, Pc) for t, _, Pc in arcs])
    y[2:] *= -1 / (hamiltonian(p, y[:, 0], Pc[0]) - 1)
    switches = tuple(float(t[0]) for t, _, _ in arcs[1:])
    outcome = _outcome(t, y[0], Pc, switches)
    x1, x2, lambda1, lambda2 = y
    return MinimumTime(outcome, float(t[-1]), switches, t, x1, x2, lambda1, lambda2, Pc, hamiltonian(p, y, Pc))


def _outcome(t: Array, x1: Array, Pc: Array, switches: tuple[float, ...]) -> str:
    """When and where the speed is zero, and by which powers, in a sentence."""
    how = f"with one switch from {Pc[0]:g} to {Pc[-1]:g} pu at {switches[0]:.6f} s" if switches else "without a switch"
    return f"The speed is zero {t[-1]:.6f} s after clearing, at {x1[-1]:.6f} rad, {how}."


def rates(p: MinimumTimeProblem, y: Array, Pc: float) -> Array:
    """(27), (28), (33), (34) for y = (x1, x2, lambda1, lambda2), shape (4,) or (4, n), with P_C given."""
    x1, x2, lambda1, lambda2 = y
    return np.array([x2, p.acceleration(x1, Pc), lambda2 * p.Pmax / p.M * np.cos(x1), -lambda1])


def hamiltonian(p: MinimumTimeProblem, y: Array, Pc: ArrayLike) -> Array:
    """(32) for y of shape (4,) or (4, n) and P_C (pu)."""
    return 1 + y[2] * y[1] + y[3] * p.acceleration(y[0], Pc)
