"""The power flow of a case: its solution as a record, with tables of buses and branches."""

from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from stabctl.devices.loads import zip_load
from stabctl.errors import PowerFlowError

from . import keys, network
from .case import Case, as_case
from .newton import Demand, Equations, newton

if TYPE_CHECKING:
    import pandas as pd


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
    """

    case: Case
    V: np.ndarray
    S: np.ndarray
    iterations: int

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
        return pd.DataFrame(columns, index=pd.Index(keys.keys(self.case, "branches"), name="circuit", dtype=str))

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
        return f"<p>{self}</p>{self.df.to_html(float_format='{:.4g}'.format)}"


def demands(case: Case) -> Demand:
    """What loads and HVDC terminals draw; a load depends on the voltage if its row gives that of its p and q."""
    place = {b.bus: i for i, b in enumerate(case.buses)}
    S = Demand(*np.zeros((3, len(case.buses)), complex))
    at = np.array([place[load.bus] for load in case.loads], int)
    parts = np.fromiter(chain.from_iterable(map(zip_load.parts, case.loads)), complex) / case.base_mva
    for order, part in zip(S, parts.reshape(-1, 3).T, strict=True):
        np.add.at(order, at, part)
    for link in case.links:
        S.s0[place[link.from_bus]] += link.p / case.base_mva
        S.s0[place[link.to_bus]] -= (link.p - link.loss) / case.base_mva
    return S


def demand(case: Case, size: np.ndarray | None = None) -> np.ndarray:
    """Power (buses, complex, pu) drawn by loads and HVDC terminals at voltages of this size, or of the bus table."""
    return demands(case).at(np.array([b.v for b in case.buses]) if size is None else size)


def solve(case: Case, limit: int = 30) -> PowerFlow:
    """Solve the power flow of a case, starting from the voltages in its bus table or, if that fails, from a flat start.

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
    try:
        V, iterations = newton(case, equations, size, angle, limit)
    except PowerFlowError as as_given:
        try:
            flat = np.where(kind == "pq", 1.0, size), _swing_angles(net, kind, angle)
            V, iterations = newton(case, equations, *flat, limit)
        except PowerFlowError:
            raise as_given from None
    injected = V * (Y @ V).conj() + drawn.at(np.abs(V))
    return PowerFlow(case, V, _shared(case, net.machine_bus, injected), iterations)


def _swing_angles(net: network.Network, kind: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """The angle (buses, rad) of the swing bus of the island of every bus."""
    island, swing = network.islands(net), np.flatnonzero(kind == "swing")
    of_island = np.zeros(island.max() + 1)
    of_island[island[swing]] = angle[swing]
    return of_island[island]


def _shared(case: Case, machine_bus: np.ndarray, injected: np.ndarray) -> np.ndarray:
    """Power (pu) of every machine: as scheduled, and the rest of the bus's power shared by machine base."""
    S = np.array([complex(m.p, m.q) for m in case.machines]) / case.base_mva
    base = np.array([m.base for m in case.machines])
    rest, whole = injected.copy(), np.zeros(len(injected))
    np.add.at(rest, machine_bus, -S)
    np.add.at(whole, machine_bus, base)
    return S + rest[machine_bus] * base / whole[machine_bus]
