"""The power flow of a case: a sparse Newton method in polar coordinates, and its solution as a record."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from html import escape
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl._util.errors import PowerFlowError
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.devices.loads import zip_load

from . import naming, network
from .case import Case, as_case
from .tables import Tables

if TYPE_CHECKING:
    import pandas as pd

TOLERANCE = 1e-8  # MVA   largest power mismatch (1e-10 pu on 100 MVA)
CURRENT_TOLERANCE = 0.01  # MVA at 1 pu voltage   largest current mismatch (1e-4 pu on 100 MVA)
LOW = 0.8  # pu   lowest voltage of a solution below which other starts are tried: there may be one above it
KEPT = 4  # sparsities of Jacobians, of the latest systems
SYMMETRIC: dict[str, Any] = {  # of SuperLU: pivots on the diagonal if they are large enough, columns one by one
    "diag_pivot_thresh": 0.01,
    "relax": 1,
    "panel_size": 1,
    "options": {"SymmetricMode": True},
}


@dataclass(frozen=True, repr=False, eq=False)
class PowerFlow:
    """A solved power flow. Values per bus, machine and branch are in the order of the case's tables.

    Attributes
    ----------
    case : Case
        The system.
    V : ndarray of complex, (buses), pu
        Bus voltages.
    S : ndarray of complex, (machines), pu on the system base
        Power produced by every machine.
    iterations : int
        Newton steps.

    Examples
    --------
    >>> flow = st.load("two_area").power_flow()
    >>> flow.df.loc[[1, 7], ["v_pu", "p_gen_mw", "p_load_mw"]].round(3)
          v_pu  p_gen_mw  p_load_mw
    bus
    1    1.030     700.0        0.0
    7    0.961       0.0      967.0
    """

    case: Case
    V: np.ndarray
    S: np.ndarray
    iterations: int

    report = verb("stabctl.view.pages.pattern:report")

    @property
    def branch_power(self) -> np.ndarray:
        """Power that enters every branch at its from end and at its to end (branches, 2), complex, pu.

        The sum over both ends is what the branch consumes, its charging included.
        """
        net = network.build(self.case)
        frm, to = self.V[net.frm] / net.ratio, self.V[net.to]
        through, half = (frm - to) / net.z, 0.5j * net.charging
        series = np.stack([frm * (through + half * frm).conj(), to * (half * to - through).conj()], axis=1)
        return series + np.abs(self.V[np.stack([net.frm, net.to], axis=1)]) ** 2 * net.ends.conj()

    @property
    def df(self) -> "pd.DataFrame":
        """Buses: voltage, angle, and the MW and Mvar of machines and of loads (with HVDC terminals)."""
        import pandas as pd

        base, net = self.case.base_mva, network.build(self.case)
        made, drawn = np.zeros(len(self.V), complex), demand(self.case, np.abs(self.V)) * base
        np.add.at(made, net.machine_bus, self.S * base)
        columns = {
            "v_pu": np.abs(self.V),
            "angle_deg": np.rad2deg(np.angle(self.V)),
            "p_gen_mw": made.real,
            "q_gen_mvar": made.imag,
            "p_load_mw": drawn.real,
            "q_load_mvar": drawn.imag,
        }
        return pd.DataFrame(columns, index=pd.Index(net.numbers, name="bus"))

    @property
    def branches(self) -> "pd.DataFrame":
        """Branches by circuit (7-8#2): the MW and Mvar that enter at each end, and the MW lost."""
        import pandas as pd

        S = self.branch_power * self.case.base_mva
        columns = {
            "from_bus": [k.from_bus for k in self.case.branches],
            "to_bus": [k.to_bus for k in self.case.branches],
            "p_from_mw": S[:, 0].real,
            "q_from_mvar": S[:, 0].imag,
            "p_to_mw": S[:, 1].real,
            "q_to_mvar": S[:, 1].imag,
            "loss_mw": S.real.sum(axis=1),
        }
        return pd.DataFrame(columns, index=pd.Index(naming.keys(self.case, "branches"), name="circuit", dtype=str))

    def __str__(self) -> str:
        low, high = np.abs(self.V).argmin(), np.abs(self.V).argmax()
        number = [b.bus for b in self.case.buses]
        produced = self.S.real.sum() * self.case.base_mva
        return (
            f"power flow of {self.case.name}: {self.iterations} iterations, {produced:.1f} MW generated, "
            f"voltages from {abs(self.V[low]):.3f} pu (bus {number[low]}) to {abs(self.V[high]):.3f} pu "
            f"(bus {number[high]})"
        )

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return f"<p>{escape(str(self))}</p>{self.df.to_html(float_format='{:.4g}'.format)}"


def solve(case: Case, limit: int = 30) -> PowerFlow:
    """Solve the power flow of a case.

    Newton's method starts from the voltages of the bus table. If it fails or leads to a voltage below 0.8 pu, it starts
    again from 1 pu at pq buses and the angles of a DC power flow (B. Stott, J. Jardim, O. Alsac, 2009), first without
    the powers. Of several solutions, the one whose lowest voltage is highest is taken.

    Parameters
    ----------
    case : Case
        The system. Machines at one bus share its reactive power, and at the swing bus the rest of its active power, in
        proportion to their bases. At a pq bus they produce their scheduled power. Loads with a voltage of their own
        draw the power of their characteristic at the voltage found.
    limit : int
        Largest number of Newton steps.

    Returns
    -------
    PowerFlow

    Raises
    ------
    PowerFlowError
        If no solution is found; it names the bus with the largest power mismatch.

    Examples
    --------
    >>> flow = st.load("two_area").power_flow()
    >>> abs(flow.V).round(3)
    array([1.03 , 1.01 , 1.03 , 1.01 , 1.006, 0.978, 0.961, 0.949, 0.971,
           0.983, 1.008])
    """
    case = as_case(case)
    net = network.build(case)
    Y = network.admittance(net)
    drawn = demands(case)
    produced = np.zeros(len(case.buses), complex)
    np.add.at(produced, net.machine_bus, np.array([complex(m.p, m.q) for m in case.machines]) / case.base_mva)
    kind = np.array([b.kind for b in case.buses])
    equations = Equations(Y, produced, drawn, np.flatnonzero(kind != "swing"), np.flatnonzero(kind == "pq"))
    size, angle = np.array([b.v for b in case.buses]), np.deg2rad([b.angle for b in case.buses])
    flat, turned = np.where(kind == "pq", 1.0, size), np.where(kind == "swing", angle, 0.0)
    power = (produced - drawn.at(flat)).real
    starts = chain([(size, angle)], ((flat, _dc_angles(net, equations.p, turned, p)) for p in (0 * power, power)))
    found, failed = [], []
    for start in starts:
        try:
            found.append(newton_power_flow(case, equations, *start, limit))
        except PowerFlowError as error:
            failed.append(error)
        else:
            if np.abs(found[-1][0]).min() >= LOW:
                break
    if not found:
        raise failed[0]
    V, iterations = max(found, key=lambda one: np.abs(one[0]).min())
    return PowerFlow(case, V, _shared(case, net.machine_bus, V * (Y @ V).conj() + drawn.at(np.abs(V))), iterations)


def _dc_angles(net: network.Network, free: np.ndarray, angle: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Angles (buses, rad) of a DC power flow of powers p (buses, pu); those of the buses in rows `free` are unknown."""
    n, b, shift = len(p), 1 / np.abs(net.z), np.angle(net.ratio)
    ends = np.concatenate([net.frm, net.to, net.frm, net.to]), np.concatenate([net.frm, net.to, net.to, net.frm])
    B = sp.csc_matrix((np.concatenate([b, b, -b, -b]), ends), shape=(n, n))
    flow = p + np.bincount(net.frm, b * shift, n) - np.bincount(net.to, b * shift, n) - B @ angle
    found = angle.copy()
    found[free] = splu(B[free][:, free]).solve(flow[free])
    return found


def _shared(case: Case, machine_bus: np.ndarray, injected: np.ndarray) -> np.ndarray:
    """Power (pu) of every machine: as scheduled, and the rest of the bus's power shared by machine base."""
    S = np.array([complex(m.p, m.q) for m in case.machines]) / case.base_mva
    base = np.array([m.base for m in case.machines])
    rest, whole = injected.copy(), np.zeros(len(injected))
    np.add.at(rest, machine_bus, -S)
    np.add.at(whole, machine_bus, base)
    return S + rest[machine_bus] * base / whole[machine_bus]


class Demand(NamedTuple):
    """Power drawn at every bus (buses), complex, pu: s0 + s1 |V| + s2 |V|^2."""

    s0: np.ndarray
    s1: np.ndarray
    s2: np.ndarray

    def at(self, size: np.ndarray) -> np.ndarray:
        """The power at these voltage magnitudes (buses), pu."""
        return self.s0 + self.s1 * size + self.s2 * size**2


def demands(case: Tables) -> Demand:
    """What loads and HVDC terminals draw; a load depends on the voltage if its row gives that of its p and q."""
    place = case.row_of_bus
    S = Demand(*np.zeros((3, len(case.buses)), complex))
    at = np.array([place[load.bus] for load in case.loads], int)
    parts = np.fromiter(chain.from_iterable(map(zip_load.parts, case.loads)), complex) / case.base_mva
    for order, part in zip(S, parts.reshape(-1, 3).T, strict=True):
        np.add.at(order, at, part)
    for link in case.links:
        S.s0[place[link.from_bus]] += link.p / case.base_mva
        S.s0[place[link.to_bus]] -= (link.p - link.loss) / case.base_mva
    return S


def demand(case: Tables, size: np.ndarray | None = None) -> np.ndarray:
    """Power (buses, complex, pu) drawn by loads and HVDC terminals at voltages of this size, or of the bus table."""
    return demands(case).at(np.array([b.v for b in case.buses]) if size is None else size)


def at_stored_voltages(case: Tables) -> tuple[np.ndarray, np.ndarray]:
    """Voltages of the bus table, and the power (pu) that flows from each bus beyond what its machines produce."""
    net = network.build(case)
    V = np.array([b.v for b in case.buses]) * np.exp(1j * np.deg2rad([b.angle for b in case.buses]))
    S = V * (network.admittance(net) @ V).conj() + demand(case)
    np.add.at(S, net.machine_bus, -np.array([complex(m.p, m.q) for m in case.machines]) / case.base_mva)
    return V, S


class Voltages(NamedTuple):
    """Voltages (buses), and how far they are from a solution."""

    size: np.ndarray  # pu
    angle: np.ndarray  # rad
    V: np.ndarray  # complex, pu
    power: np.ndarray  # complex, pu   into the network
    F: np.ndarray  # pu   mismatch of every equation
    worst: float  # pu   the largest; infinite if a voltage is not physical


class _Pattern(NamedTuple):
    """The sparsity of the Jacobian in compressed columns, and what stands where."""

    i: np.ndarray  # bus of the power, and bus on whose voltage it depends: entries of Y
    j: np.ndarray
    own: np.ndarray  # which of them are those of a bus with itself
    of_p: np.ndarray  # row of the equation of every active power, and column of the angle of its bus
    of_q: np.ndarray  # row of the equation of every reactive power, and column of the voltage of its bus
    taken: np.ndarray  # derivatives that are the entries of the Jacobian
    indices: np.ndarray  # of the Jacobian
    indptr: np.ndarray


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

    def current(self, now: Voltages) -> float:
        """The largest current mismatch, pu, which stays where a voltage V goes to 0 though its power V I* does, too."""
        return float((self.per_bus(now.F) / now.size).max())

    @cached_property
    def _pattern(self) -> _Pattern:
        """The sparsity of the Jacobian."""
        parts = self.Y.indptr, self.Y.indices, self.p, self.q
        return _pattern(*(np.asarray(part, np.int64).tobytes() for part in parts))

    def step(self, now: Voltages) -> tuple[np.ndarray, np.ndarray]:
        """Newton step of voltages (pu) and angles (rad). Raises RuntimeError if the Jacobian is singular."""
        at, miss, n = self._pattern, np.empty(len(now.F)), len(now.V)
        flow = now.V[at.i] * (self.Y.data * now.V[at.j]).conj()  # part of the power of bus i that depends on bus j
        by_size, turned = flow / now.size[at.j], flow.copy()  # derivatives by the angle are -j times `turned`
        turned[at.own] -= now.power
        by_size[at.own] += now.power / now.size + self.drawn.s1 + 2 * self.drawn.s2 * now.size
        entries = np.concatenate([turned.imag, by_size.real, -turned.real, by_size.imag])[at.taken]
        J = sp.csc_matrix((entries, at.indices, at.indptr), shape=(len(miss), len(miss)))
        miss[at.of_p], miss[at.of_q] = -now.F[: len(self.p)], -now.F[len(self.p) :]
        x = splu(J, "NATURAL", **SYMMETRIC).solve(miss)
        d_size, d_angle = np.zeros((2, n))
        d_angle[self.p], d_size[self.q] = x[at.of_p], x[at.of_q]
        return d_size, d_angle

    def per_bus(self, F: np.ndarray) -> np.ndarray:
        """Size (buses, pu) of the mismatch at every bus."""
        out = np.zeros(len(self.produced), complex)
        out[self.p] += F[: len(self.p)]
        out[self.q] += 1j * F[len(self.p) :]
        return np.abs(out)


@lru_cache(KEPT)
def _pattern(*parts: bytes) -> _Pattern:
    """Where the derivatives (in the order of `step`) stand in the Jacobian; buses in an order with little fill.

    The parts are pointers and indices of the admittance matrix, and the rows of buses with equations.
    """
    indptr, i, p, q = (np.frombuffer(part, np.int64) for part in parts)
    n, m = len(indptr) - 1, len(p) + len(q)
    j = np.repeat(np.arange(n), np.diff(indptr))
    unknown, position = np.zeros((n, 2), bool), _order(i, indptr)
    unknown[position[p], 0] = unknown[position[q], 1] = True
    number = np.where(unknown, np.cumsum(unknown).reshape(n, 2) - 1, -1)
    of_p, of_q = number[position].T
    rows = np.concatenate([of_p[i], of_p[i], of_q[i], of_q[i]])
    columns = np.concatenate([of_p[j], of_q[j], of_p[j], of_q[j]])
    inside = np.flatnonzero((rows >= 0) & (columns >= 0))
    J = sp.csc_matrix((inside.astype(float), (rows[inside], columns[inside])), shape=(m, m))
    return _Pattern(i, j, np.flatnonzero(i == j), of_p[p], of_q[q], J.data.astype(int), J.indices, J.indptr)


def _order(indices: np.ndarray, indptr: np.ndarray) -> np.ndarray:
    """Position of every bus in an order in which elimination adds few entries (minimum degree)."""
    n = len(indptr) - 1
    links = sp.csc_matrix((np.ones(len(indices)), indices, indptr), shape=(n, n))
    links.setdiag(n)
    return splu(links, "MMD_AT_PLUS_A", **SYMMETRIC).perm_c


def newton_power_flow(
    case: Case, equations: Equations, size: np.ndarray, angle: np.ndarray, limit: int
) -> tuple[np.ndarray, int]:
    """Voltages (pu) that solve the equations, and the steps it took; a step is halved until the mismatch falls."""
    with np.errstate(all="ignore"):
        now, iteration = equations.at(size, angle), 0
        for iteration in range(limit + 1):
            if now.worst < TOLERANCE / case.base_mva and equations.current(now) < CURRENT_TOLERANCE / case.base_mva:
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
