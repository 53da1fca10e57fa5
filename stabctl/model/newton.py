"""The power flow equations in polar coordinates, and a sparse Newton method for them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl._util.wording import counted
from stabctl.errors import PowerFlowError

from .case import Case

TOLERANCE = 1e-8  # MVA   largest power mismatch (1e-10 pu on 100 MVA)
SYMMETRIC: dict[str, Any] = {  # of SuperLU: pivots on the diagonal if they are large enough, columns one by one
    "diag_pivot_thresh": 0.01,
    "relax": 1,
    "panel_size": 1,
    "options": {"SymmetricMode": True},
}


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

    i: np.ndarray  # bus of the power, and bus on whose voltage it depends: entries of Y
    j: np.ndarray
    own: np.ndarray  # which of them are those of a bus with itself
    of_p: np.ndarray  # row of the equation of every active power, and column of the angle of its bus
    of_q: np.ndarray  # row of the equation of every reactive power, and column of the voltage of its bus
    taken: np.ndarray  # derivatives that are the entries of the Jacobian
    J: sp.csc_matrix  # set anew at every step


class Voltages(NamedTuple):
    """Voltages (buses), and how far they are from a solution."""

    size: np.ndarray  # pu
    angle: np.ndarray  # rad
    V: np.ndarray  # complex, pu
    power: np.ndarray  # complex, pu   into the network
    F: np.ndarray  # pu   mismatch of every equation
    worst: float  # pu   the largest; infinite if a voltage is not physical


@dataclass(frozen=True)
class Equations:
    """Mismatch of active power at every bus but the swing bus, and of reactive power at the pq buses."""

    Y: sp.csc_matrix
    produced: np.ndarray  # (buses) complex, pu   power of the machines
    drawn: Demand
    p: np.ndarray  # rows of the buses with an active-power equation
    q: np.ndarray  # rows of the buses with a reactive-power equation

    def at(self, size: np.ndarray, angle: np.ndarray) -> Voltages:
        """The mismatches at voltages (buses) in pu and radians."""
        V = size * np.exp(1j * angle)
        power = V * (self.Y @ V).conj()
        miss = power - self.produced + self.drawn.at(size)
        F = np.concatenate([miss.real[self.p], miss.imag[self.q]])
        good = np.isfinite(F).all() and (not len(self.q) or size[self.q].min() > 0)
        return Voltages(size, angle, V, power, F, float(np.abs(F).max(initial=0.0)) if good else np.inf)

    @cached_property
    def _pattern(self) -> "_Pattern":
        """Where the derivatives (in the order of `step`) stand in the Jacobian; buses in an order with little fill."""
        n, m = len(self.produced), len(self.p) + len(self.q)
        i, j = self.Y.indices, np.repeat(np.arange(n), np.diff(self.Y.indptr))
        unknown, position = np.zeros((n, 2), bool), _order(self.Y)
        unknown[position[self.p], 0] = unknown[position[self.q], 1] = True
        number = np.where(unknown, np.cumsum(unknown).reshape(n, 2) - 1, -1)
        of_p, of_q = number[position].T
        rows = np.concatenate([of_p[i], of_p[i], of_q[i], of_q[i]])
        columns = np.concatenate([of_p[j], of_q[j], of_p[j], of_q[j]])
        inside = np.flatnonzero((rows >= 0) & (columns >= 0))
        J = sp.csc_matrix((inside.astype(float), (rows[inside], columns[inside])), shape=(m, m))
        return _Pattern(i, j, np.flatnonzero(i == j), of_p[self.p], of_q[self.q], J.data.astype(int), J)

    def step(self, now: Voltages) -> tuple[np.ndarray, np.ndarray]:
        """Newton step of voltages (pu) and angles (rad). Raises RuntimeError if the Jacobian is singular."""
        at, miss, n = self._pattern, np.empty(len(now.F)), len(now.V)
        flow = now.V[at.i] * (self.Y.data * now.V[at.j]).conj()  # part of the power of bus i that depends on bus j
        by_size, turned = flow / now.size[at.j], flow.copy()  # derivatives by the angle are -j times `turned`
        turned[at.own] -= now.power
        by_size[at.own] += now.power / now.size + self.drawn.s1 + 2 * self.drawn.s2 * now.size
        at.J.data[:] = np.concatenate([turned.imag, by_size.real, -turned.real, by_size.imag])[at.taken]
        miss[at.of_p], miss[at.of_q] = -now.F[: len(self.p)], -now.F[len(self.p) :]
        x = splu(at.J, "NATURAL", **SYMMETRIC).solve(miss)
        d_size, d_angle = np.zeros((2, n))
        d_angle[self.p], d_size[self.q] = x[at.of_p], x[at.of_q]
        return d_size, d_angle

    def per_bus(self, F: np.ndarray) -> np.ndarray:
        """Size (buses, pu) of the mismatch at every bus."""
        out = np.zeros(len(self.produced), complex)
        out[self.p] += F[: len(self.p)]
        out[self.q] += 1j * F[len(self.p) :]
        return np.abs(out)


def _order(Y: sp.csc_matrix) -> np.ndarray:
    """Position of every bus in an order in which elimination adds few entries (minimum degree)."""
    links = sp.csc_matrix((np.ones(Y.nnz), Y.indices, Y.indptr), shape=Y.shape)
    links.setdiag(Y.shape[0])
    return splu(links, "MMD_AT_PLUS_A", **SYMMETRIC).perm_c


def newton(case: Case, equations: Equations, size: np.ndarray, angle: np.ndarray, limit: int) -> tuple[np.ndarray, int]:
    """Voltages (pu) that solve the equations, and the steps it took; a step is halved until the mismatch falls."""
    with np.errstate(all="ignore"):
        now, iteration = equations.at(size, angle), 0
        for iteration in range(limit + 1):
            if now.worst < TOLERANCE / case.base_mva:
                return now.V, iteration
            if now.worst == np.inf:
                break
            try:
                d_size, d_angle = equations.step(now)
            except RuntimeError:
                break
            tried = (equations.at(now.size + a * d_size, now.angle + a * d_angle) for a in 0.5 ** np.arange(8))
            better = next((there for there in tried if there.worst < now.worst), None)
            if better is None:
                break
            now = better
    miss, low = np.nan_to_num(equations.per_bus(now.F), nan=np.inf), int(np.argmin(now.size))
    worst = int(miss.argmax())
    raise PowerFlowError(
        f"The power flow of {case.name} did not converge in {counted(iteration, 'iteration')}: the largest mismatch is "
        f"{miss[worst] * case.base_mva:.4g} MVA at bus {case.buses[worst].bus}, the lowest voltage is "
        f"{now.size[low]:.3g} pu at bus {case.buses[low].bus}; check the loads, lines and voltages there."
    )
