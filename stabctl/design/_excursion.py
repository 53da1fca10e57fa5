"""The excursion of the rotors under a schedule of storage orders, and its derivatives.

    excursion = largest |m| + SHARE * mean over time of the sum of m^2

with m the change of the angle of a rotor relative to the center of inertia.

The largest angle is what the criterion of stability limits. The mean asks for a return: near the unstable equilibrium
the largest angle alone does not tell whether a rotor comes back from it.

The orders of a schedule are held for frames, one of which begins at the instant of clearing.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from stabctl.clearing.trial import Run, Trial
from stabctl.controllers import BangBang
from stabctl.simulation.schedule import Schedule
from stabctl.simulation.trajectory import Trajectory

from ._adjoint import Shown, gradients

SHARE = 0.1  # 1/rad
NEAR = 0.6  # of the largest angle; smaller ones are not followed
MOST = 120  # angles followed, besides the largest of every rotor


class Window(NamedTuple):
    """The part of a run that counts."""

    time: np.ndarray  # (rows) s
    frame: np.ndarray  # (rows) frame of the schedule at every row, negative before the first
    moves: np.ndarray  # (rows, rotors) rad
    first: int  # row at which the schedule begins
    acts: np.ndarray  # (frames, devices) whether a device follows its order: the frame does not begin at low voltage

    @property
    def largest(self) -> float:
        """Largest move, rad."""
        return float(np.abs(self.moves).max())

    @property
    def mean(self) -> float:
        """Mean over time of the sum of the squared moves, rad^2."""
        return float((self.moves**2).sum(axis=1).mean())

    @property
    def excursion(self) -> float:
        """The measure that a schedule makes small, rad."""
        return self.largest + SHARE * self.mean


class Slopes(NamedTuple):
    """The excursion around a schedule: moves near the largest ones, and the mean."""

    moves: np.ndarray  # (followed) rad, positive
    of_moves: np.ndarray  # (followed, frames * devices) rad per order
    of_mean: np.ndarray  # (frames * devices) rad^2 per order


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
    length
        Length of a schedule from clearing on, s.
    """

    trial: Trial
    law: BangBang
    rate: int
    length: float

    def frames(self, k: int) -> tuple[int, int, float]:
        """Frames within a fault of a duration on the grid, after it, and per second: one begins at fault and clearing.

        A fault of no duration has none.
        """
        fault = self.trial.duration(k)
        before = math.ceil(fault * self.rate - 1e-9)
        rate = before / fault if fault else float(self.rate)
        return before, max(1, round(self.length * rate)), rate

    def plan(self, k: int, known: Plan) -> Plan:
        """The orders of another duration: those from clearing on keep their time, the first one is repeated."""
        before, after, rate = self.frames(k)
        middle = (np.arange(-before, after) + 0.5) / rate
        rows = np.floor(middle * known.rate).astype(int) + known.before
        return Plan(k, before, rate, known.orders[np.clip(rows, 0, len(known.orders) - 1)])

    def of_run(self, k: int, run: Trajectory, at: float) -> Plan:
        """The mean orders of a run in every frame; the fault began at `at` (s)."""
        before, after, rate = self.frames(k)
        start = at + self.trial.duration(k) - before / rate
        frame = np.floor((run.time - start) * rate + 1e-6)
        rows = [run.arrays.order[frame == n] for n in range(before + after)]
        none = np.zeros((1, run.arrays.order.shape[1]))
        return Plan(k, before, rate, np.array([(r if len(r) else none).mean(axis=0) for r in rows]))

    def schedule(self, plan: Plan) -> Schedule:
        """The schedule of a plan; a frame begins at the instant of clearing."""
        start = (self._cleared(plan) - plan.before) / plan.rate
        return Schedule(plan.orders, rate=plan.rate, start=start, min_voltage=self.law.min_voltage, law=self.law)

    def under(self, plan: Plan) -> Trial:
        """The contingency under a plan, at the instant for which the plan is made."""
        at = max(self._cleared(plan) / plan.rate - self.trial.duration(plan.k), self._earliest)
        events = tuple(replace(e, at=e.at + at) for e in self.trial.others)
        contingency = replace(self.trial.contingency, at=at, events=events)
        return replace(self.trial, contingency=contingency, control=self.schedule(plan))

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


def window(scheduled: Scheduled, plan: Plan, run: Trajectory, limit: float = np.inf) -> Window:
    """The rows of a run until the last frame of its schedule, or until a move passes a limit (rad)."""
    trial = scheduled.under(plan)
    start = trial.cleared(plan.k) - plan.before / plan.rate
    frame = np.floor((run.time - start) * plan.rate + 1e-6).astype(int)
    inside = frame < len(plan.orders)
    number, row = np.unique(frame[inside], return_index=True)
    bus = [run.point.net.place[s.bus] for s in run.point.case.storage]
    acts = np.ones(plan.orders.shape, bool)
    number, row = number[number >= 0], row[number >= 0]
    allowed = np.abs(run.arrays.V[row][:, bus]) >= scheduled.law.min_voltage
    acts[number] = np.where(plan.orders[number] != 0, run.arrays.order[row] != 0, allowed)
    moves = run.arrays.swing
    inside &= np.maximum.accumulate(np.abs(moves).max(axis=1)) <= limit
    return Window(run.time[inside], frame[inside], moves[inside], int(np.searchsorted(frame, 0)), acts)


def slopes(plan: Plan, run: Trajectory, seen: Window) -> Slopes:
    """Derivatives of the excursion by the orders that act; those of a device that is idle at low voltage are 0."""
    point = run.point
    rows, rotors = _followed(seen)
    H = point.inertia
    from_coi = np.zeros((len(H), point.layout.nx))
    from_coi[:, point.rotors.angle] = point.from_center(np.eye(len(H)), H).T
    sign = np.sign(seen.moves[rows, rotors])
    shown = [Shown(np.array([q]), s * from_coi[[i]]) for q, i, s in zip(rows, rotors, sign, strict=True)]
    every = np.arange(len(seen.time))
    shown.append(Shown(every, 2 / len(every) * seen.moves @ from_coi))
    by_step = gradients(run, shown, seen.first)[: len(every)]
    found = np.zeros((*plan.orders.shape, len(shown)))
    mine = seen.frame[: len(by_step)] >= 0
    np.add.at(found, seen.frame[: len(by_step)][mine], by_step[mine])
    flat = (found * seen.acts[:, :, None]).reshape(-1, len(shown)).T
    return Slopes(np.abs(seen.moves[rows, rotors]), flat[:-1], flat[-1])


def _followed(seen: Window) -> tuple[np.ndarray, np.ndarray]:
    """Rows and rotors of the moves to follow: the largest of every rotor, and others evenly among the large ones."""
    size = np.abs(seen.moves)
    large = size > NEAR * size.max()
    frames = np.r_[True, np.diff(seen.frame) > 0]
    rows, rotors = np.nonzero(large & frames[:, None])
    some = slice(None, None, max(1, len(rows) // MOST))
    peak = size.argmax(axis=0)
    top = np.flatnonzero(large[peak, np.arange(size.shape[1])])
    both = np.unique(np.r_[np.c_[rows[some], rotors[some]], np.c_[peak[top], top]], axis=0)
    return both[:, 0], both[:, 1]
