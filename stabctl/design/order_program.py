"""The next schedule of the sequential convex programming: a linear model of the excursion in a trust region.

    minimize    t + SHARE (gradient of the mean) d + TINY |d|^2 / number
    subject to  m + G d <= t,   |d| <= radius,   -1 <= u + d <= 1,
                ramp limits, and limits on the energy absorbed since the first frame

with the present orders u, their changes d, and the moves m with their derivatives G.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from .excursion import SHARE, Slopes
from .scheduled import Plan

TINY = 1e-4  # rad   keeps orders that have no effect where they are


@dataclass(frozen=True)
class Bounds:
    """Limits of a schedule beyond the ratings.

    Attributes
    ----------
    rating
        Ratings of the devices, MW.
    empty, full
        Least and most energy absorbed since the first frame (devices), MWh; infinite if unlimited.
    ramp
        Largest change of the order (devices), ratings per second; infinite if unlimited.
    """

    rating: np.ndarray
    empty: np.ndarray
    full: np.ndarray
    ramp: np.ndarray

    def energy(self, orders: np.ndarray, rate: float) -> np.ndarray:
        """Energy absorbed since the first frame, at rated voltage (frames, devices), MWh; `rate` in 1/s."""
        return np.cumsum(orders, axis=0) * self.rating / rate / 3600

    def within(self, d: Any, u: np.ndarray, rate: float) -> list[Any]:
        """The constraints on changes d (frames, devices) of orders u, besides the ratings."""
        import cvxpy as cp

        out = []
        stores = np.flatnonzero(np.isfinite(self.full) | np.isfinite(self.empty))
        if len(stores):
            level = cp.cumsum((u + d)[:, stores], axis=0) / (3600 * rate)
            per = self.rating[stores][None, :]
            out += [
                cp.multiply(level, per) <= self.full[stores][None, :],
                cp.multiply(level, per) >= self.empty[stores][None, :],
            ]
        slow = np.flatnonzero(np.isfinite(self.ramp))
        if len(slow):
            change = (u + d)[1:, slow] - (u + d)[:-1, slow]
            reach = self.ramp[slow][None, :] / rate
            out += [change <= reach, change >= -reach]
        return out


def improved(plan: Plan, model: Slopes, bounds: Bounds, radius: float) -> tuple[np.ndarray, float, str]:
    """The orders (frames, devices) that the model prefers, the fall of the excursion that it predicts, and the status.

    Where the solver finds nothing, the orders are the present ones and the fall is 0.
    """
    import cvxpy as cp

    u = plan.orders
    d, t = cp.Variable(u.shape), cp.Variable()
    change = cp.vec(d, order="C")
    cost = t + SHARE * (model.of_mean @ change) + TINY * cp.sum_squares(d) / u.size
    low, high = np.maximum(-radius, -1 - u), np.minimum(radius, 1 - u)
    limits = [model.moves + model.of_moves @ change <= t, d >= low, d <= high, *bounds.within(d, u, plan.rate)]
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
