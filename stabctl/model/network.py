"""The network: a case in per unit, its admittance matrix with faults and open circuits, its islands.

This is the only place where MW, Mvar and degrees are converted to pu on the system base and radians. A branch is always
a two-port, also with a fault along it or with open ends (`two_port`); the matrix is a pure function of these.
"""

from collections.abc import Iterable, Mapping
from itertools import chain
from operator import attrgetter
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from .tables import Tables

BOLTED = 1e9  # MVA at 1 pu voltage   admittance of a fault without impedance (1e7 pu on 100 MVA)
_NUMBERS = attrgetter("r", "x", "b", "tap", "phase", "g_from", "b_from", "g_to", "b_to")


class Network(NamedTuple):
    """The network of a case, in pu on the system base.

    Attributes
    ----------
    numbers : tuple of int
        Bus number of every row of the admittance matrix.
    place : mapping of int to int
        Row of every bus number.
    frm, to : ndarray of int, (branches)
        Rows of the buses at the ends of every branch.
    z : ndarray of complex, (branches), pu
        Series impedance.
    charging : ndarray, (branches), pu
        Total charging susceptance.
    ratio : ndarray of complex, (branches)
        Turns ratio; the from side leads by its angle.
    ends : ndarray of complex, (branches, 2), pu
        Shunt admittance at the from and at the to end, outside the turns ratio.
    shunt : ndarray of complex, (buses), pu
        Admittance of the bus shunts.
    machine_bus : ndarray of int, (machines)
        Row of the bus of every machine.
    """

    numbers: tuple[int, ...]
    place: Mapping[int, int]
    frm: np.ndarray
    to: np.ndarray
    z: np.ndarray
    charging: np.ndarray
    ratio: np.ndarray
    ends: np.ndarray
    shunt: np.ndarray
    machine_bus: np.ndarray


class BranchState(NamedTuple):
    """What has happened to a branch."""

    fault_at: float | None = None  # fraction of its length from the from end; None: no fault
    fault_admittance: complex = 0j  # pu
    from_closed: bool = True
    to_closed: bool = True

    @property
    def faulted(self) -> bool:
        """Whether a fault on it is connected."""
        return self.fault_at is not None and (self.from_closed or self.to_closed)


INTACT = BranchState()


class Switching(NamedTuple):
    """Everything that differs from the intact network. Rows are those of the case's tables."""

    branches: tuple[tuple[int, BranchState], ...] = ()  # row of the branch, its state
    faults: tuple[tuple[int, complex], ...] = ()  # row of the bus, fault admittance, pu
    shunts: tuple[tuple[int, complex], ...] = ()  # row of the bus, admittance switched in, pu
    tripped: frozenset[int] = frozenset()  # rows of machines
    loads: tuple[tuple[tuple[int, str], complex], ...] = ()  # row of the bus and load, power added at its V, pu

    @property
    def faulted(self) -> bool:
        """Whether a fault is on."""
        return bool(self.faults) or any(state.faulted for _, state in self.branches)


UNSWITCHED = Switching()


def without(branches: Iterable[int]) -> Switching:
    """Branches (rows) open at both ends."""
    return Switching(branches=tuple((row, BranchState(from_closed=False, to_closed=False)) for row in branches))


class Entries(NamedTuple):
    """Entries of a bus admittance matrix, in any order; those of one place are added up."""

    values: np.ndarray  # complex, pu
    rows: np.ndarray
    columns: np.ndarray

    def joined(self, values: np.ndarray, at: np.ndarray) -> "Entries":
        """These, and more admittances from buses (rows) to ground."""
        ends = np.concatenate([self.rows, at]), np.concatenate([self.columns, at])
        return Entries(np.concatenate([self.values, values]), *ends)

    def real(self) -> "Entries":
        """Those of the real form (2n, 2n) of the matrix, real and imaginary parts interleaved."""
        g, b, r, c = self.values.real, self.values.imag, 2 * self.rows, 2 * self.columns
        ends = np.concatenate([r, r, r + 1, r + 1]), np.concatenate([c, c + 1, c, c + 1])
        return Entries(np.concatenate([g, -b, b, g]), *ends)

    def matrix(self, n: int) -> sp.csc_matrix:
        """The matrix (n, n)."""
        return sp.csc_matrix((self.values, (self.rows, self.columns)), shape=(n, n))


