"""Cutting planes: the cheapest fleet that survives every contingency, by a master program and cuts from simulations.

The fleets that survive a contingency are assumed to lie on one side of a plane through each fleet found on the
boundary. The master program minimizes the cost under these cuts near the best fleet known. Its plan is scaled until it
survives everything, and becomes the best fleet if it is cheaper; otherwise the trust radius shrinks. A cut found far
from the best fleet that a surviving fleet contradicts is moved back to that fleet. At last the program is solved
without the trust region, and its plan is visited in the same way while that raises the cost that the cuts allow.

The energy that a MW needs depends on the whole fleet. A fleet is compared at its own energies, and the master program
takes the MWh per MW of the best fleet, or where it has no device of the uniform fleet.

The master program is

    min  c's + f'z + rho 1'xi
    s.t. D s >= b - xi,  0 <= s <= cap z,  |s - best| <= radius,  xi >= 0
         0 <= z <= 1 (a linear program, Clarabel), or z of 0 and 1 with at most K of them (HiGHS, by SciPy)
         s_i = module_i n_i, n_i a whole number, where sizes are multiples of a module (HiGHS, by SciPy)

Internally a size is a share of its cap, and a cut is divided by the largest contribution of one device, so that the
program is well scaled.
"""

import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import chain
from typing import NamedTuple

import cvxpy as cp
import numpy as np

from stabctl._util.errors import StudyError

from . import _scaling
from ._scaling import Scaled, along, critical_scaling, largest_scaling, least_scaling
from .contingencies import Scenario
from .evidence import energies
from .site_options import Prices
from .siting import Iteration
from .trials import Trials

BINDING = 0.97  # of the largest critical scaling, from which a contingency gets a cut
TOLERANCE = 2e-3  # relative reduction of the cost below which the iteration stops
RISE = 5e-4  # of the cost, by which what the cuts allow must rise for another visit
ITERATIONS = 40
FINAL = 1e-4  # relative width of the last scaling
SAME = 1e-3  # of the largest size: fleets on a boundary that are closer count as one
FIRM = 1.0, 1.001, 1.002, 1.003, 1.005  # multiples of the final fleet that survive too
LITTLE = 1.01  # times the best fleet, at most, for that
MORE = 1.0, 1.001, 1.002, 1.005, 1.01, 1.02, 1.05, 1.1  # multiples tried when rounded sizes do not survive
SLACK = 1e3  # rho, relative to the largest cost of a cap
NOTHING = 1e-6  # of a cap
WHOLE = 1e-6  # of a module
DECIMALS = 2  # of a MW, as sizes are printed; more in systems of a few MW
LARGE = 10.0  # MW   a cap from which two decimals are enough
SMALL = 1e-6  # of the last decimal that is printed: rounding of the computer


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


class Unsolved(Exception):
    """The solver found no solution; the message says why."""


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


