"""The excursion of the rotors in the window of a schedule, and its derivatives with respect to the orders.

    excursion = largest |m| + SHARE * mean over time of the sum of m^2

with m the change of the angle of a rotor relative to the center of inertia.

The largest angle is what the criterion of stability limits. The mean asks for a return: near the unstable equilibrium
the largest angle alone does not tell whether a rotor comes back from it.
"""

from typing import NamedTuple

import numpy as np

from stabctl.simulation.trajectory import Trajectory

from .adjoint import Shown, gradients
from .scheduled import Plan, Scheduled

SHARE = 0.1  # 1/rad
NEAR = 0.6  # of the largest angle; smaller ones are not followed
MOST = 120  # angles followed, besides the largest of every rotor


class Window(NamedTuple):
    """The part of a run that counts."""

    time: np.ndarray  # (rows) s
    frame: np.ndarray  # (rows) frame of the schedule at every row, negative before the first
    moves: np.ndarray  # (rows, rotors) rad
    first: int  # row at which the schedule begins

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


def window(scheduled: Scheduled, plan: Plan, run: Trajectory, limit: float = np.inf) -> Window:
    """The rows of a run until the last frame of its schedule, or until a move passes a limit (rad)."""
    trial = scheduled.under(plan)
    start = trial.cleared(plan.k) - plan.before / plan.rate
    frame = np.floor((run.time - start) * plan.rate + 1e-6).astype(int)
    inside = frame < len(plan.orders)
    moves = run.arrays.swing
    inside &= np.maximum.accumulate(np.abs(moves).max(axis=1)) <= limit
    return Window(run.time[inside], frame[inside], moves[inside], int(np.searchsorted(frame, 0)))


def slopes(scheduled: Scheduled, plan: Plan, run: Trajectory, seen: Window) -> Slopes:
    """Derivatives of the excursion by the orders that act; those of a device that is idle at low voltage are 0."""
    point = run.point
    rows, rotors = _followed(seen)
    nx, angle, H = point.layout.nx, point.rotors.angle, point.inertia
    from_coi = np.zeros((len(H), nx))
    from_coi[:, angle] -= H / H.sum()
    from_coi[np.arange(len(H)), angle] += 1.0
    sign = np.sign(seen.moves[rows, rotors])
    shown = [Shown(np.array([q]), s * from_coi[[i]]) for q, i, s in zip(rows, rotors, sign, strict=True)]
    every = np.arange(len(seen.time))
    shown.append(Shown(every, 2 / len(every) * seen.moves @ from_coi))
    by_step = gradients(run, shown, seen.first)[: len(every)]
    bus = [point.net.place[s.bus] for s in point.case.storage]
    order = run.arrays.order[: len(by_step)]
    acts = (order != 0) | (np.abs(run.arrays.V[: len(by_step), bus]) >= scheduled.law.min_voltage)
    found = np.zeros((len(plan.orders), len(bus), len(shown)))
    mine = seen.frame[: len(by_step)] >= 0
    np.add.at(found, seen.frame[: len(by_step)][mine], (by_step * acts[:, :, None])[mine])
    flat = found.reshape(-1, len(shown)).T
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
