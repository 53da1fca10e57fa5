"""Network model: the phasors of a machine without PMU, from the reports of all others.

The network between the internal voltages is linear: V = Z J, J the source currents I + y V of the machines, y = 1/(ra +
j x), and the currents of storage devices and of loads that are no constant admittances; Z is the inverse of the network
admittance with the branches that are in service. With rows and columns p of the PMUs, o of the other currents and m of
the machines without report,

    V_p - Z_pp J_p - Z_po J_o = Z_pm J_m,   J_m by least squares,   V_m = Z_mp J_p + Z_mo J_o + Z_mm J_m.

All of it is linear in the reports, and so are the errors: the share of each report in V_m and I_m is kept.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla

from stabctl.dynamics import family
from stabctl.dynamics.operating_point import OperatingPoint, source_admittances
from stabctl.model.network import Switching

MOST = 500  # networks and patterns of reports kept
AMPLIFIED = 10  # times the error of a report: a computed phasor is not used beyond
BLURRED = 0.1  # -   relative error of an internal voltage, beyond which it is not used


class Computed(NamedTuple):
    """Phasors of machines without report, and what each report contributes to them (machines, reports), pu."""

    V: np.ndarray  # (machines)
    I: np.ndarray  # (machines)
    V_parts: np.ndarray
    I_parts: np.ndarray


def sharp(found: Computed, impedance: np.ndarray, error: float) -> np.ndarray:
    """Which phasors are known well enough to be used: voltages V, and the internal voltages V + Z I behind them.

    At a bolted fault the voltage is known to be zero, and the current is not known at all.

    Parameters
    ----------
    found : Computed
        Phasors of some machines.
    impedance : (machines,) array, pu
        The Z of these machines.
    error : float
        Relative standard deviation of a report, its clock included.
    """
    parts = found.V_parts + impedance[:, None] * found.I_parts
    apart = np.sqrt((np.abs(parts) ** 2).sum(-1)) / np.abs(parts.sum(-1))
    of_voltage = np.sqrt((np.abs(found.V_parts) ** 2).sum(-1))
    return (np.maximum(apart, of_voltage) < AMPLIFIED) & (apart * error < BLURRED)


class NetworkModel:
    """Voltages and currents of machines from those of the others."""

    def __init__(self, point: OperatingPoint) -> None:
        self._point, self._bus = point, point.system.unit_bus
        self._source = source_admittances(point.system)
        self._rows, self._inverse = lru_cache(MOST)(self._admittances), lru_cache(MOST)(self._inverted)
        self._each, self._map = lru_cache(MOST)(self._lines), lru_cache(MOST)(self._solved)
        fed = [point.net.place[s.bus] for s in point.case.storage]
        loads = [f for f in point.system.families if f.device.role == "load"]
        fed += [row for f in loads for row in (f.w[:, family.BUS] - point.layout.nx) // 2]
        fed += [point.net.place[bus] for link in point.case.links for bus in (link.from_bus, link.to_bus)]
        self.others = np.unique(np.array(fed, int))  # buses with currents that are neither machines nor admittances

    def other_currents(self, V: np.ndarray, I: np.ndarray, switching: Switching) -> np.ndarray:
        """True currents (others), pu, into the network at true voltages (buses) and machine currents (machines)."""
        source, current = I + self._source * V[self._bus], np.zeros(len(V), complex)
        source[list(switching.tripped)] = 0
        np.add.at(current, self._bus, source)
        return self._rows(switching) @ V - current[self.others]

    def computed(
        self, V: np.ndarray, I: np.ndarray, others: np.ndarray, *, switching: Switching, known: np.ndarray
    ) -> Computed | None:
        """Phasors of the machines that are not `known`, NaN where the reports do not determine them.

        None with fewer reports than unknown machines.

        Parameters
        ----------
        V, I : (machines,) array, pu
            Reported voltages and currents.
        others : (others,) array, pu
            Reported currents of storage devices and loads.
        switching : Switching
            What is open, faulted, and tripped.
        known : (machines,) array of bool
            Machines with a report.
        """
        found = self._map(switching, known.tobytes())
        if found is None:
            return None
        reports = np.concatenate([V, I, others])
        used = np.concatenate([known, known, np.ones(len(others), bool)])
        V_parts, I_parts = np.zeros((2, len(known) - known.sum(), len(reports)), complex)
        V_parts[:, used], I_parts[:, used] = found[0] * reports[used], found[1] * reports[used]
        return Computed(V_parts.sum(-1), I_parts.sum(-1), V_parts, I_parts)

    def each_from_the_rest(self, switching: Switching, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows of known machines whose voltage follows from the reports of the others, and the matrix that gives it.

        The columns are those of `computed`: voltages and currents of all machines, and the other currents.
        """
        return self._each(switching, known.tobytes())

    def _lines(self, switching: Switching, mask: bytes) -> tuple[np.ndarray, np.ndarray]:
        """`each_from_the_rest`, of a mask as bytes."""
        known = np.frombuffer(mask, bool)
        rows, lines = [], []
        for row in np.flatnonzero(known):
            rest = known.copy()
            rest[row] = False
            found = self._map(switching, rest.tobytes())
            if found is None or row in switching.tripped:
                continue
            line = np.zeros(2 * len(known) + len(self.others), complex)
            used = np.concatenate([rest, rest, np.ones(len(self.others), bool)])
            line[used] = found[0][np.flatnonzero(~rest) == row][0]
            if np.linalg.norm(line[: 2 * len(known)]) < AMPLIFIED:
                rows.append(int(row))
                lines.append(line)
        return np.array(rows, int), np.array(lines).reshape(len(rows), 2 * len(known) + len(self.others))

    def _solved(self, switching: Switching, mask: bytes) -> tuple[np.ndarray, np.ndarray] | None:
        """V and I of the machines that are not known as matrices over the reports."""
        known = np.frombuffer(mask, bool)
        n, running = len(known), np.array([i not in switching.tripped for i in range(len(known))])
        p, m = np.flatnonzero(known), np.flatnonzero(~known & running)
        if len(p) < len(m):
            return None
        Z, y = self._inverse(switching), self._source
        fed = Z[:, p] * running[p]
        own = np.hstack([fed * y[p], fed, Z[:, n:]])  # V of every machine from V_p, I_p and J_o
        left = -own[p]
        left[:, : len(p)] += np.eye(len(p))
        seen, lost = Z[np.ix_(p, m)], np.flatnonzero(~known)
        inverse = np.linalg.pinv(seen, rcond=1e-3)
        J = inverse @ left
        unseen = inverse @ seen - np.eye(len(m))  # what the reports leave open of J_m
        V = own[lost] + Z[np.ix_(lost, m)] @ J
        V[np.abs(Z[np.ix_(lost, m)] @ unseen).max(-1, initial=0.0) > 1e-6 * np.abs(Z[lost]).max(-1)] = np.nan
        J[np.abs(unseen).max(-1, initial=0.0) > 1e-6] = np.nan  # of machines at one bus only the sum is known
        I = -y[lost, None] * V
        I[np.isin(lost, m)] += J
        I[~np.isin(lost, m)] = 0
        return V, I

    def _admittances(self, switching: Switching) -> sp.csr_matrix:
        """Rows of the network admittance, pu, at the buses of the other currents."""
        return self._point.admittance(switching).tocsr()[self.others]

    def _inverted(self, switching: Switching) -> np.ndarray:
        """Z: voltages of the machines per current of the machines and of the others."""
        at = np.r_[self._bus, self.others]
        Y = self._point.admittance(switching)
        ones = sp.csc_matrix((np.ones(len(at)), (at, np.arange(len(at)))), shape=(Y.shape[0], len(at)))
        found: np.ndarray = sla.splu(Y.tocsc()).solve(ones.toarray().astype(complex))[self._bus]
        return found
