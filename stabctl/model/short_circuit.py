"""Short-circuit power of every bus: three-phase bolted faults at 1 pu, fed by the synchronous machines."""

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl import devices
from stabctl._util.verbs import verb
from stabctl.errors import StudyError

from . import network
from .case import Case, as_case
from .location import circuit

if TYPE_CHECKING:
    import pandas as pd

BLOCK = 256  # columns of the impedance matrix at a time


@dataclass(frozen=True, eq=False, repr=False)
class ShortCircuit:
    """Short-circuit power of every bus of a case.

    Attributes
    ----------
    case : Case
        The system.
    impedance : ndarray (buses), complex, pu on the system base
        Thevenin impedance Z_kk; infinite where no machine feeds the bus.
    """

    case: Case
    impedance: np.ndarray

    plot = verb("stabctl.plotting.short_circuit:plot")

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

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return f"<p>{escape(str(self))}</p>{self.df.to_html(index=False, float_format='{:.4g}'.format)}"


def short_circuit(base: Any, *, trip: str | None = None) -> ShortCircuit:
    """Compute the short-circuit power S = 1/|Z_kk| of every bus.

    Z is the impedance matrix of the network with every synchronous machine as its subtransient (classical machines:
    transient) impedance to ground. Branches with charging and taps and bus shunts are in it. Loads, HVDC links, storage
    devices and converters, also grid-forming ones, are not: converters limit their current. The voltage before the
    fault is 1 pu.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    trip : str, optional
        Circuits that are open: "7-8", "7-8#2, 8-9".

    Returns
    -------
    ShortCircuit

    Raises
    ------
    StudyError
        If the case has no dynamic data, or there is no such circuit.
    """
    case = as_case(base)
    return ShortCircuit(case, impedances(case, trip)[0])


def impedances(case: Case, trip: str | None = None, buses: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
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

    open_ = network.BranchState(from_closed=False, to_closed=False)
    names = [name for name in (trip or "").split(",") if name.strip()]
    net = network.build(case)
    switching = network.Switching(branches=tuple((circuit(case, name)[0], open_) for name in names))
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
            "their dynamic data, --dyr or --machines typical."
        )
    found = np.zeros(len(case.buses), complex)
    for m, bus in zip(case.machines, net.machine_bus, strict=True):
        model = case.model(m.machine, "machine")
        if model is not None:
            device = devices.every()[model]
            par = device.prepared(case.devices[model][m.machine]._replace(mva=m.base / case.base_mva))
            found[bus] += device.admittances(np.array([par]))[0]
    return found
