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
        Frames within the fault; they fill it.
    rate
        Frames per second.
    orders
        Orders (frames, devices) in ratings.
    """

    k: int
    before: int
    rate: float
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
        Least number of frames per second.
    after
        Frames from clearing on.
    """

    trial: Trial
    law: BangBang
    rate: int
    after: int

    def frames(self, k: int) -> tuple[int, float]:
        """Frames within a fault of a duration on the grid, and frames per second: one begins at fault and clearing.

        A fault shorter than a frame has none.
        """
        length = self.trial.duration(k)
        if length * self.rate < 1 - 1e-9:
            return 0, float(self.rate)
        before = math.ceil(length * self.rate - 1e-9)
        return before, before / length

    def plan(self, k: int, known: Plan) -> Plan:
        """The orders of another duration: those from clearing on keep their time, the first one is repeated."""
        before, rate = self.frames(k)
        middle = (np.arange(-before, self.after) + 0.5) / rate
        rows = np.floor(middle * known.rate).astype(int) + known.before
        return Plan(k, before, rate, known.orders[np.clip(rows, 0, len(known.orders) - 1)])

    def of_run(self, k: int, run: Trajectory, at: float) -> Plan:
        """The mean orders of a run in every frame; the fault began at `at` (s)."""
        before, rate = self.frames(k)
        start = at + self.trial.duration(k) - before / rate
        frame = np.floor((run.time - start) * rate + 1e-6)
        rows = [run.arrays.order[frame == n] for n in range(before + self.after)]
        none = np.zeros((1, run.arrays.order.shape[1]))
        return Plan(k, before, rate, np.array([(r if len(r) else none).mean(axis=0) for r in rows]))

    def schedule(self, plan: Plan) -> Schedule:
        """The schedule of a plan; a frame begins at the instant of clearing."""
        start = (self._cleared(plan) - plan.before) / plan.rate
        return Schedule(plan.orders, rate=plan.rate, start=start, min_voltage=self.law.min_voltage, law=self.law)

    def under(self, plan: Plan) -> Trial:
        """The contingency under a plan."""
        quiet = self._cleared(plan) / plan.rate - self.trial.duration(plan.k) - self._earliest
        return replace(self.trial, control=self.schedule(plan), quiet=max(quiet, 0.0))

    @property
    def _earliest(self) -> float:
        """The earliest instant of the fault, s: other events may come before it."""
        return replace(self.trial, control=None).at

    def _cleared(self, plan: Plan) -> int:
        """The frame of the simulation that begins at clearing."""
        return math.ceil((self._earliest + self.trial.duration(plan.k)) * plan.rate - 1e-9)

    def run(self, plan: Plan) -> Trajectory:
        """The recorded run of a plan."""
        return self.under(plan).simulate(plan.k, record=True)

    def proof(self, plan: Plan) -> Run:
        """What the run of a plan shows, as every search of clearing times judges it."""
        return self.under(plan).attempt(plan.k)
