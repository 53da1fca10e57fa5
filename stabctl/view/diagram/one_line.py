"""The one-line diagram of a case: positions of all symbols, and the voltages and flows of the power flow."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stabctl._util.verbs import verb
from stabctl.model import naming, network, powerflow
from stabctl.model.case import Case
from stabctl.model.powerflow import PowerFlow

from ._layout import cached_layout

if TYPE_CHECKING:
    import pandas as pd

    from stabctl.dynamics.operating_point import OperatingPoint


BESIDE = 0.07  # distance between parallel circuits
STORED = 0.3  # distance of a storage symbol from its machine
BUS, MACHINE, SQUARE = 0.21, 0.31, 0.24  # free distance of a storage symbol from other symbols
TURNS = np.deg2rad([0, 50, -50, 100, -100, 150, -150])


@dataclass(frozen=True, repr=False, eq=False)
class OneLine:
    """A one-line diagram. Positions are in lengths of the median branch; the longest axis is horizontal.

    Attributes
    ----------
    case : Case
        The system.
    buses, machines, storage : ndarray, (n, 2)
        Positions of the symbols, in the order of the tables.
    ends : ndarray, (branches, 2, 2)
        Both ends of every branch; parallel circuits lie beside each other.
    circuits : tuple of str
        Names of the branches: 7-8, 7-8#2.
    transformer : ndarray of bool, (branches)
        Branches with a turns ratio or between two rated voltages.
    voltage : ndarray, (buses), pu
        Voltages in the power flow.
    loading : ndarray, (branches), MVA
        The larger of the powers at the two ends.
    """

    case: Case
    buses: np.ndarray
    machines: np.ndarray
    storage: np.ndarray
    ends: np.ndarray
    circuits: tuple[str, ...]
    transformer: np.ndarray
    voltage: np.ndarray
    loading: np.ndarray

    plot = verb("stabctl.view.figures.one_line:draw")

    @property
    def df(self) -> "pd.DataFrame":
        """The buses, a row each: position, voltage (pu)."""
        import pandas as pd

        columns = {"x": self.buses[:, 0], "y": self.buses[:, 1], "v_pu": self.voltage}
        return pd.DataFrame(columns, index=pd.Index([b.bus for b in self.case.buses], name="bus"))

    def __str__(self) -> str:
        low = int(self.voltage.argmin())
        return (
            f"one-line diagram of {self.case.name}: {len(self.buses)} buses, {len(self.ends)} branches; the lowest "
            f"voltage is {self.voltage[low]:.3f} pu at bus {self.case.buses[low].bus}"
        )

    __repr__ = __str__


def one_line(base: "Case | OperatingPoint", flow: PowerFlow | None = None) -> OneLine:
    """The one-line diagram of a system.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system. Buses are drawn at the coordinates of `buses.csv`, if it has any; otherwise by a layout that is
        calculated once and kept in the user's cache folder.
    flow : PowerFlow, optional
        Its power flow; by default that of the operating point, or it is solved.

    Returns
    -------
    OneLine

    Raises
    ------
    StudyError
        If `base` is not a system.
    PowerFlowError
        If the power flow has no solution.

    Examples
    --------
    >>> st.load("two_area").one_line()
    one-line diagram of two_area: 11 buses, 12 branches; the lowest voltage is 0.949 pu at bus 8
    """
    case = powerflow.as_case(base)
    flow = flow or getattr(base, "flow", None) or powerflow.solve(case)
    X, net = cached_layout(case), network.build(case)
    buses, machines = X[: len(case.buses)], X[len(case.buses) :]
    unit = {m.machine: i for i, m in enumerate(case.machines)}
    rated = np.array([b.rated for b in case.buses])
    transformer = (net.ratio != 1) | (rated[net.frm] != rated[net.to])
    return OneLine(
        case,
        buses,
        machines,
        storage(case, buses, machines, (unit[s.machine] for s in case.storage)),
        _ends(buses, net.frm, net.to),
        tuple(map(str, naming.circuits(case.branches))),
        transformer,
        np.abs(flow.V),
        np.abs(flow.branch_power).max(axis=1, initial=0.0) * case.base_mva,
    )


def _ends(X: np.ndarray, frm: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Ends of the branches (branches, 2, 2); parallel ones are moved aside."""
    ends = np.stack([X[frm], X[to]], axis=1)
    between: defaultdict[tuple[int, int], list[int]] = defaultdict(list)
    for k, pair in enumerate(zip(frm.tolist(), to.tolist(), strict=True)):
        between[min(pair), max(pair)].append(k)
    for (a, b), rows in between.items():
        along = X[b] - X[a]
        across = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-9)
        for place, k in enumerate(rows):
            ends[k] += BESIDE * (place - (len(rows) - 1) / 2) * across
    return ends


def storage(case: Case, buses: np.ndarray, machines: np.ndarray, rows: Iterable[int]) -> np.ndarray:
    """Storage symbols (n, 2) beside the machines of these rows of the table.

    On the side away from the bus if it is free, otherwise turned to the nearest free place, or to where most room is.
    """
    symbols = [*((x, BUS) for x in buses), *((x, MACHINE) for x in machines)]
    X, room = np.array([x for x, _ in symbols]), np.array([r for _, r in symbols])
    found: list[np.ndarray] = []
    for i in rows:
        away = machines[i] - buses[case.row_of_bus[case.machines[i].bus]]
        angles = np.arctan2(away[1], away[0]) + TURNS
        tried = machines[i] + STORED * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        others, needed = np.r_[X, np.reshape(found, (-1, 2))], np.r_[room, np.full(len(found), SQUARE)]
        needed[len(buses) + i] = 0
        free = (np.linalg.norm(tried[:, None] - others, axis=2) - needed).min(axis=1)
        found.append(tried[int(np.argmax(free > 0)) if (free > 0).any() else int(free.argmax())])
    return np.reshape(found, (-1, 2))
