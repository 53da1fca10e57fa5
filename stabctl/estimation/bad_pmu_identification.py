"""Identification of bad PMUs: the fewest that explain the residuals, as for bad data in state estimation.

Voltages V of the machines are compared with V', which follows from the reports of the others: with e = 1 - V'/V,

    e = G a + noise,   a_j = 1 - exp(-j phi_j) / (1 + m_j)

if the phasors of PMU j are turned by phi_j and scaled by 1 + m_j, exactly, with the columns g_j of G from the reports.
C is the covariance of the real and of the imaginary part of the noise. A set M of PMUs explains

    T_M = b* A^-1 b,   b = G_M* C^-1 e,   A = G_M* C^-1 G_M,

of e* C^-1 e; for one PMU it is chi-square with two degrees of freedom if all PMUs are good. A set of two must explain
`LIMIT` more than one. Those PMUs are named that belong to every set within `CLEAR` of the best.
"""

from typing import NamedTuple

import numpy as np

LIMIT = 40.0  # T of one PMU; the probability of more is exp(-20)
CLEAR = 16.0  # difference of T below which two explanations are alike


class Residuals(NamedTuple):
    """Residuals of some machines, and what is known of them."""

    of: np.ndarray  # rows of the machines with a residual, then of those with a PMU
    e: np.ndarray  # (n)
    white: np.ndarray  # (n, n)   covariance of the noise of the reports
    turns: np.ndarray  # (n, PMUs)   g_j in columns

    def mean(self, last: "Residuals | None", share: float) -> "Residuals":
        """Exponential mean with the `last` one; G and covariance are exact, also where the network changes."""
        if last is None or not np.array_equal(last.of, self.of):
            return self
        kept = 1 - share
        white = kept**2 * last.white + share**2 * self.white
        return Residuals(self.of, kept * last.e + share * self.e, white, kept * last.turns + share * self.turns)

    def suspects(self, clock: float) -> dict[int, float]:
        """Columns of the PMUs to blame, and the angles (rad) by which their phasors are turned.

        None if the residuals are normal, or if it is not clear which PMUs are bad. `clock` is the standard deviation
        (rad) of the constant offsets of the clocks.
        """
        C = self.white + clock**2 * self.turns @ self.turns.conj().T + 1e-12 * np.eye(len(self.e))
        weighted = np.linalg.solve(C, np.column_stack([self.e, self.turns]))
        if (self.e.conj() @ weighted[:, 0]).real <= LIMIT:
            return {}
        b, A = self.turns.conj().T @ weighted[:, 0], self.turns.conj().T @ weighted[:, 1:]
        power, square = np.maximum(A.diagonal().real, 1e-9), np.abs(b) ** 2
        i, j = np.triu_indices(len(b), 1)
        det = power[i] * power[j] - np.abs(A[i, j]) ** 2
        both = power[j] * square[i] - 2 * (b[i].conj() * A[i, j] * b[j]).real + power[i] * square[j]
        one = square / power
        two = np.divide(both, det, out=np.zeros(len(det)), where=det > 1e-6 * power[i] * power[j]) - LIMIT
        best = max(one.max(), two.max(initial=0.0))
        if best <= LIMIT:
            return {}
        sets: list[tuple[int, ...]] = [(int(m),) for m in np.flatnonzero(one > best - CLEAR)]
        sets += [(int(i[m]), int(j[m])) for m in np.flatnonzero(two > best - CLEAR)]
        widest = list(sets[-1])
        a = dict(zip(widest, np.linalg.solve(A[np.ix_(widest, widest)], b[widest]), strict=True))
        common = sorted(set.intersection(*map(set, sets)))
        return {column: -float(np.angle(1 - a[column])) for column in common}
