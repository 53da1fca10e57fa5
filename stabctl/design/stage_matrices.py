"""The exact derivatives of one stage of a Runge-Kutta step: its rates, with the network solved.

With states x, orders u, and outputs and voltages z, every device differentiated by complex step,

    M dz = N (dx, du)   (outputs, and currents into the network),     df = R (dx, du) + S dz.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl.dynamics.jacobian import Equations
from stabctl.model.network import Entries
from stabctl.simulation.topology import Stage


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
