"""The master program: the cheapest fleet that every cut allows, near the best one known.

    min  c's + f'z + rho 1'xi
    s.t. D s >= b - xi,  0 <= s <= cap z,  |s - best| <= radius,  xi >= 0
         0 <= z <= 1 (a linear program, Clarabel), or z of 0 and 1 with at most K of them (HiGHS)

Inside, a size is a share of its cap and a cut is measured by the most that one device can do for it, so that the
program is well scaled.
"""

from typing import NamedTuple

import cvxpy as cp
import numpy as np

from stabctl.errors import StudyError

SLACK = 1e3  # rho, over the largest cost of a cap
NOTHING = 1e-6  # of a cap


class Cut(NamedTuple):
    """A half space d . s >= b that a contingency leaves (about) to the fleets that survive it."""

    contingency: int
    normal: np.ndarray  # (candidates) 1/MW
    bound: float
    at: np.ndarray  # (candidates) MW   the fleet on the border where it was found


class Plan(NamedTuple):
    """A solution of the master."""

    mw: np.ndarray  # (candidates) MW
    cost: float  # without slack
    slack: float  # largest violation of a cut, over the most that one device can do for it


class Master:
    """The program, built once for a number of candidates; cuts, center and radius are parameters.

    Args: largest sizes (candidates, MW); cost of a MW and of a site (candidates); at most so many sites (None: any
    number); room for cuts.
    """

    def __init__(
        self, cap: np.ndarray, cost_mw: np.ndarray, cost_site: np.ndarray, sites: int | None = None, room: int = 64
    ) -> None:
        self.cap, self.cost_mw, self.cost_site, self.sites = cap, cost_mw, cost_site, sites
        self._write(room)

    def _write(self, room: int) -> None:
        """The program with room for so many cuts."""
        n, self.room = len(self.cap), room
        self.s, self.xi = cp.Variable(n, nonneg=True), cp.Variable(room, nonneg=True)
        self.D, self.b = cp.Parameter((room, n)), cp.Parameter(room)
        self.low, self.high = cp.Parameter(n), cp.Parameter(n, nonneg=True)
        whole = self.sites is not None or bool(self.cost_site.any())
        self.z = cp.Variable(n, boolean=True) if whole else None
        scale = float(np.max(self.cost_mw * self.cap + self.cost_site)) or 1.0
        rules = [self.D @ self.s >= self.b - self.xi, self.s >= self.low, self.s <= self.high]
        price = (self.cost_mw * self.cap / scale) @ self.s + SLACK * cp.sum(self.xi)
        if self.z is not None:
            rules.append(self.s <= self.z)
            price += (self.cost_site / scale) @ self.z
            if self.sites is not None:
                rules.append(cp.sum(self.z) <= self.sites)
        self.problem = cp.Problem(cp.Minimize(price), rules)
        assert self.problem.is_dcp(dpp=True)

    def cost(self, mw: np.ndarray) -> float:
        """What a fleet costs."""
        return float(self.cost_mw @ mw + self.cost_site @ (mw > 0))

    def allows(self, mw: np.ndarray) -> bool:
        """Has a fleet few enough sites?"""
        return self.sites is None or int((mw > 0).sum()) <= self.sites

    def solve(self, cuts: list[Cut], best: np.ndarray | None = None, radius: float = np.inf) -> Plan:
        """The cheapest fleet within `radius` (MW) of `best`; `StudyError` where the solver finds none."""
        if len(cuts) > self.room:
            self._write(2 * len(cuts))
        if not all(np.isfinite([*cut.normal, cut.bound]).all() for cut in cuts):
            raise StudyError("The siting program has a cut that is not of finite numbers; check costs and caps.")
        D, b = np.zeros(self.D.shape), np.full(self.room, -1.0)
        for row, cut in enumerate(cuts):
            does = cut.normal * self.cap
            most = np.abs(does).max() or 1.0
            D[row], b[row] = does / most, cut.bound / most
        unit = np.where(self.cap > 0, self.cap, 1.0)
        near = best is not None and radius < np.inf
        self.low.value = np.maximum(best - radius, 0) / unit if near else np.zeros(len(unit))
        self.high.value = (np.minimum(best + radius, self.cap) if near else self.cap) / unit
        self.D.value, self.b.value = D, b
        try:
            self.problem.solve(solver=cp.CLARABEL if self.z is None else cp.HIGHS)
        except cp.SolverError as error:
            raise StudyError(
                f"The siting program of {len(cuts)} cuts was not solved ({error}); check costs and caps."
            ) from None
        if self.problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
            raise StudyError(f"The siting program is {self.problem.status}; check costs, caps and number of sites.")
        mw = np.where(self.s.value > NOTHING, np.clip(self.s.value, 0, 1) * self.cap, 0.0)
        return Plan(mw, self.cost(mw), float(self.xi.value.max()))
