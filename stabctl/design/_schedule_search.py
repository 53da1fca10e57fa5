"""Sequential convex programming of a schedule: improved in a trust region, for longer faults in turn.

Every convex program changes the orders by a linear model of the excursion:

    minimize    t + SHARE (gradient of the mean) d + TINY |d|^2 / number
    subject to  m + G d <= t,   |d| <= radius,   -1 <= u + d <= 1,
                limits on the energy absorbed since the first frame

with the present orders u, their changes d, and the moves m with their derivatives G. Orders in frames in which a device
is idle at low voltage are 0.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.simulation.trajectory import Trajectory

from ._excursion import SHARE, Plan, Scheduled, Slopes, Window, slopes, window

GOOD, POOR = 0.6, 0.25  # of the predicted fall of the excursion: the trust region grows, and shrinks
WIDEST, LEAST = 2.0, 1e-3  # ratings, radius of the trust region
FALL, SLIGHT = 2e-4, 0.02  # rad   falls of the excursion that end the search, and below which the fault grows at once
EASY = 0.03  # of the clearing time under the law, by which the first fault is shorter: its run is less sensitive
BEYOND = 1.1  # times the largest move survived, up to which the moves of a run that is lost are followed
RESCUES = 4  # convex programs for a fault that the present schedule does not survive
SMALL = 1e-9  # MWh   by which the solver may miss a limit
TINY = 1e-4  # rad   keeps orders that have no effect where they are


class Iteration(NamedTuple):
    """One convex program, and the longer fault that it made possible."""

    number: int
    cycles: float  # clearing time survived
    excursion: float  # rad
    fall: float  # rad   of the excursion, at the clearing time before
    radius: float  # ratings
    status: str  # of the solver
    simulations: int  # so far


@dataclass(frozen=True)
class Bounds:
    """Limits of a schedule beyond the ratings.

    Attributes
    ----------
    rating
        Ratings of the devices, MW.
    empty, full
        Least and most energy absorbed since the first frame (devices), MWh; infinite if unlimited.
    """

    rating: np.ndarray
    empty: np.ndarray
    full: np.ndarray

    def energy(self, orders: np.ndarray, rate: float) -> np.ndarray:
        """Energy absorbed since the first frame, at rated voltage (frames, devices), MWh; `rate` in 1/s."""
        return np.cumsum(orders, axis=0) * self.rating / rate / 3600

    def kept(self, plan: Plan) -> bool:
        """Whether a plan keeps the limits."""
        level = self.energy(plan.orders, plan.rate)
        return bool(np.all((level <= self.full + SMALL) & (level >= self.empty - SMALL)))


@dataclass
class ScheduleSearch:
    """The search, from a schedule that survives to those of longer faults."""

    scheduled: Scheduled
    bounds: Bounds
    progress: Callable[[Iteration], None] | None
    plan: Plan = field(init=False)
    run: Trajectory = field(init=False)
    window: Window = field(init=False)
    radius: float = field(init=False, default=0.5)
    ended: str = field(init=False, default="iterations")
    simulations: int = field(init=False, default=0)
    iterations: list[Iteration] = field(init=False, default_factory=list)

    def begin(self, k: int) -> None:
        """Start with the orders that the law gives in the longest fault that it survives."""
        trial = self.scheduled.trial
        start, k = k, k - round(EASY * k)
        while k >= 0:
            orders = self.scheduled.of_run(k, trial.simulate(k, record=True), trial.at)
            if self._try(self._allowed(orders)):
                return
            k -= 1
        raise StudyError(
            f"No stable initial schedule was found for {trial.point.case.name}, from "
            f"{start * trial.search.resolution_cycles:g} cycles down; give more orders per second, or more energy."
        )

    def _allowed(self, plan: Plan) -> Plan:
        """The plan with orders scaled down until they keep the limits on energy."""
        b = self.bounds
        level = b.energy(plan.orders, plan.rate)
        over = np.maximum(level.max(axis=0) / b.full, level.min(axis=0) / b.empty)
        return replace(plan, orders=plan.orders / np.maximum(1.0, np.nan_to_num(over)))

    @property
    def excursion(self) -> float:
        """The excursion of the present schedule, rad."""
        return self.window.excursion

    def go(self, most: int) -> None:
        """Improve the schedule and lengthen the fault in turn."""
        for n in range(most):
            fell, status = self._improve()
            gained = self._lengthen(1.0 if fell < SLIGHT else 0.5)
            made = Iteration(
                n + 1, self._cycles(self.plan.k), self.excursion, fell, self.radius, status, self.simulations
            )
            self.iterations.append(made)
            if self.progress:
                self.progress(made)
            if gained:
                self.radius = max(self.radius, 0.05)
            elif fell < FALL and not self._rescue():
                self.ended = "limit" if self.plan.k == self.scheduled.trial.search.last else "converged"
                return

    def _improve(self) -> tuple[float, str]:
        """One convex program, with smaller trust regions until its orders are better; the fall of the excursion."""
        model = slopes(self.plan, self.run, self.window)
        before, status = self.excursion, "none"
        while self.radius > LEAST:
            orders, foretold, status = improved(self.plan, model, self.window.acts, self.bounds, self.radius)
            if foretold < FALL / 10:
                return 0.0, status
            tried = replace(self.plan, orders=orders)
            kept = self.plan, self.run, self.window
            fell = before - self.excursion if self._try(tried) else -math.inf
            if fell > FALL:
                share = fell / foretold
                self.radius = min(self.radius * (2 if share > GOOD else 0.5 if share < POOR else 1), WIDEST)
                return fell, status
            self.plan, self.run, self.window = kept
            self.radius /= 3
        return 0.0, status

    def _lengthen(self, share: float) -> bool:
        """Take a share of the time that the fault may last longer with the present schedule; whether there was any."""
        begin, stride, longest = self.plan.k, self.scheduled.trial.search.points(1.0), self.plan.k
        while stride:
            k = longest + stride
            if k <= self.scheduled.trial.search.last and self._survives(k):
                longest = k
            else:
                stride //= 2
        most = begin + math.ceil(share * (longest - begin))
        return any(self._try(self._longer(k)) for k in range(most, begin, -1))

    def _rescue(self) -> bool:
        """Change the schedule so that the next longer fault is survived, from its run that is lost; whether it is.

        Its moves are followed to just beyond the largest one survived, and made smaller there. A schedule that is lost
        later is the next one to be changed.
        """
        k = self.plan.k + 1
        if k > self.scheduled.trial.search.last:
            return False
        plan, limit = self._longer(k), BEYOND * self.window.largest
        run, radius = self.scheduled.run(plan), 0.5
        for _ in range(RESCUES):
            seen = window(self.scheduled, plan, run, limit)
            model = slopes(plan, run, seen)
            while radius > 10 * LEAST:
                orders, _fall, _status = improved(plan, model, seen.acts, self.bounds, radius)
                tried = replace(plan, orders=orders)
                if self._try(tried):
                    self.radius = max(self.radius, radius)
                    return True
                later = self.scheduled.run(tried)
                if later.outcome.time_s > run.outcome.time_s + later.step:
                    plan, run = tried, later
                    break
                radius /= 3
        return False

    def _survives(self, k: int) -> bool:
        return self._played(self._longer(k)) is not None

    def _longer(self, k: int) -> Plan:
        """The present plan for another duration of the fault."""
        return self._allowed(self.scheduled.plan(k, self.plan))

    def _played(self, plan: Plan) -> tuple[Plan, Trajectory, Window] | None:
        """What a plan does, orders of idle devices at 0; None if it is lost, or takes more energy than allowed."""
        self.simulations += 1
        run = self.scheduled.run(plan)
        if not run.outcome.stable:
            return None
        seen = window(self.scheduled, plan, run)
        plan = replace(plan, orders=plan.orders * seen.acts)
        return (plan, run, seen) if self.bounds.kept(plan) else None

    def _try(self, plan: Plan) -> bool:
        """Adopt a plan if it is survived within the limits."""
        found = self._played(plan)
        if found:
            self.plan, self.run, self.window = found
        return found is not None

    def _cycles(self, k: int) -> float:
        return k * self.scheduled.trial.search.resolution_cycles


def improved(
    plan: Plan, model: Slopes, acts: np.ndarray, bounds: Bounds, radius: float
) -> tuple[np.ndarray, float, str]:
    """The orders (frames, devices) that the model prefers, the fall of the excursion that it predicts, and the status.

    Energy is taken in the frames in which a device `acts` (frames, devices). Where the solver finds nothing, the orders
    are the present ones and the fall is 0.
    """
    import cvxpy as cp

    u = plan.orders
    d, t = cp.Variable(u.shape), cp.Variable()
    change = cp.vec(d, order="C")
    cost = t + SHARE * (model.of_mean @ change) + TINY * cp.sum_squares(d) / u.size
    low, high = np.maximum(-radius, -1 - u), np.minimum(radius, 1 - u)
    limits = [model.moves + model.of_moves @ change <= t, d >= low, d <= high]
    for j in np.flatnonzero(np.isfinite(bounds.full) | np.isfinite(bounds.empty)):
        level = cp.cumsum(cp.multiply(acts[:, j], u[:, j] + d[:, j])) * (bounds.rating[j] / plan.rate / 3600)
        limits += [level <= bounds.full[j], level >= bounds.empty[j]]
    problem = cp.Problem(cp.Minimize(cost), limits)
    try:
        problem.solve(solver=cp.CLARABEL)
    except cp.SolverError:
        return u, 0.0, "failed"
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        return u, 0.0, str(problem.status)
    step = np.asarray(d.value)
    fall = (
        model.moves.max() - (model.moves + model.of_moves @ step.ravel()).max() - SHARE * model.of_mean @ step.ravel()
    )
    return np.clip(u + step, -1, 1), float(fall), str(problem.status)
