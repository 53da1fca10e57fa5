"""Gradients of what a run shows with respect to the orders of its storage devices, by the adjoint of its steps.

A run is a sequence of Runge-Kutta steps, with the network solved at each. Followed backwards with the
exact derivatives of every stage, a weight of the states at the end of a step becomes one of the states at its
beginning, and one of the orders held in it. This is the derivative of the numbers of the run, not of the differential
equations behind them. A state at a non-windup limit stays there, or follows the signal that scales the limit.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stabctl.dynamics.limits import Limits
from stabctl.simulation.method import RK4, STAGES
from stabctl.simulation.stages import Stages, constants, stages
from stabctl.simulation.trajectory import Trajectory
from stabctl.simulation.wired import orders_of, wired

from .stage_matrices import StageMatrices


class Shown(NamedTuple):
    """A weighted sum of the states at some rows of a run."""

    rows: np.ndarray  # (n) ascending
    weights: np.ndarray  # (n, states)


def gradients(run: Trajectory, shown: Sequence[Shown], first: int = 0) -> np.ndarray:
    """Gradients of several quantities with respect to the order of every device in every step.

    Parameters
    ----------
    run : Trajectory
        A recorded run.
    shown : sequence of Shown
        The quantities.
    first : int
        Row from which on the orders count; the gradients of earlier ones are left at 0.

    Returns
    -------
    (steps, devices, quantities) array
        Per order of 1 (a rating), with the orders as recorded: what a law or a voltage gate makes of them is not
        followed.

    Raises
    ------
    StudyError
        If the run was not recorded, or a machine was disconnected in it.
    """
    point = run.point
    orders, system = orders_of(point.layout, point.case), wired(point, None)
    late_first = np.argsort([-one.rows[-1] for one in shown], kind="stable")
    weight, active = np.zeros((point.layout.nx, len(shown))), 0
    found = np.zeros((len(run.rows) - 1, len(orders), len(shown)))
    for part in reversed(stages(run)):
        k = constants(system, part.network, point.equations.program.k)
        back = _Step(part, StageMatrices(point.equations, part.network, k, orders.tolist()), point.system.limits)
        for step in reversed(range(len(part.sizes))):
            row = part.first + step
            if row < first:
                break
            while active < len(shown) and shown[late_first[active]].rows[-1] > row:
                active += 1
            for column in range(active):
                one = shown[late_first[column]]
                at = np.searchsorted(one.rows, row + 1)
                if at < len(one.rows) and one.rows[at] == row + 1:
                    weight[:, column] += one.weights[at]
            if active:
                weight[:, :active], found[row, :, :active] = back(step, weight[:, :active])
    out = np.empty_like(found)
    out[:, :, late_first] = found
    return out


class _Step:
    """Steps on one network, followed backwards."""

    def __init__(self, part: Stages, matrices: StageMatrices, limits: Limits) -> None:
        self._part, self._matrices, self._limits = part, matrices, limits

    def __call__(self, step: int, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weights of the states at the beginning of a step and of its orders, from those of the states at its end."""
        part, h = self._part, self._part.sizes[step]
        last = STAGES - 1
        end, of_z = self._unclipped(step, last, end)
        begin, of_x, of_u = end, np.zeros_like(end), np.zeros(0)
        for stage in reversed(range(STAGES)):
            weight = h / RK4.weight_divisor[stage] * end
            if stage < last:
                weight += h / RK4.reach_divisor[stage] * of_x
            weight[self._limits.state[part.held[step, stage] > 0]] = 0.0
            of_x, of_orders = self._matrices.at(part.signals[step, stage])(weight, of_z)
            of_u = of_u + of_orders if stage < last else of_orders
            if stage:
                of_x, of_z = self._unclipped(step, stage - 1, of_x)
            begin = begin + of_x
        return begin, of_u

    def _unclipped(self, step: int, stage: int, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Weights of the states before they were clipped, and of the signals that scale the limits, if any do."""
        side, limits = self._part.clipped[step, stage], self._limits
        at = np.flatnonzero(side)
        if not len(at):
            return weight, None
        edge = np.where(side[at] > 0, limits.high[at], limits.low[at])[:, None] * weight[limits.state[at]]
        scale = self._matrices.of_z[limits.scale[at]]
        of_z = np.zeros((self._matrices.nz, weight.shape[1]))
        np.add.at(of_z, scale[scale >= 0], edge[scale >= 0])
        weight = weight.copy()
        weight[limits.state[at]] = 0.0
        return weight, of_z
