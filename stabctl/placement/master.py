"""The master program: the cheapest fleet that satisfies every cut, near the best fleet known.

    min  c's + f'z + rho 1'xi
    s.t. D s >= b - xi,  0 <= s <= cap z,  |s - best| <= radius,  xi >= 0
         0 <= z <= 1 (a linear program, Clarabel), or z of 0 and 1 with at most K of them (HiGHS)

Internally a size is a share of its cap, and a cut is divided by the largest contribution of one device, so that the
program is well scaled.
"""

from typing import NamedTuple

import cvxpy as cp
import numpy as np

from stabctl.errors import StudyError

SLACK = 1e3  # rho, relative to the largest cost of a cap
NOTHING = 1e-6  # of a cap


class Cut(NamedTuple):
    """A half space d . s >= b that (approximately) contains the fleets that survive a contingency."""

    contingency: int
    gradient: np.ndarray  # (candidates) 1/MW
    bound: float
    at: np.ndarray  # (candidates) MW   the fleet on the boundary where it was found


class Plan(NamedTuple):
    """A solution of the master program."""

    mw: np.ndarray  # (candidates) MW
    cost: float  # without slack
    slack: float  # largest violation of a cut, relative to the largest contribution of one device


class Master:
    """The program, built once for a number of candidates; cuts, center and radius are parameters.

    Parameters
    ----------
    cap : (candidates,) array, MW
        Largest sizes.
    cost_mw, cost_site : (candidates,) array
        Cost of a MW, and of a site.
    sites : int, optional
        Largest number of sites; any number by default.
    room : int
        Number of cuts that fit before the program is built again.
    """

    def __init__(
        self, cap: np.ndarray, cost_mw: np.ndarray, cost_site: np.ndarray, sites: int | None = None, *, room: int = 64
    ) -> None:
        self.cap, self.cost_mw, self.cost_site, self.sites = cap, cost_mw, cost_site, sites
        self._build(room)

    def _build(self, room: int) -> None:
        """The program with room for so many cuts."""
        n, self.room = len(self.cap), room
        self.s, self.xi = cp.Variable(n, nonneg=True), cp.Variable(room, nonneg=True)
        self.D, self.b = cp.Parameter((room, n)), cp.Parameter(room)
        self.low, self.high = cp.Parameter(n), cp.Parameter(n, nonneg=True)
        integer = self.sites is not None or bool(self.cost_site.any())
        self.z = cp.Variable(n, boolean=True) if integer else None
        scale = float(np.max(self.cost_mw * self.cap + self.cost_site)) or 1.0
        constraints = [self.D @ self.s >= self.b - self.xi, self.s >= self.low, self.s <= self.high]
        cost = (self.cost_mw * self.cap / scale) @ self.s + SLACK * cp.sum(self.xi)
        if self.z is not None:
            constraints.append(self.s <= self.z)
            cost += (self.cost_site / scale) @ self.z
            if self.sites is not None:
                constraints.append(cp.sum(self.z) <= self.sites)
        self.problem = cp.Problem(cp.Minimize(cost), constraints)
        assert self.problem.is_dpp()

    def cost(self, mw: np.ndarray) -> float:
        """Cost of a fleet."""
        return float(self.cost_mw @ mw + self.cost_site @ (mw > 0))

    def allows(self, mw: np.ndarray) -> bool:
        """Whether a fleet has few enough sites."""
        return self.sites is None or int((mw > 0).sum()) <= self.sites

    def solve(self, cuts: list[Cut], best: np.ndarray | None = None, radius: float = np.inf) -> Plan:
        """The cheapest fleet within `radius` (MW) of `best`; raises StudyError if the solver finds none."""
        if len(cuts) > self.room:
            self._build(2 * len(cuts))
        if not all(np.isfinite([*cut.gradient, cut.bound]).all() for cut in cuts):
            raise StudyError("The siting program has a cut with a number that is not finite; check costs and caps.")
        D, b = np.zeros(self.D.shape), np.full(self.room, -1.0)
        for row, cut in enumerate(cuts):
            contribution = cut.gradient * self.cap
            most = np.abs(contribution).max() or 1.0
            D[row], b[row] = contribution / most, cut.bound / most
        unit = np.where(self.cap > 0, self.cap, 1.0)
        low, high = np.zeros(len(unit)), self.cap
        if best is not None and radius < np.inf:
            low, high = np.maximum(best - radius, 0), np.minimum(best + radius, self.cap)
        self.low.value, self.high.value = low / unit, high / unit
        self.D.value, self.b.value = D, b
        try:
            self.problem.solve(solver=cp.CLARABEL if self.z is None else cp.HIGHS)
        except cp.SolverError as error:
            raise StudyError(
                f"The siting program with {len(cuts)} cuts could not be solved ({error}); check costs and caps."
            ) from None
        if self.problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
            raise StudyError(f"The siting program is {self.problem.status}; check costs, caps and number of sites.")
        share, slack = np.asarray(self.s.value), np.asarray(self.xi.value)
        mw = np.where(share > NOTHING, np.clip(share, 0, 1) * self.cap, 0.0)
        return Plan(mw, self.cost(mw), float(slack.max()))
