"""Gradients of a run with respect to storage orders: the adjoint of its Runge-Kutta stages.

A run is a sequence of Runge-Kutta steps, with the network solved at each. Followed backwards with the
exact derivatives of every stage, a weight of the states at the end of a step becomes one of the states at its
beginning, and one of the orders held in it. This is the derivative of the numbers of the run, not of the differential
equations behind them. A state at a non-windup limit stays there, or follows the signal that scales the limit.

The derivatives of a stage are those of its rates f, with the network solved. With states x, orders u, and outputs and
voltages z, every device differentiated by complex step,

    M dz = N (dx, du)   (outputs, and currents into the network),     df = R (dx, du) + S dz.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl.dynamics.family import Limits
from stabctl.dynamics.jacobian import Equations
from stabctl.model.network import Entries
from stabctl.simulation.method import RK4, STAGES
from stabctl.simulation.stages import Stages, constants, stages
from stabctl.simulation.topology import Stage
from stabctl.simulation.trajectory import Trajectory
from stabctl.simulation.wired import orders_of, wired


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

    def __init__(self, part: Stages, matrices: "StageMatrices", limits: Limits) -> None:
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


class StageMatrices:
    """The derivatives of all stages on one network; patterns and elimination order are found once."""

    def __init__(self, equations: Equations, network: Stage, k: np.ndarray, orders: Sequence[int]) -> None:
        layout, pattern = equations.system.layout, equations.pattern
        nx, ny, nv, nu = layout.nx, layout.outputs, 2 * layout.buses, len(orders)
        self.nx, self.nz = nx, ny + nv
        self._equations, self._k, self._size = equations, k, layout.size
        place = np.full(layout.size, -1, np.int64)
        place[:nx] = np.arange(nx)
        place[list(orders)] = nx + np.arange(nu)
        place[layout.first_output : layout.first_memory] = nx + nu + np.arange(ny)
        place[layout.voltages] = nx + nu + ny + np.arange(nv)
        bus = (pattern.injecting[:, None] - nx + np.arange(2)).ravel()
        rows, columns = pattern.rows.astype(np.int64), place[pattern.columns]
        injected = rows >= nx + ny
        rows[injected] = nx + ny + bus[rows[injected] - nx - ny]
        rate, z = rows < nx, columns >= nx + nu
        self._take = m, n, s = [np.flatnonzero(c) for c in (~rate & z, (columns >= 0) & ~z, rate & z)]
        at = network.Y.tocoo()
        Y, one = Entries(at.data, at.row, at.col).real(), np.arange(ny)
        self._fixed = np.r_[np.ones(ny), Y.values]
        of_z = np.r_[rows[m] - nx, one, ny + Y.rows], np.r_[columns[m] - nx - nu, one, ny + Y.columns]
        turn = _elimination(*of_z, self.nz)  # place in z -> its column in M
        self.of_z = np.where(place >= nx + nu, turn[np.maximum(place - nx - nu, 0)], -1)
        self._M = _Pattern(of_z[0], turn[of_z[1]], (self.nz, self.nz))
        self._RN_T = _Pattern(columns[n], rows[n], (nx + nu, nx + self.nz))
        self._S_T = _Pattern(turn[columns[s] - nx - nu], rows[s], (self.nz, nx))

    def at(self, s: np.ndarray) -> "StageAdjoint":
        """The derivatives at all signals s; those given before are no longer valid."""
        entries, _ = self._equations.entries(s[: self._size].copy(), self._k)
        m, n, of_rates = self._take
        lu = splu(self._M(np.r_[-entries[m], self._fixed]), permc_spec="NATURAL")
        return StageAdjoint(lu, self._RN_T(entries[n]), self._S_T(entries[of_rates]), self.nx)


def _elimination(rows: np.ndarray, columns: np.ndarray, size: int) -> np.ndarray:
    """The column of every unknown in an order of elimination with little fill; it depends on the pattern alone."""
    some = np.random.default_rng(0).uniform(1, 2, len(rows))
    return np.asarray(splu(sp.csc_matrix((some, (rows, columns)), (size, size)), "MMD_AT_PLUS_A").perm_c)


class _Pattern:
    """A sparse matrix of one pattern, filled with entries that are added up where they meet."""

    def __init__(self, rows: np.ndarray, columns: np.ndarray, shape: tuple[int, int]) -> None:
        unique, self._place = np.unique(columns.astype(np.int64) * shape[0] + rows, return_inverse=True)
        indices = (unique % shape[0]).astype(np.int32)
        starts = np.searchsorted(unique // shape[0], np.arange(shape[1] + 1)).astype(np.int32)
        self._matrix = sp.csc_matrix((np.zeros(len(indices)), indices, starts), shape=shape)

    def __call__(self, entries: np.ndarray) -> sp.csc_matrix:
        """The matrix with these entries; the same one at every call."""
        self._matrix.data[:] = np.bincount(self._place, entries, minlength=len(self._matrix.indices))
        return self._matrix


class StageAdjoint:
    """The transposed derivatives of one stage."""

    def __init__(self, lu: Any, RN_T: sp.csc_matrix, S_T: sp.csc_matrix, nx: int) -> None:
        self._lu, self._RN_T, self._S_T, self._nx = lu, RN_T, S_T, nx

    def __call__(self, rates: np.ndarray, z: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Weights of the states (states, p) and orders (devices, p).

        Parameters
        ----------
        rates : (states, p) array
            Weights of the rates.
        z : (outputs and voltages, p) array, optional
            Weights of the outputs and voltages, in the order of `StageMatrices.of_z`.
        """
        g = self._S_T @ rates
        mismatch = self._lu.solve(np.ascontiguousarray(g if z is None else g + z), "T")
        both = self._RN_T @ np.vstack([rates, mismatch])
        return both[: self._nx], both[self._nx :]
