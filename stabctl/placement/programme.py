"""Support-cut programme: the cheapest fleet that survives every contingency, approached by cuts found by simulation.

The fleets that survive a contingency are taken to lie on one side of a plane through each fleet found on the border.
The master minimises the cost under these cuts near the best fleet known; its answer is scaled until it survives
everything, and taken where that is cheaper. Cuts that a surviving fleet contradicts are moved back to it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from . import normals
from .master import Cut, Master
from .scaling import FINE, Scaled, critical_scaling, least, reach
from .trials import Trials

BINDING = 0.97  # of the largest critical scaling, from which a contingency gets a cut
TOLERANCE = 1e-3  # relative gain of cost that is not worth another round
ROUNDS = 40
FINAL = 1e-4  # relative width of the final scaling
SMALL = 0.02  # share of the fleet below which a site is tried to be left out


class Step(NamedTuple):
    """A round of the programme."""

    bound: float  # cost of the master's answer
    cost: float  # of the same, scaled to survive; inf where it cannot be
    best: float  # cost of the best fleet so far
    sites: int  # of the best fleet


@dataclass
class Search:
    """What is known so far: cuts, fleets on the borders, the best fleet, what was done."""

    trials: Trials
    master: Master
    J: np.ndarray  # (machines, candidates)
    cuts: list[Cut] = field(default_factory=list)
    borders: list[tuple[int, np.ndarray]] = field(default_factory=list)  # contingency, a fleet that survives it
    best: np.ndarray | None = None
    cost: float = np.inf
    history: list[Step] = field(default_factory=list)
    progress: Callable[[float], None] | None = None

    def border(self, mw: np.ndarray, k: int) -> None:
        """Cut at a fleet (candidates, MW) on the border of contingency k."""
        mw = self.trials.fleet(mw)
        self.borders.append((k, mw))
        d = normals.by_peak(self.trials, mw, k)
        if d is None:
            d = normals.by_scaling(self.trials, mw, k)
        if d is None:
            d = normals.by_swept_angle(self.trials, mw, k, self.J)
        if d is not None:
            self.cuts.append(Cut(k, d, 1.0, mw))

    def accept(self, mw: np.ndarray) -> bool:
        """Take a fleet that survives everything where it is cheaper than the best one."""
        mw, cost = self.trials.fleet(mw), self.master.cost(self.trials.fleet(mw))
        if cost >= self.cost:
            return False
        self.best, self.cost = mw, cost
        return True

    def trusted(self, radius: float) -> list[Cut]:
        """The cuts, those from afar moved back to what is known to survive their contingencies."""
        known = self.borders + [(k, self.best) for k in range(len(self.trials.contingencies)) if self.best is not None]
        cuts = []
        for cut in self.cuts:
            afar = self.best is None or np.abs(cut.at - self.best).max() > 2 * radius or radius == np.inf
            fleets = (mw for k, mw in known if k == cut.contingency and (afar or mw is self.best))
            reached = min((float(cut.normal @ mw) for mw in fleets), default=np.inf)
            cuts.append(cut._replace(bound=min(cut.bound, reached)))
        return cuts

    def run(self) -> None:
        """Rounds of master and trials until no gain is to be expected."""
        radius = np.inf
        for _ in range(ROUNDS):
            plan = self.master.solve(self.trusted(radius), self.best, radius)
            if plan.cost > (1 - TOLERANCE) * self.cost:
                break
            scaled = least(self.trials, plan.mw) if plan.mw.any() else None
            reachd = self.master.cost(self.trials.fleet(scaled.scaling * plan.mw)) if scaled else np.inf
            taken = self.accept(scaled.scaling * plan.mw) if scaled else False
            self.cut_near(plan.mw, scaled)
            self.history.append(Step(plan.cost, reachd, self.cost, int((self.best > 0).sum()) if self.best is not None else 0))
            if self.progress:
                self.progress(self.cost)
            if not taken and self.best is not None:
                radius = min(radius, np.abs(plan.mw - self.best).max()) / 2
                if radius < TOLERANCE * self.best.max():
                    break

    def cut_near(self, mw: np.ndarray, scaled: Scaled | None) -> None:
        if scaled is not None:
            for k, a in scaled.near.items():
                if a >= BINDING * scaled.scaling:
                    self.border(a * mw, k)
                else:
                    self.borders.append((k, self.trials.fleet(a * mw)))
            return
        most = reach(self.trials, mw)
        for k in range(len(self.trials.contingencies)):
            if most:
                a = critical_scaling(lambda x, k=k: self.trials.survives(x * mw, k), most, fine=FINE)
                if a:
                    self.border(a * mw, k)
