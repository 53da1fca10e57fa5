"""Short-circuit power of every bus, and short-circuit ratios: how strong the grid is at each converter.

The faults are three-phase and bolted, at 1 pu, fed by the synchronous machines.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl import devices
from stabctl._util.errors import StudyError
from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb
from stabctl._util.wording import counted

from . import naming, network
from .case import Case, as_case
from .location import circuit

if TYPE_CHECKING:
    import pandas as pd

BLOCK = 256  # columns of the impedance matrix at a time


@dataclass(frozen=True, eq=False, repr=False)
class ShortCircuit(Tabular):
    """Short-circuit power of every bus of a case.

    Attributes
    ----------
    case : Case
        The system.
    impedance : ndarray (buses), complex, pu on the system base
        Thevenin impedance Z_kk; infinite where no machine feeds the bus.

    Examples
    --------
    >>> st.load("two_area").short_circuit().df[["bus", "short_circuit_mva"]].head(2).round()
       bus  short_circuit_mva
    0    1             4855.0
    1    2             5004.0
    """

    case: Case
    impedance: np.ndarray

    plot = verb("stabctl.view.figures.grid_strength:plot_short_circuit")
    report = verb("stabctl.view.pages.pattern:report")

    @property
    def mva(self) -> np.ndarray:
        """Short-circuit power 1/|Z_kk| (buses) at 1 pu, MVA."""
        return self.case.base_mva / np.abs(self.impedance)

    @property
    def df(self) -> "pd.DataFrame":
        """One row per bus: short-circuit power, Thevenin resistance and reactance, X/R."""
        import pandas as pd

        fed = np.isfinite(self.impedance)
        r, x = (np.where(fed, part, np.inf) for part in (self.impedance.real, self.impedance.imag))
        with np.errstate(divide="ignore", invalid="ignore"):
            return pd.DataFrame(
                {
                    "bus": [b.bus for b in self.case.buses],
                    "short_circuit_mva": self.mva,
                    "r_pu": r,
                    "x_pu": x,
                    "x_over_r": x / r,
                }
            )

    def __str__(self) -> str:
        weakest, strongest = (int(f(self.mva)) for f in (np.argmin, np.argmax))
        ends = (f"{self.mva[k]:.0f} MVA at bus {self.case.buses[k].bus}" for k in (weakest, strongest))
        return f"short-circuit power of {self.case.name}: from {' to '.join(ends)}"


def short_circuit(base: Any, *, trip: str | Iterable[str] | None = None) -> ShortCircuit:
    """Compute the short-circuit power S = 1/|Z_kk| of every bus.

    Z is the impedance matrix of the network with every synchronous machine as its subtransient impedance of the d axis,
    ra + j x''d, to ground; of a classical or two-axis machine it is the transient one, ra + j x'd. Branches with
    charging and taps and bus shunts are in it. Loads, HVDC links, storage devices and converters, also grid-forming
    ones, are not: converters limit their current. The voltage before the fault is 1 pu.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    trip : str or iterable of str, optional
        Circuits that are open: "7-8", "7-8#2, 8-9".

    Returns
    -------
    ShortCircuit

    Raises
    ------
    StudyError
        If the case has no dynamic data, or there is no such circuit.

    Examples
    --------
    >>> print(st.load("two_area").short_circuit(trip="7-8"))
    short-circuit power of two_area: from 1651 MVA at bus 8 to 4918 MVA at bus 2
    """
    case = as_case(base)
    return ShortCircuit(case, impedances(case, trip)[0])


@dataclass(frozen=True, eq=False, repr=False)
class ShortCircuitRatio(Tabular):
    """Short-circuit ratios of the converters of a case.

    Attributes
    ----------
    case : Case
        The system.
    converters : tuple of str
        Labels of the converters.
    buses : tuple of int
        Number of the bus of each.
    rated_mva : ndarray (converters), MVA
        Ratings.
    short_circuit_mva : ndarray (converters), MVA
        Short-circuit power of the bus of each.
    equivalent : ndarray (converters)
        Equivalent short-circuit ratios, with the interaction of the other converters.

    Examples
    --------
    >>> found = st.load("two_area").with_storage("4=200MW").short_circuit_ratio()
    >>> found.converters, found.ratio.round(2)
    (('ESD 4@10',), array([19.76]))
    """

    case: Case
    converters: tuple[str, ...]
    buses: tuple[int, ...]
    rated_mva: np.ndarray
    short_circuit_mva: np.ndarray
    equivalent: np.ndarray

    plot = verb("stabctl.view.figures.grid_strength:plot_short_circuit_ratio")

    @property
    def ratio(self) -> np.ndarray:
        """Short-circuit power of the bus over the rating of the converter (converters)."""
        return self.short_circuit_mva / self.rated_mva

    @property
    def weighted(self) -> float:
        """Weighted short-circuit ratio of all converters, sum S_k P_k / (sum P_k)^2."""
        return float(self.short_circuit_mva @ self.rated_mva / self.rated_mva.sum() ** 2)

    @property
    def df(self) -> "pd.DataFrame":
        """One row per converter: rating, short-circuit power of its bus, ratio, and equivalent ratio."""
        import pandas as pd

        return pd.DataFrame(
            {
                "converter": self.converters,
                "bus": self.buses,
                "rated_mva": self.rated_mva,
                "short_circuit_mva": self.short_circuit_mva,
                "scr": self.ratio,
                "escr": self.equivalent,
            }
        )

    def __str__(self) -> str:
        k = int(np.argmin(self.equivalent))
        return (
            f"{self.case.name}: {counted(len(self.converters), 'converter')}, {self.rated_mva.sum():.0f} MVA; weighted "
            f"short-circuit ratio {self.weighted:.2f}; weakest: {self.converters[k]} with SCR {self.ratio[k]:.2f}, "
            f"ESCR {self.equivalent[k]:.2f}"
        )


def short_circuit_ratio(base: Any, *, trip: str | Iterable[str] | None = None) -> ShortCircuitRatio:
    """Compute the short-circuit ratios of all converters: those of units, and storage devices.

    SCR_k = S_k / P_k with the short-circuit power S_k of the bus without any converter and the rating P_k in MVA;
    equivalent ratio with interaction factors ESCR_k = S_k / (P_k + sum_j |Z_kj / Z_jj| P_j), where |Z_kj / Z_jj| is the
    change of the voltage at k over that at j for a current injected at j; weighted ratio WSCR = sum S_k P_k over
    (sum P_k)^2. A static compensator is no converter here.
    Source: CIGRE TB 671, Connection of Wind Farms to Weak AC Networks, 2016 (SCRIF); Y. Zhang et al., Evaluating System
    Strength for Large-Scale Wind Plant Integration, IEEE PES General Meeting, 2014 (WSCR).

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    trip : str or iterable of str, optional
        Circuits that are open: "7-8", "7-8#2, 8-9".

    Returns
    -------
    ShortCircuitRatio

    Raises
    ------
    StudyError
        If there is no converter, the case has no dynamic data, or there is no such circuit.

    Examples
    --------
    >>> case = st.load("two_area").with_device("regc_c", 3)
    >>> print(case.short_circuit_ratio(trip="7-8"))
    two_area: 1 converter, 900 MVA; weighted short-circuit ratio 1.32; weakest: REGC_C 3 with SCR 1.32, ESCR 1.32
    """
    case = as_case(base)
    rows = installed(case)
    if not rows:
        raise StudyError(f"{case.name} has no converter and no storage device, so it has no short-circuit ratio.")
    names, buses, rated = zip(*rows, strict=True)
    at, P = np.array([case.row_of_bus[bus] for bus in buses]), np.array(rated)
    own, columns = impedances(case, trip, at)
    S = case.base_mva / np.abs(own[at])
    factor = np.abs(columns[at] / own[at])  # row k, column j: |Z_kj / Z_jj|; 1 at the same bus
    with np.errstate(invalid="ignore"):
        equivalent = S / (factor @ P)
    return ShortCircuitRatio(case, names, buses, P, S, np.where(S > 0, equivalent, 0.0))


def installed(case: Case) -> list[tuple[str, int, float]]:
    """Name, bus and MVA of every converter and storage device of a case."""
    found = [
        (f"{device.name} {m.called}", m.bus, m.base)
        for model, device in devices.models().among(case.devices)
        for m in case.machines
        if device.role == "converter" and model != "csvgn1" and m.machine in case.devices[model]
    ]
    return found + [
        (f"ESD {naming.device(case, s.machine, s.bus)}", s.bus, s.mva or s.rating) for s in case.storage if s.rating > 0
    ]


def impedances(
    case: Case, trip: str | Iterable[str] | None = None, buses: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Diagonal (buses) of the impedance matrix and its columns at some buses (buses, chosen), pu; see `short_circuit`.

    Parameters
    ----------
    case
        The case.
    trip
        Circuits that are open.
    buses
        Rows of the buses whose columns are wanted.
    """
    from scipy.sparse import diags
    from scipy.sparse.linalg import splu

    names = [name for name in (naming.listed(trip) if isinstance(trip, str) else trip or ()) if name]
    net = network.build(case)
    switching = network.without(circuit(case, name)[0] for name in names)
    sources = source_admittances(case, net)
    where = network.islands(net, switching)
    fed = np.flatnonzero(np.isin(where, where[sources != 0]))
    n, wanted = len(where), np.zeros(0, int) if buses is None else buses
    own, columns = np.full(n, np.inf + 0j), np.zeros((n, len(wanted)), complex)
    if len(fed):
        factors = splu((network.admittance(net, switching) + diags(sources, format="csc"))[fed][:, fed].tocsc())
        place = {int(bus): k for k, bus in enumerate(fed)}
        for first in range(0, len(fed), BLOCK):
            count = min(BLOCK, len(fed) - first)
            unit = np.zeros((len(fed), count), complex)
            unit[first + np.arange(count), np.arange(count)] = 1
            own[fed[first : first + count]] = factors.solve(unit)[first + np.arange(count), np.arange(count)]
        for k, bus in enumerate(wanted.tolist()):
            if bus in place:
                columns[fed, k] = factors.solve((np.arange(len(fed)) == place[bus]).astype(complex))
    return own, columns


def source_admittances(case: Case, net: network.Network) -> np.ndarray:
    """Admittance (buses), complex pu on the system base, of the synchronous machines at every bus.

    Raises `StudyError` if the case has no dynamic data.
    """
    if not case.devices:
        raise StudyError(
            f"{case.name} has no dynamic models, so the short-circuit impedances of its machines are not known; give "
            "their dynamic data, --dyr of a RAW file, or --machines typical."
        )
    found = np.zeros(len(case.buses), complex)
    for m, bus in zip(case.machines, net.machine_bus, strict=True):
        model = case.model(m.machine, "machine")
        if model is not None:
            device = devices.every()[model]
            par = device.prepared(case.devices[model][m.machine]._replace(mva=m.base / case.base_mva))
            own = device.fault_admittance
            found[bus] += device.admittances(np.array([par]))[0] if own is None else own(par)
    return found
