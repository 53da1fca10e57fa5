"""Cutting planes: the cheapest fleet that survives every contingency, approached by cuts found by simulation.

The fleets that survive a contingency are assumed to lie on one side of a plane through each fleet found on the
boundary. The master program minimizes the cost under these cuts near the best fleet known. Its plan is scaled until it
survives everything, and becomes the best fleet if it is cheaper; otherwise the trust radius shrinks. A cut found far
from the best fleet that a surviving fleet contradicts is moved back to that fleet.
"""

from dataclasses import dataclass, field

import numpy as np

from . import cut_gradients
from .master import Cut, Master
from .scaling import Scaled, critical_scaling, largest_scaling, least_scaling
from .siting import Iteration
from .trials import Trials

BINDING = 0.97  # of the largest critical scaling, from which a contingency gets a cut
TOLERANCE = 2e-3  # relative reduction of the cost below which the iteration stops
ITERATIONS = 40
FINAL = 1e-4  # relative width of the last scaling
SAME = 1e-3  # of the largest size: fleets on a boundary that are closer count as one


@dataclass
class CuttingPlanes:
    """The cuts and the best fleet so far."""

    trials: Trials
    master: Master
    J: np.ndarray  # (machines, candidates) dPe_j / dP_i
    cuts: list[Cut] = field(default_factory=list)
    boundary: list[tuple[int, np.ndarray]] = field(default_factory=list)  # contingency, a fleet that just survives it
    best: np.ndarray | None = None
    cost: float = np.inf
    history: list[Iteration] = field(default_factory=list)

    @property
    def bound(self) -> float:
        """Cost of the cheapest fleet that satisfies the cuts."""
        return min(self.master.solve(self._trusted(np.inf)).cost, self.cost)

    def accept(self, mw: np.ndarray) -> bool:
        """Take a fleet that survives everything as the best one, if it is cheaper and has few enough sites."""
        mw = self.trials.fleet(mw)
        cost = self.master.cost(mw)
        if cost >= self.cost or not self.master.allows(mw):
            return False
        self.best, self.cost = mw, cost
        return True

    def cut(self, mw: np.ndarray, k: int) -> None:
        """Add a cut at a fleet (candidates, MW) on the boundary of contingency k."""
        mw = self.trials.fleet(mw)
        near = SAME * mw.max()
        if any(cut.contingency == k and np.abs(cut.at - mw).max() < near for cut in self.cuts):
            return
        self.boundary.append((k, mw))
        d = cut_gradients.by_peak(self.trials, mw, k)
        if d is None:
            d = cut_gradients.by_scaling(self.trials, mw, k)
        if d is None:
            d = cut_gradients.by_swept_angle(self.trials, mw, k, self.J)
        if d is not None:
            self.cuts.append(Cut(k, d, 1.0, mw))

    def cut_along(self, mw: np.ndarray, scaled: Scaled | None) -> None:
        """Add cuts where the multiples of a fleet meet the boundary: of binding contingencies, or of all without any.

        `scaled` is the smallest multiple that survives everything; without one every contingency gets its cut.
        """
        if scaled is None:
            most = largest_scaling(self.trials, mw)
            found = self.trials.each(lambda k: critical_scaling(lambda a: self.trials.survives(a * mw, k), most))
            for k, a in enumerate(found):
                if a:
                    self.cut(a * mw, k)
            return
        for k, a in scaled.near.items():
            if a >= BINDING * scaled.scaling:
                self.cut(a * mw, k)
            else:
                self.boundary.append((k, self.trials.fleet(a * mw)))

    def run(self) -> None:
        """Iterate master program and simulations until the cost no longer falls; then drop small sites if possible."""
        radius = np.inf
        for _ in range(ITERATIONS):
            plan = self.master.solve(self._trusted(radius), self.best, radius)
            if plan.cost > (1 - TOLERANCE) * self.cost or not plan.mw.any():
                break
            scaled = least_scaling(self.trials, plan.mw)
            reached = self.trials.fleet(scaled.scaling * plan.mw) if scaled else None
            accepted = reached is not None and self.accept(reached)
            self.cut_along(plan.mw, scaled)
            cost = np.inf if reached is None else self.master.cost(reached)
            sites = 0 if self.best is None else int((self.best > 0).sum())
            self.history.append(Iteration(plan.cost, cost, self.cost, sites))
            if accepted:
                radius *= 2
            elif self.best is not None:
                radius = min(radius, np.abs(plan.mw - self.best).max()) / 2
                if radius < TOLERANCE * self.best.max():
                    break
        if self.best is not None:
            self._drop_sites()

    def _trusted(self, radius: float) -> list[Cut]:
        """The cuts; those found far away are moved back to fleets known to survive their contingencies."""
        known = [*self.boundary]
        if self.best is not None:
            known += [(k, self.best) for k in range(len(self.trials.contingencies))]
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
                scaled = least_scaling(self.trials, rest)
                if scaled is None:
                    continue
                fleet = self.trials.fleet(scaled.scaling * rest)
                cost = self.master.cost(fleet)
                if cost <= (1 + TOLERANCE) * self.cost:
                    self.best, self.cost = fleet, cost
        scaled = least_scaling(self.trials, self.best, FINAL)
        if scaled:
            self.accept(scaled.scaling * self.best)
