"""Minimum time (29)-(31) as a convex program in time steps, with bisection on T: a check without co-states.

For a given T the program minimizes the speed at T; T is long enough if the minimum is zero or less. The sine is
linearized at the last motion, within a trust radius, and the program is solved again until the speed no longer falls.
With n steps of h = T/n, P_C constant over each, and z = h x2 (rad):

    x1' = x1 + z + (f - h^2 P_C/M1)/2,   z' = z + (f + f')/2 - h^2 P_C/M1,   f = h^2 (Pm - Pmax sin x1)/M

The limit on the end angle is not included.
"""

import math
from dataclasses import dataclass

import numpy as np

from .minimum_time import Array, MinimumTimeProblem, infeasible, stop_angle


@dataclass(frozen=True)
class DiscreteMinimumTime:
    """The minimum time found by the convex program; NaN if there is none."""

    outcome: str
    duration: float  # s, T of (29)
    Pc: Array  # pu, one value for each of the n steps

    def __str__(self) -> str:
        return self.outcome


class SpeedProgram:
    """The smallest speed after n steps as a linear program, built once; T and the tangent are parameters."""

    def __init__(self, p: MinimumTimeProblem, n: int) -> None:
        """Build the program for the problem `p` in `n` steps."""
        import cvxpy as cp

        self.p, self.n = p, n
        self.x1, self.z, self.Pc = cp.Variable(n + 1), cp.Variable(n + 1), cp.Variable(n)
        self.motion, self.radius = cp.Parameter(n + 1), cp.Parameter(nonneg=True)
        self.z0, self.push = cp.Parameter(), cp.Parameter(nonneg=True)
        self.force, self.slope = cp.Parameter(n + 1), cp.Parameter(n + 1)
        f = self.force + cp.multiply(self.slope, self.x1)
        constraints = [
            self.x1[0] == p.x1,
            self.z[0] == self.z0,
            cp.diff(self.x1) == self.z[:-1] + (f[:-1] - self.push * self.Pc) / 2,
            cp.diff(self.z) == (f[1:] + f[:-1]) / 2 - self.push * self.Pc,
            self.Pc >= p.Pc_min,
            self.Pc <= p.Pc_max,
            cp.abs(self.x1 - self.motion) <= self.radius,
        ]
        self.problem = cp.Problem(cp.Minimize(self.z[n]), constraints)
        if not self.problem.is_dpp():
            raise AssertionError("the program must be convex with its parameters (DPP)")

    def move(self, T: float, Pc: Array) -> tuple[Array, float]:
        """Angles (n + 1,) and speed at T (rad/s) under P_C (n,), with the true sine."""
        p, h = self.p, T / self.n
        x1, z = [p.x1], h * p.x2
        f = h**2 * (p.Pm - p.Pmax * math.sin(p.x1)) / p.M
        for push in h**2 * Pc / p.M1:
            x1.append(x1[-1] + z + (f - push) / 2)
            z += f / 2 - push
            f = h**2 * (p.Pm - p.Pmax * math.sin(x1[-1])) / p.M
            z += f / 2
        return np.array(x1), z / h

    def stops(self, T: float, Pc: Array) -> tuple[bool, Array]:
        """Whether some P_C brings the speed to zero by T, and the best P_C found, starting from `Pc` (n,)."""
        import cvxpy as cp

        p, h = self.p, T / self.n
        self.z0.value, self.push.value, self.radius.value = h * p.x2, h**2 / p.M1, 0.5
        motion, speed = self.move(T, Pc)
        while speed > 0 and self.radius.value > 1e-9:
            slope = -(h**2) * p.Pmax / p.M * np.cos(motion)
            self.motion.value, self.slope.value = motion, slope
            self.force.value = h**2 * (p.Pm - p.Pmax * np.sin(motion)) / p.M - slope * motion
            try:
                self.problem.solve(solver=cp.CLARABEL)
            except cp.SolverError:
                break
            if self.problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
                break
            if speed - float(np.asarray(self.z.value)[-1]) / h < 1e-9 * p.x2:
                break
            tried = np.clip(np.asarray(self.Pc.value), p.Pc_min, p.Pc_max)
            moved, slower = self.move(T, tried)
            if slower < speed:
                motion, speed, Pc = moved, slower, tried
            else:
                self.radius.value /= 4
        return speed <= 0, Pc


def by_convex_program(p: MinimumTimeProblem, n: int = 100, resolution: float = 1e-7) -> DiscreteMinimumTime:
    """Minimum time (s) to the relative `resolution` with P_C constant over each of `n` steps."""
    if math.isnan(stop_angle(p)):
        return DiscreteMinimumTime(infeasible(p).outcome, math.nan, np.empty(0))
    if p.x2 < 0:
        mirrored = by_convex_program(p.mirrored(), n, resolution)
        return DiscreteMinimumTime(mirrored.outcome, mirrored.duration, -mirrored.Pc)
    program = SpeedProgram(p, n)
    low = p.x2 / float((p.Pmax - p.Pm) / p.M + p.Pc_max / p.M1)
    high, Pc = low, np.full(n, p.Pc_max)
    while not (found := program.stops(high, Pc))[0]:
        low, high = high, 1.2 * high
        if high > 100 * math.sqrt(p.M / p.Pmax):
            return DiscreteMinimumTime("The convex program found no time that is long enough.", math.nan, np.empty(0))
    Pc = found[1]
    while high - low > resolution * high:
        middle = (low + high) / 2
        enough, tried = program.stops(middle, Pc)
        low, high, Pc = (low, middle, tried) if enough else (middle, high, Pc)
    return DiscreteMinimumTime(f"The speed is zero {high:.6f} s after clearing, with {n} steps.", high, Pc)
