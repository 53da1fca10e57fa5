"""The power flow equations in polar coordinates, and a sparse Newton method for them."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl._util.wording import counted
from stabctl.errors import PowerFlowError

from .case import Case

TOLERANCE = 1e-8  # MVA   largest power mismatch (1e-10 pu on 100 MVA)


class Demand(NamedTuple):
    """Power drawn at every bus (buses), complex, pu: s0 + s1 |V| + s2 |V|^2."""

    s0: np.ndarray
    s1: np.ndarray
    s2: np.ndarray

    def at(self, size: np.ndarray) -> np.ndarray:
        """The power at these voltage magnitudes (buses), pu."""
        return self.s0 + self.s1 * size + self.s2 * size**2


class _Pattern(NamedTuple):
    """The sparsity of the Jacobian in compressed columns, and what stands where."""

    i: np.ndarray  # bus of the power, and bus on whose voltage it depends: entries of Y, then every bus
    j: np.ndarray
    kept: np.ndarray  # derivatives that are in the Jacobian
    place: np.ndarray  # place of each among its entries
    J: sp.csc_matrix  # set anew at every step


@dataclass(frozen=True)
class Equations:
    """Mismatch of active power at every bus but the swing bus, and of reactive power at the pq buses."""

    Y: sp.csc_matrix
    produced: np.ndarray  # (buses) complex, pu   power of the machines
    drawn: Demand
    p: np.ndarray  # rows of the buses with an active-power equation
    q: np.ndarray  # rows of the buses with a reactive-power equation

    def mismatch(self, size: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, float]:
        """The mismatches (pu), and the largest; infinite if a voltage is not physical."""
        V = size * np.exp(1j * angle)
        miss = V * (self.Y @ V).conj() - self.produced + self.drawn.at(size)
        F = np.concatenate([miss.real[self.p], miss.imag[self.q]])
        good = np.isfinite(F).all() and (not len(self.q) or size[self.q].min() > 0)
        return F, float(np.abs(F).max(initial=0.0)) if good else np.inf

    @cached_property
    def _pattern(self) -> "_Pattern":
        """Where the derivatives of every branch and bus, in the order of `step`, stand in the Jacobian."""
        n, p, q = len(self.produced), self.p, self.q
        d = np.arange(n)
        i, j = np.r_[self.Y.indices, d], np.r_[np.repeat(d, np.diff(self.Y.indptr)), d]
        of_p, of_q = np.full(n, -1), np.full(n, -1)  # rows of the equations, and columns of the unknowns
        of_p[p], of_q[q] = np.arange(len(p)), len(p) + np.arange(len(q))
        rows, columns = np.r_[of_p[i], of_p[i], of_q[i], of_q[i]], np.r_[of_p[j], of_q[j], of_p[j], of_q[j]]
        kept, m = np.flatnonzero((rows >= 0) & (columns >= 0)), len(p) + len(q)
        filled, place = np.unique(columns[kept] * m + rows[kept], return_inverse=True)
        starts = np.searchsorted(filled, m * np.arange(m + 1))
        J = sp.csc_matrix((np.zeros(len(filled)), filled % m, starts), shape=(m, m))
        return _Pattern(i, j, kept, place, J)

    def step(self, size: np.ndarray, angle: np.ndarray, F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Newton step of voltages (pu) and angles (rad). Raises RuntimeError if the Jacobian is singular."""
        V, p, q, at = size * np.exp(1j * angle), self.p, self.q, self._pattern
        n, power = len(size), V * (self.Y @ V).conj()
        i, j = at.i[:-n], at.j[:-n]
        flow = V[i] * (self.Y.data * V[j]).conj()  # part of the power of bus i that depends on bus j
        of_load = self.drawn.s1 + 2 * self.drawn.s2 * size
        by_angle = np.concatenate([-1j * flow, 1j * power])
        by_size = np.concatenate([flow / size[j], power / size + of_load])
        values = np.concatenate([by_angle.real, by_size.real, by_angle.imag, by_size.imag])[at.kept]
        at.J.data[:] = np.bincount(at.place, values, at.J.nnz)
        x = splu(at.J).solve(-F)
        d_size, d_angle = np.zeros(n), np.zeros(n)
        d_angle[p], d_size[q] = x[: len(p)], x[len(p) :]
        return d_size, d_angle

    def per_bus(self, F: np.ndarray) -> np.ndarray:
        """Size (buses, pu) of the mismatch at every bus."""
        out = np.zeros(len(self.produced), complex)
        out[self.p] += F[: len(self.p)]
        out[self.q] += 1j * F[len(self.p) :]
        return np.abs(out)


def newton(case: Case, equations: Equations, size: np.ndarray, angle: np.ndarray, limit: int) -> tuple[np.ndarray, int]:
    """Voltages (pu) that solve the equations, and the steps it took; a step is halved until the mismatch falls."""
    with np.errstate(all="ignore"):
        F, now = equations.mismatch(size, angle)
        iteration = 0
        for iteration in range(limit + 1):
            if now < TOLERANCE / case.base_mva:
                return size * np.exp(1j * angle), iteration
            if now == np.inf:
                break
            try:
                d_size, d_angle = equations.step(size, angle, F)
            except RuntimeError:
                break
            for share in 0.5 ** np.arange(8):
                tried = size + share * d_size, angle + share * d_angle
                G, then = equations.mismatch(*tried)
                if then < now:
                    break
            else:
                break
            (size, angle), F, now = tried, G, then
    miss, low = np.nan_to_num(equations.per_bus(F), nan=np.inf), int(np.argmin(size))
    worst = int(miss.argmax())
    raise PowerFlowError(
        f"The power flow of {case.name} did not converge in {counted(iteration, 'iteration')}: the largest mismatch is "
        f"{miss[worst] * case.base_mva:.4g} MVA at bus {case.buses[worst].bus}, the lowest voltage is "
        f"{size[low]:.3g} pu at bus {case.buses[low].bus}; check the loads, lines and voltages there."
    )
