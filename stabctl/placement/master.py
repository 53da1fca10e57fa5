"""The master program: the cheapest fleet that satisfies every cut, near the best fleet known.

    min  c's + f'z + rho 1'xi
    s.t. D s >= b - xi,  0 <= s <= cap z,  |s - best| <= radius,  xi >= 0
         0 <= z <= 1 (a linear program, Clarabel), or z of 0 and 1 with at most K of them (HiGHS, by SciPy)
         s_i = module_i n_i, n_i a whole number, where sizes are multiples of a module (HiGHS, by SciPy)

Internally a size is a share of its cap, and a cut is divided by the largest contribution of one device, so that the
program is well scaled.
"""

import warnings
from typing import NamedTuple

import cvxpy as cp
import numpy as np

from stabctl.errors import StudyError

SLACK = 1e3  # rho, relative to the largest cost of a cap
NOTHING = 1e-6  # of a cap
WHOLE = 1e-6  # of a module


class Unsolved(Exception):
    """The solver found no solution; the message says why."""


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
    status: str = "optimal"  # of the solver; "optimal_inaccurate" if it missed its own tolerances


class Master:
    """The program, built once for a number of candidates; prices, cuts, center and radius are parameters.

    Parameters
    ----------
    cap : (candidates,) array, MW
        Largest sizes.
    cost_mw, cost_site : (candidates,) array
        Cost of a MW, and of a site. `cost_mw` may change between solutions.
    sites : int, optional
        Largest number of sites; any number by default.
    module : (candidates,) array, MW, optional
        Sizes, and the caps, are multiples of it; 0: any size, the default.
    room : int
        Number of cuts that fit before the program is built again.
    """

    def __init__(
        self,
        cap: np.ndarray,
        cost_mw: np.ndarray,
        cost_site: np.ndarray,
        sites: int | None = None,
        *,
        module: np.ndarray | None = None,
        room: int = 64,
    ) -> None:
        self.module = np.zeros(len(cap)) if module is None else module
        self.cap, self.cost_mw, self.cost_site, self.sites = cap, cost_mw, cost_site, sites
        self._build(room)

    def _build(self, room: int) -> None:
        """The program with room for so many cuts."""
        n, self.room = len(self.cap), room
        self.s, self.xi = cp.Variable(n, nonneg=True), cp.Variable(room, nonneg=True)
        self.D, self.b = cp.Parameter((room, n)), cp.Parameter(room)
        self.low, self.high = cp.Parameter(n), cp.Parameter(n, nonneg=True)
        self.c, self.f = cp.Parameter(n, nonneg=True), cp.Parameter(n, nonneg=True)
        integer = self.sites is not None or bool(self.cost_site.any())
        self.z = cp.Variable(n, boolean=True) if integer else None
        constraints = [self.D @ self.s >= self.b - self.xi, self.s >= self.low, self.s <= self.high]
        cost = self.c @ self.s + SLACK * cp.sum(self.xi)
        if self.z is not None:
            constraints.append(self.s <= self.z)
            cost += self.f @ self.z
            if self.sites is not None:
                constraints.append(cp.sum(self.z) <= self.sites)
        whole = np.flatnonzero((self.module > 0) & (self.cap > 0))
        if whole.size:
            share = self.module[whole] / self.cap[whole]
            constraints.append(self.s[whole] == cp.multiply(share, cp.Variable(whole.size, integer=True)))
        self.solver = cp.CLARABEL if self.z is None and not whole.size else cp.SCIPY
        self.problem = cp.Problem(cp.Minimize(cost), constraints)
        assert self.problem.is_dpp()

    def cost(self, mw: np.ndarray) -> float:
        """Cost of a fleet."""
        return float(self.cost_mw @ mw + self.cost_site @ (mw > 0))

    def allows(self, mw: np.ndarray) -> bool:
        """Whether a fleet has few enough sites."""
        return self.sites is None or int((mw > 0).sum()) <= self.sites

    def built(self, mw: np.ndarray) -> np.ndarray:
        """The smallest fleet of whole modules (candidates, MW) that is at least `mw`, up to the caps."""
        unit = np.where(self.module > 0, self.module, 1.0)
        return np.minimum(np.where(self.module > 0, unit * np.ceil(mw / unit - WHOLE), mw), self.cap)

    def solve(self, cuts: list[Cut], best: np.ndarray | None = None, radius: float = np.inf) -> Plan:
        """The cheapest fleet within `radius` (MW) of `best`.

        Raises
        ------
        Unsolved
            If the solver finds none, with its reason.
        StudyError
            For a cut with a number that is not finite.
        """
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
        scale = float(np.max(self.cost_mw * self.cap + self.cost_site)) or 1.0
        self.low.value, self.high.value = low / unit, high / unit
        self.c.value, self.f.value = self.cost_mw * self.cap / scale, self.cost_site / scale
        self.D.value, self.b.value = D, b
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the plan has the status
                self.problem.solve(solver=self.solver)
        except cp.SolverError as error:
            raise Unsolved(str(error)) from None
        if self.problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
            raise Unsolved(f"the program is {self.problem.status}")
        share, slack = np.asarray(self.s.value), np.asarray(self.xi.value)
        mw = np.where(share > NOTHING, np.clip(share, 0, 1) * self.cap, 0.0)
        return Plan(mw, self.cost(mw), float(slack.max()), self.problem.status)