@dataclass
class CuttingPlanes:
    """The cuts and the best fleet so far."""

    trials: Trials
    master: Master
    J: tuple[np.ndarray, ...]  # of every operating point (machines, candidates) dPe_j / dP_i
    prices: Prices
    hours: np.ndarray  # (candidates) MWh that a MW needs
    cuts: list[Cut] = field(default_factory=list)
    boundary: list[tuple[int, np.ndarray]] = field(default_factory=list)  # contingency, a fleet that just survives it
    survivors: list[np.ndarray] = field(default_factory=list)  # fleets that survive everything
    best: np.ndarray | None = None
    cost: float = np.inf
    energy: np.ndarray | None = None  # (candidates) MWh of the best fleet, once it is final
    history: list[Iteration] = field(default_factory=list)

    @property
    def bound(self) -> float | None:
        """Cost of the cheapest fleet that satisfies the cuts; None if the solver fails."""
        try:
            return min(self.master.solve(self._valid()).cost, self.cost)
        except Unsolved:
            return None

    def accept(self, mw: np.ndarray) -> float:
        """The cost of a fleet that survives everything, which becomes the best one if it is cheaper than that.

        Infinite for a fleet with too many sites.
        """
        mw = self.trials.fleet(mw)
        if not self.master.allows(mw):
            return np.inf
        energy = self.energies(mw)
        cost = self.prices.cost(mw, energy)
        if cost < self.cost:
            self.take(mw, energy)
        else:
            self.survivors.append(mw)
        return cost

    def take(self, mw: np.ndarray, energy: np.ndarray) -> None:
        """Make a fleet (candidates, MW) with its energies (candidates, MWh) the best one."""
        self.best, self.cost = mw, self.prices.cost(mw, energy)
        self.survivors.append(mw)
        self.hours = np.where(mw > 0, energy / np.where(mw > 0, mw, 1.0), self.hours)
        self.master.cost_mw = self.prices.per_mw(self.hours)

    def energies(self, mw: np.ndarray) -> np.ndarray:
        """The energy capacities (candidates, MWh) of a fleet; zeros if they have no price."""
        return energies(self.trials, mw) if self.prices.mwh.any() else np.zeros(len(mw))

    def cut(self, mw: np.ndarray, k: int) -> None:
        """Add a cut at a fleet (candidates, MW) on the boundary of contingency k."""
        mw = self.trials.fleet(mw)
        near = SAME * mw.max()
        if any(cut.contingency == k and np.abs(cut.at - mw).max() < near for cut in self.cuts):
            return
        self.boundary.append((k, mw))
        d = _scaling.by_peak(self.trials, mw, k)
        if d is None:
            d = _scaling.by_scaling(self.trials, mw, k)
        if d is None:
            d = _scaling.by_swept_angle(self.trials, mw, k, self.J[self.trials.scenarios[k].point])
        if d is not None:
            self.cuts.append(Cut(k, d, 1.0, mw))

    def cut_along(self, mw: np.ndarray, scaled: Scaled | None) -> None:
        """Add cuts where the multiples of a fleet meet the boundary: of binding contingencies, or of all without any.

        `scaled` is the smallest multiple that survives everything; without one every contingency gets its cut.
        """
        if scaled is None:
            most = largest_scaling(self.trials, mw)
            found = self.trials.each(lambda k: critical_scaling(along(self.trials, mw, k), most))
            for k, a in enumerate(found):
                if a:
                    self.cut(a * mw, k)
            return
        for k, a in scaled.near.items():
            if a >= BINDING * scaled.scaling:
                self.cut(a * mw, k)
            else:
                self.boundary.append((k, self.trials.fleet(a * mw)))

    def require(self, scenarios: Iterable[Scenario]) -> None:
        """Add scenarios to be survived; the best fleet becomes the cheapest known one that survives them too.

        Otherwise it is the smallest multiple of the former one that does, if there is any.
        """
        assert self.best is not None
        former, known = self.best, self.survivors
        self.trials = self.trials.among((*self.trials.scenarios, *scenarios))
        self.best, self.cost, self.survivors = None, np.inf, []
        for mw in known:
            if self.trials.all_survived(mw):
                self.accept(mw)
        scaled = least_scaling(self.trials, former)
        self.cut_along(former, scaled)
        if scaled is not None and (fleet := self.buildable(scaled.scaling * former)) is not None:
            self.accept(fleet)

    def run(self) -> None:
        """Approach the cheapest fleet, tighten the cuts, and make the best fleet one that can be built."""
        self.approach()
        if self.best is not None:
            self._tighten()
            self._drop_sites()
            self._round()

    def approach(self) -> None:
        """Iterate master program and simulations until the cost no longer falls."""
        radius = np.inf
        for _ in range(ITERATIONS):
            plan = self._plan(self._trusted(radius), radius)
            if plan is None or plan.cost > (1 - TOLERANCE) * self.cost or not plan.mw.any():
                break
            before = self.cost
            self._visit(plan)
            if self.cost < before:
                radius *= 2
            elif self.best is not None:
                radius = min(radius, np.abs(plan.mw - self.best).max()) / 2
                if radius < TOLERANCE * self.best.max():
                    break

    def _tighten(self) -> None:
        """Visit the cheapest fleet that satisfies the cuts, wherever it is, as long as that raises its cost."""
        bound = -np.inf
        for _ in range(ITERATIONS):
            plan = self._plan(self._valid())
            if plan is None or plan.cost < bound + RISE * self.cost or not plan.mw.any():
                break
            if plan.cost > (1 - TOLERANCE) * self.cost:
                break
            bound = plan.cost
            self._visit(plan)

    def _plan(self, cuts: list[Cut], radius: float = np.inf) -> Plan | None:
        """The plan of the master program; None if the solver fails, which is kept in the history."""
        try:
            return self.master.solve(cuts, self.best, radius)
        except Unsolved as reason:
            self._record(np.nan, np.inf, str(reason), np.nan)
            return None

    def _visit(self, plan: Plan) -> None:
        """Scale a plan until it survives everything, accept that fleet if it is cheaper, and cut at the boundary."""
        scaled = least_scaling(self.trials, plan.mw)
        reached = None if scaled is None else self.buildable(scaled.scaling * plan.mw)
        cost = np.inf if reached is None else self.accept(reached)
        self.cut_along(plan.mw, scaled)
        self._record(plan.cost, cost, plan.status, plan.slack)

    def _record(self, planned: float, reached: float, status: str, slack: float) -> None:
        sites = 0 if self.best is None else int((self.best > 0).sum())
        self.history.append(Iteration(planned, reached, self.cost, sites, status, slack))

    def buildable(self, mw: np.ndarray) -> np.ndarray | None:
        """The fleet in whole modules, slightly larger if it does not survive everything; None if none does."""
        fleets = (self.master.built(more * mw) for more in MORE)
        return next((fleet for fleet in fleets if self.trials.all_survived(fleet)), None)

    def _valid(self) -> list[Cut]:
        """The cuts, moved back to the fleets known to survive everything that they would exclude."""
        reached = [min(float(cut.gradient @ mw) for mw in self.survivors) for cut in self.cuts]
        return [cut._replace(bound=min(cut.bound, b)) for cut, b in zip(self.cuts, reached, strict=True)]

    def _trusted(self, radius: float) -> list[Cut]:
        """The cuts; those found far away are moved back to fleets known to survive their contingencies."""
        known = [*self.boundary]
        if self.best is not None:
            known += [(k, self.best) for k in range(len(self.trials.scenarios))]
        cuts = []
        for cut in self.cuts:
            near = self.best is not None and np.abs(cut.at - self.best).max() <= 2 * radius < np.inf
            fleets = (mw for k, mw in known if k == cut.contingency and (mw is self.best or not near))
            reached = min((float(cut.gradient @ mw) for mw in fleets), default=np.inf)
            cuts.append(cut._replace(bound=min(cut.bound, reached)))
        return cuts

    def _drop_sites(self) -> None:
        """Drop sites if the others, scaled again, cost no more; then scale the best fleet accurately."""
        assert self.best is not None
        for i in np.argsort(self.best):
            if 0 < self.best[i] < self.best.max():
                rest = self.best.copy()
                rest[i] = 0.0
                most = self.prices.affordable(rest, (1 + TOLERANCE) * self.cost)
                if most < np.inf and not self.trials.all_survived(most * rest):
                    continue
                scaled = least_scaling(self.trials, rest)
                fleet = None if scaled is None else self.buildable(scaled.scaling * rest)
                if fleet is None:
                    continue
                energy = self.energies(fleet)
                if self.prices.cost(fleet, energy) <= (1 + TOLERANCE) * self.cost:
                    self.take(fleet, energy)
        scaled = least_scaling(self.trials, self.best, FINAL)
        if scaled and (fleet := self.buildable(scaled.scaling * self.best)) is not None:
            self.accept(fleet)

    def _round(self) -> None:
        """Round the best fleet and its energies up to the digits that are printed; the fleet still survives.

        So do slightly larger ones, if possible: at the very boundary survival depends on the rounding of a simulation,
        and on whether there are further devices of 0 MW.
        """
        assert self.best is not None
        digits = decimals(self.trials.cap)
        fleets = [self.trials.fleet(up(self.master.built(more * self.best), digits)) for more in MORE]
        near = (mw for mw in fleets if mw.sum() <= LITTLE * self.best.sum())
        alone = self.trials.alone()
        firm = (mw for mw in near if all(alone.all_survived(more * mw) for more in FIRM))
        found = next(chain(firm, filter(alone.all_survived, fleets)), self.best)
        self.energy = up(energies(alone, found), digits + 2)
        self.take(found, self.energy)


def decimals(cap: np.ndarray) -> int:
    """Decimals of a size in MW: two, or with caps (candidates, MW) of a few MW as many as give six digits."""
    return DECIMALS if cap.max() >= LARGE else 5 - int(np.floor(np.log10(cap.max())))


def up(values: np.ndarray, digits: int) -> np.ndarray:
    """The values at so many decimals, none smaller."""
    return np.round(np.ceil(values * 10.0**digits - SMALL) / 10.0**digits, digits)


def down(values: np.ndarray, digits: int) -> np.ndarray:
    """The values at so many decimals, none larger."""
    return np.round(np.floor(values * 10.0**digits + SMALL) / 10.0**digits, digits)
