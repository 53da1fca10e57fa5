"""A contingency under a schedule of storage orders: frames that begin at the instant of clearing, and its runs."""

import math
from dataclasses import dataclass, replace

import numpy as np

from stabctl.clearing.trial import Run, Trial
from stabctl.controllers import BangBang
from stabctl.simulation.schedule import Schedule
from stabctl.simulation.trajectory import Trajectory


@dataclass(frozen=True)
class Plan:
    """Orders for a fault of one duration.

    Attributes
    ----------
    k
        Duration of the fault, as point of the grid of clearing times.
    before
        Frames before clearing, all of them within the fault.
    orders
        Orders (frames, devices) in ratings.
    """

    k: int
    before: int
    orders: np.ndarray


@dataclass(frozen=True)
class Scheduled:
    """The runs of a contingency under schedules.

    Attributes
    ----------
    trial
        The contingency under the law that takes over after a schedule.
    law
        That law; its lowest voltage is also that of the schedule.
    rate
        Frames per second.
    after
        Frames from clearing on.
    """

    trial: Trial
    law: BangBang
    rate: int
    after: int

    def before(self, k: int) -> int:
        """Frames within a fault of a duration on the grid."""
        return math.floor(self.trial.duration(k) * self.rate + 1e-9)

    def plan(self, k: int, known: Plan) -> Plan:
        """The orders of another duration: those from clearing on stay; the first one is repeated, or left out."""
        before = self.before(k)
        rows = np.arange(-before, self.after) + known.before
        return Plan(k, before, known.orders[np.clip(rows, 0, None)])

    def of_run(self, k: int, run: Trajectory, at: float) -> Plan:
        """The mean orders of a run in every frame; the fault began at `at` (s)."""
        before = self.before(k)
        start = at + self.trial.duration(k) - before / self.rate
        frame = np.floor((run.time - start) * self.rate + 1e-6)
        rows = [run.arrays.order[frame == n] for n in range(before + self.after)]
        none = np.zeros((1, run.arrays.order.shape[1]))
        return Plan(k, before, np.array([(r if len(r) else none).mean(axis=0) for r in rows]))

    def schedule(self, plan: Plan) -> Schedule:
        """The schedule of a plan; a frame begins at the instant of clearing."""
        start = (self._cleared(plan.k) - plan.before) / self.rate
        return Schedule(plan.orders, rate=self.rate, start=start, min_voltage=self.law.min_voltage, law=self.law)

    def under(self, plan: Plan) -> Trial:
        """The contingency under a plan."""
        quiet = self._cleared(plan.k) / self.rate - self.trial.duration(plan.k) - self._earliest
        return replace(self.trial, control=self.schedule(plan), quiet=quiet)

    @property
    def _earliest(self) -> float:
        """The earliest instant of the fault, s: other events may come before it."""
        return replace(self.trial, control=None).at

    def _cleared(self, k: int) -> int:
        """The frame of the simulation that begins at clearing."""
        return math.ceil((self._earliest + self.trial.duration(k)) * self.rate - 1e-9)

    def run(self, plan: Plan) -> Trajectory:
        """The recorded run of a plan."""
        return self.under(plan).simulate(plan.k, record=True)

    def proof(self, plan: Plan) -> Run:
        """What the run of a plan shows, as every search of clearing times judges it."""
        return self.under(plan).attempt(plan.k)
