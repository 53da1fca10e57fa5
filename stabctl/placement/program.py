"""Support-cut program: the cheapest fleet that survives every contingency, approached by cuts found by simulation.

The fleets that survive a contingency are taken to lie on one side of a plane through each fleet found on the border.
The master minimizes the cost under these cuts near the best fleet known; its answer is scaled until it survives
everything, and taken where that is cheaper, else the trust radius shrinks. A cut from afar that a surviving fleet
contradicts is moved back to that fleet.
"""

from dataclasses import dataclass, field

import numpy as np

from . import cut_gradients
from .master import Cut, Master
from .scaling import Scaled, critical_scaling, least, reach
from .siting import Round
from .trials import Trials

BINDING = 0.97  # of the largest critical scaling, from which a contingency gets a cut
TOLERANCE = 2e-3  # relative gain of cost that is not worth another round
ROUNDS = 40
FINAL = 1e-4  # relative width of the last scaling
SAME = 1e-3  # of the largest size, by which two fleets on a border are one


@dataclass
class Search:
    """What is known so far."""

    trials: Trials
    master: Master
    J: np.ndarray  # (machines, candidates) dPe_j / dP_i
    cuts: list[Cut] = field(default_factory=list)
    borders: list[tuple[int, np.ndarray]] = field(default_factory=list)  # contingency, a fleet that just survives it
    best: np.ndarray | None = None
    cost: float = np.inf
    history: list[Round] = field(default_factory=list)

    @property
    def bound(self) -> float:
        """Cost of the cheapest fleet that the cuts allow."""
        return min(self.master.solve(self._trusted(np.inf)).cost, self.cost)

    def accept(self, mw: np.ndarray) -> bool:
        """Take a fleet that survives everything where it is cheaper than the best one and has few enough sites."""
        mw = self.trials.fleet(mw)
        cost = self.master.cost(mw)
        if cost >= self.cost or not self.master.allows(mw):
            return False
        self.best, self.cost = mw, cost
        return True

    def cut(self, mw: np.ndarray, k: int) -> None:
        """Cut at a fleet (candidates, MW) on the border of contingency k."""
        mw = self.trials.fleet(mw)
        near = SAME * mw.max()
        if any(cut.contingency == k and np.abs(cut.at - mw).max() < near for cut in self.cuts):
            return
        self.borders.append((k, mw))
        d = cut_gradients.by_peak(self.trials, mw, k)
        if d is None:
            d = cut_gradients.by_scaling(self.trials, mw, k)
        if d is None:
            d = cut_gradients.by_swept_angle(self.trials, mw, k, self.J)
        if d is not None:
            self.cuts.append(Cut(k, d, 1.0, mw))

    def cut_near(self, mw: np.ndarray, scaled: Scaled | None) -> None:
        """Cuts at the borders on the ray of a fleet: of what binds, or of everything where no multiple survives all."""
        if scaled is None:
            most = reach(self.trials, mw)
            found = self.trials.each(lambda k: critical_scaling(lambda a: self.trials.survives(a * mw, k), most))
            for k, a in enumerate(found):
                if a:
                    self.cut(a * mw, k)
            return
        for k, a in scaled.near.items():
            if a >= BINDING * scaled.scaling:
                self.cut(a * mw, k)
            else:
                self.borders.append((k, self.trials.fleet(a * mw)))

    def run(self) -> None:
        """Rounds of master and trials until no gain is to be expected; then small sites are left out where possible."""
        radius = np.inf
        for _ in range(ROUNDS):
            plan = self.master.solve(self._trusted(radius), self.best, radius)
            if plan.cost > (1 - TOLERANCE) * self.cost or not plan.mw.any():
                break
            scaled = least(self.trials, plan.mw)
            reached = self.trials.fleet(scaled.scaling * plan.mw) if scaled else None
            taken = reached is not None and self.accept(reached)
            self.cut_near(plan.mw, scaled)
            cost = np.inf if reached is None else self.master.cost(reached)
            sites = 0 if self.best is None else int((self.best > 0).sum())
            self.history.append(Round(plan.cost, cost, self.cost, sites))
            if taken:
                radius *= 2
            elif self.best is not None:
                radius = min(radius, np.abs(plan.mw - self.best).max()) / 2
                if radius < TOLERANCE * self.best.max():
                    break
        if self.best is not None:
            self._tidy()

    def _trusted(self, radius: float) -> list[Cut]:
        """The cuts; those from afar moved back to what is known to survive their contingencies."""
        known = [*self.borders]
        if self.best is not None:
            known += [(k, self.best) for k in range(len(self.trials.contingencies))]
        cuts = []
        for cut in self.cuts:
            near = self.best is not None and np.abs(cut.at - self.best).max() <= 2 * radius < np.inf
            fleets = (mw for k, mw in known if k == cut.contingency and (mw is self.best or not near))
            reached = min((float(cut.normal @ mw) for mw in fleets), default=np.inf)
            cuts.append(cut._replace(bound=min(cut.bound, reached)))
        return cuts

    def _tidy(self) -> None:
        """Scale the best fleet finely; leave a site out where the rest, scaled again, costs no more."""
        for i in np.argsort(self.best):
            if 0 < self.best[i] < self.best.max():
                rest = self.best.copy()
                rest[i] = 0.0
                scaled = least(self.trials, rest)
                if scaled is None:
                    continue
                fleet = self.trials.fleet(scaled.scaling * rest)
                cost = self.master.cost(fleet)
                if cost <= (1 + TOLERANCE) * self.cost:
                    self.best, self.cost = fleet, cost
        scaled = least(self.trials, self.best, FINAL)
        if scaled:
            self.accept(scaled.scaling * self.best)