def build(case: Tables) -> Network:
    """The network of a case in pu on the system base, angles in radians."""
    place = case.row_of_bus
    values = np.fromiter(chain.from_iterable(map(_NUMBERS, case.branches)), float)
    r, x, b, tap, phase, *ends = values.reshape(-1, 9).T
    return Network(
        tuple(place),
        place,
        np.array([place[k.from_bus] for k in case.branches], int),
        np.array([place[k.to_bus] for k in case.branches], int),
        r + 1j * x,
        b,
        tap * np.exp(1j * np.deg2rad(phase)),
        np.stack([ends[0] + 1j * ends[1], ends[2] + 1j * ends[3]], axis=1),
        np.array([b.g + 1j * b.b for b in case.buses]) / case.base_mva,
        np.array([place[m.bus] for m in case.machines], int),
    )


def two_port(
    z: complex, charging: float, state: BranchState = INTACT, ends: tuple[complex, complex] = (0j, 0j)
) -> np.ndarray:
    """Admittance of a pi-section branch seen from its ends, without its turns ratio.

    A fault splits the branch into sections of f and 1 - f of its length, with the fault admittance between them; an
    open end and the fault point are then eliminated (Kron reduction).

    Parameters
    ----------
    z : complex, pu
        Series impedance.
    charging : float, pu
        Total charging susceptance.
    state : BranchState
        Fault and open ends.
    ends : tuple of complex, pu
        Further shunt admittances at the two ends.

    Returns
    -------
    ndarray of complex, (2, 2), pu
        Zero if both ends are open.
    """
    f, end = state.fault_at, [0.0, 1.0]
    points = end if f is None or f in end else [0.0, f, 1.0]
    Y = np.zeros((len(points),) * 2, complex)
    for k in range(len(points) - 1):
        length = points[k + 1] - points[k]
        y, half = 1 / (length * z), 0.5j * length * charging
        Y[k : k + 2, k : k + 2] += [[y + half, -y], [-y, y + half]]
    Y[0, 0] += ends[0]
    Y[-1, -1] += ends[1]
    if f is not None:
        Y[points.index(f), points.index(f)] += state.fault_admittance
    kept = [k for k, closed in ((0, state.from_closed), (len(points) - 1, state.to_closed)) if closed]
    gone = [k for k in range(len(points)) if k not in kept]
    if kept and gone:
        Y[np.ix_(kept, kept)] -= Y[np.ix_(kept, gone)] @ np.linalg.solve(Y[np.ix_(gone, gone)], Y[np.ix_(gone, kept)])
    out = np.zeros((2, 2), complex)
    left = [0 if k == 0 else 1 for k in kept]
    out[np.ix_(left, left)] = Y[np.ix_(kept, kept)]
    return out


def admittance(net: Network, switching: Switching = UNSWITCHED) -> sp.csc_matrix:
    """Bus admittance matrix (buses, buses) of branches and shunts, complex, pu: see `entries`."""
    return entries(net, switching).matrix(len(net.shunt))


def entries(net: Network, switching: Switching = UNSWITCHED) -> Entries:
    """Entries of the bus admittance matrix of branches and shunts.

    Parameters
    ----------
    net : Network
        The intact network.
    switching : Switching
        Faults, open circuits and shunts.

    Returns
    -------
    Entries
        Machines and loads are not in it.
    """
    t = net.ratio
    square = np.abs(t) ** 2
    y, half = 1 / net.z, 0.5j * net.charging
    ends = net.ends.copy()
    ends[:, 0] *= square  # inside the ratio
    ports = np.array([[y + half + ends[:, 0], -y], [-y, y + half + ends[:, 1]]])
    for k, state in switching.branches:
        if state.fault_at == 0:  # on the bus's side of the ratio
            state = state._replace(fault_admittance=state.fault_admittance * square[k])
        ports[:, :, k] = two_port(net.z[k], net.charging[k], state, (ends[k, 0], ends[k, 1]))
    shunt = net.shunt.copy()
    for bus, extra in (*switching.faults, *switching.shunts):
        shunt[bus] += extra
    d = np.arange(len(shunt))
    values = ports[0, 0] / square, ports[0, 1] / t.conj(), ports[1, 0] / t, ports[1, 1], shunt
    rows, columns = (net.frm, net.frm, net.to, net.to, d), (net.frm, net.to, net.frm, net.to, d)
    return Entries(*(np.concatenate(column) for column in (values, rows, columns)))


def islands(net: Network, switching: Switching = UNSWITCHED) -> np.ndarray:
    """Island of every bus (buses, int, from 0); branches closed at both ends connect."""
    closed = np.ones(len(net.frm), bool)
    for k, state in switching.branches:
        closed[k] = state.from_closed and state.to_closed
    links = sp.csr_matrix((np.ones(closed.sum()), (net.frm[closed], net.to[closed])), shape=(len(net.shunt),) * 2)
    return connected_components(links, directed=False)[1]
