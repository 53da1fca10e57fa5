"""Reference numbers, published or of another program, beside ours.

Voltages, angles and powers are those of the power flow; an eigenvalue or a mode is compared with the nearest of ours,
each of ours with one of theirs at most; a clearing time is found anew. Angles are compared as they are, so that the
source and the case must have the same reference. Of a trace, the two values at the instant of the largest difference
are compared.
"""

import csv
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from stabctl._util.errors import StudyError, shown
from stabctl._util.tabular import Tabular
from stabctl._util.validation import checks_arguments
from stabctl._util.verbs import verb
from stabctl._util.wording import counted, near
from stabctl.clearing.critical_time import clearing_time
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.powerflow import PowerFlow, solve
from stabctl.simulation.contingency import Contingency
from stabctl.smallsignal.analysis import modes

from .systems import HERE, System, download, folder_of, present, systems
from .traces import traces

if TYPE_CHECKING:
    import pandas as pd

UNITS = {
    "voltage": "pu",
    "angle": "degrees",
    "active power": "MW",
    "reactive power": "Mvar",
    "eigenvalue": "1/s",
    "mode": "1/s",  # compared as an eigenvalue
    "clearing time": "s",
    "trace": "pu, MW or degrees",
}
PAIRS = "eigenvalue", "mode"  # quantities of two numbers
RESOLUTION = "1ms"  # of clearing times
NEAR = 0.01, 0.005  # Hz, damping ratio
SWING = 0.1, 5.0  # Hz   an oscillation in between is counted with the swings


class Published(NamedTuple):
    """A row of `published.csv`."""

    system: str
    quantity: str  # see `UNITS`
    object: str  # bus, name of the mode, or fault with the circuit that is opened
    value: float
    second: float  # imaginary part (rad/s) of an eigenvalue, damping ratio of a mode; else NaN
    tolerance: float  # NaN: that of the system
    reason: str


@dataclass(frozen=True)
class Comparison:
    """A published number, or mode, beside ours.

    Attributes
    ----------
    system, quantity, object : str
        What it is of: system, quantity, and bus, mode or fault.
    published, ours : float or complex
        In `unit`; an eigenvalue is complex (1/s, rad/s).
    unit : str
        Of a number.
    tolerance : float
        Largest difference, in the same unit.
    conventions : str
        What the published number assumes.
    reason : str
        Why the two differ by more than their digits.
    """

    system: str
    quantity: str
    object: str
    published: float | complex
    ours: float | complex
    unit: str
    tolerance: float
    conventions: str
    reason: str

    @property
    def numbers(self) -> int:
        """How many published numbers it is: 2 for an oscillation, which has a frequency and a damping."""
        return 1 + (np.imag(self.published) != 0)

    @property
    def difference(self) -> float:
        """Distance between the two, in `unit`."""
        return abs(self.published - self.ours)

    @property
    def within(self) -> bool:
        """Whether the difference is within the tolerance; never if we have no number."""
        return bool(self.difference <= self.tolerance)

    @property
    def swing(self) -> bool:
        """Whether it is an oscillation between 0.1 and 5 Hz."""
        return bool(SWING[0] <= np.imag(self.published) / (2 * math.pi) <= SWING[1])

    @property
    def hz_and_damping(self) -> tuple[float, float]:
        """Our frequency (Hz) minus theirs, and the same of the damping ratio; NaN if it is no oscillation."""
        if np.imag(self.published) == 0:
            return math.nan, math.nan
        theirs, ours = complex(self.published), complex(self.ours)
        return (ours.imag - theirs.imag) / (2 * math.pi), theirs.real / abs(theirs) - ours.real / abs(ours)

    @property
    def far(self) -> bool:
        """Whether it is an oscillation that differs by more than 0.01 Hz or 0.005 of the damping ratio."""
        hz, damping = map(abs, self.hz_and_damping)
        return self.swing and not (hz <= NEAR[0] and damping <= NEAR[1])


@dataclass(frozen=True, repr=False, eq=False)
class Verification(Tabular):
    """Reference numbers beside ours.

    Attributes
    ----------
    rows : tuple of Comparison
        Every comparison.
    missing : tuple of str
        Systems that were left out, because their files have not been downloaded.

    Examples
    --------
    >>> found = st.verify("wscc9_sauer_pai")
    >>> found.numbers, found.outside
    (33, ())
    """

    rows: tuple[Comparison, ...]
    missing: tuple[str, ...] = ()
    plot = verb("stabctl.view.figures.verification:plot")

    @property
    def numbers(self) -> int:
        """How many reference numbers were compared."""
        return sum(row.numbers for row in self.rows)

    @property
    def outside(self) -> tuple[Comparison, ...]:
        """Rows that differ by more than their tolerance."""
        return tuple(row for row in self.rows if not row.within)

    @cached_property
    def by_system(self) -> Mapping[str, tuple[Comparison, ...]]:
        """The rows of each system."""
        names = dict.fromkeys(row.system for row in self.rows)
        return {name: tuple(row for row in self.rows if row.system == name) for name in names}

    def largest(self) -> Iterator[tuple[Comparison, int]]:
        """Of every system and quantity the row nearest to its tolerance, or most beyond it, and how many numbers.

        Examples
        --------
        >>> [(row.quantity, count) for row, count in st.verify("wscc9_sauer_pai").largest()]
        [('angle', 8), ('voltage', 6), ('eigenvalue', 19)]
        """
        for rows in self.by_system.values():
            for quantity in dict.fromkeys(row.quantity for row in rows):
                mine = [row for row in rows if row.quantity == quantity]
                yield max(mine, key=lambda row: row.difference / row.tolerance), sum(row.numbers for row in mine)

    @property
    def df(self) -> "pd.DataFrame":
        """A row per comparison; eigenvalues in two columns."""
        import pandas as pd

        return pd.DataFrame(
            {
                "system": row.system,
                "quantity": row.quantity,
                "object": row.object,
                "published": np.real(row.published),
                "published_imag": np.imag(row.published),
                "ours": np.real(row.ours),
                "ours_imag": np.imag(row.ours),
                "unit": row.unit,
                "difference": row.difference,
                "tolerance": row.tolerance,
                "within": row.within,
                "hz_off": row.hz_and_damping[0],
                "damping_off": row.hz_and_damping[1],
                "conventions": row.conventions,
                "reason": row.reason,
            }
            for row in self.rows
        )

    def __str__(self) -> str:
        swings = [row for row in self.rows if row.swing]
        near = sum(not row.far for row in swings)
        beyond = "all within their tolerances" if not self.outside else f"{len(self.outside)} beyond their tolerance"
        text = f"{counted(self.numbers, 'reference number')} of {counted(len(self.by_system), 'system')}: {beyond}."
        if swings:
            limits = f"within {NEAR[0]} Hz and {NEAR[1]} of the damping ratio"
            text += f" {near} of {counted(len(swings), 'oscillation')} {limits}."
        if self.missing:
            text += "\nNot compared, as their files are not on this computer (stabctl verify --download): "
            text += f"{', '.join(self.missing)}."
        return text


@checks_arguments
def verify(
    system: str | None = None, *, folder: str | Path | None = None, download_missing: bool = False
) -> Verification:
    """Compute what publications and other programs give for known systems.

    Parameters
    ----------
    system : str, optional
        One of them; by default all whose files are on this computer.
    folder : str or Path, optional
        Where downloaded files are; by default in the user's cache.
    download_missing : bool
        Whether to download files that are missing, and compare them with their checksums.

    Returns
    -------
    Verification

    Raises
    ------
    StudyError
        If there is no such system, or its files are missing or cannot be downloaded.

    Examples
    --------
    >>> print(st.verify("wscc9_sauer_pai"))
    33 reference numbers of 1 system: all within their tolerances. ...
    """
    known, where = systems(), folder_of(folder)
    if system is not None and system not in known:
        others = near(str(system), known, "the systems are")
        raise StudyError(f"There are no reference numbers of {shown(system)}; {others}")
    rows: list[Comparison] = []
    missing, given = [], defaultdict(list)
    for row in published():
        given[row.system].append(row)
    for name in known if system is None else [system]:
        about = known[name]
        if download_missing:
            download(about, where)
        if present(about, where):
            rows += compare(about, where, given[name])
        elif system is not None:
            raise StudyError(
                f"The data of {name} may not be passed on with this program (license: {about.license}); add --download "
                f"(download_missing=True), or put {', '.join(one.name for one in about.files)} into {where}."
            )
        else:
            missing.append(name)
    return Verification(tuple(rows), tuple(missing))


def published() -> tuple[Published, ...]:
    """Every row of `published.csv`."""
    with (HERE / "published.csv").open(newline="", encoding="utf-8") as file:
        return tuple(
            Published(
                row["system"], row["quantity"], row["object"], float(row["value"]), float(row["second"] or "nan"),
                float(row["tolerance"] or "nan"), row["reason"],
            )
            for row in csv.DictReader(file)
        )  # fmt: skip


def compare(system: System, folder: Path, rows: Sequence[Published]) -> Iterator[Comparison]:
    """The reference numbers of a system beside ours."""
    ours = _Ours(system.read(folder))
    eigenvalues = iter(ours.eigenvalues([row for row in rows if row.quantity in PAIRS]))
    for row in rows:
        found = next(eigenvalues) if row.quantity in PAIRS else ours.number(row)
        limit = system.tolerance.get(row.quantity, math.nan) if math.isnan(row.tolerance) else row.tolerance
        yield Comparison(
            row.system, row.quantity, row.object, _value(row), found, UNITS[row.quantity], limit,
            system.conventions, row.reason or system.reason,
        )  # fmt: skip
    for trace in traces(system, ours.case) if system.run else ():
        k, quantity = trace.worst, trace.signal.partition(":")[0]
        yield Comparison(
            system.name, "trace", f"{trace.signal} at {trace.time[k]:.2f} s", float(trace.theirs[k]),
            float(trace.ours[k]), trace.unit, system.tolerance[quantity], system.conventions, system.reason,
        )  # fmt: skip


class _Ours:
    """Our numbers of a case; power flow and operating point are solved when they are needed."""

    def __init__(self, case: Case) -> None:
        self.case = case

    @cached_property
    def flow(self) -> PowerFlow:
        return solve(self.case)

    @cached_property
    def point(self) -> OperatingPoint:
        return self.case.initialize()

    def number(self, row: Published) -> float:
        """A quantity of a bus, or a critical clearing time (s), whose object is bus and circuit: "7 trip 5-7"."""
        if row.quantity == "clearing time":
            bus, _, trip = row.object.partition(" trip ")
            found = clearing_time(self.point, Contingency(bus, trip=trip or ()), resolution=RESOLUTION).seconds
            return math.nan if found is None else found
        at = naming.bus_number(self.case, row.object)
        (V,) = (v for v, bus in zip(self.flow.V, self.case.buses, strict=True) if bus.bus == at)
        if row.quantity == "voltage":
            return float(abs(V))
        if row.quantity == "angle":
            return float(np.rad2deg(np.angle(V)))
        S = self.case.base_mva * sum(s for s, m in zip(self.flow.S, self.case.machines, strict=True) if m.bus == at)
        return float(np.real(S) if row.quantity == "active power" else np.imag(S))

    def eigenvalues(self, rows: Sequence[Published]) -> list[complex]:
        """One of our eigenvalues for each of theirs."""
        return _nearest(modes(self.point).eigenvalues, rows) if rows else []


def _value(row: Published) -> float | complex:
    """The published number; eigenvalue s = -zeta w0 + j w of a mode that is given as frequency and damping ratio."""
    if row.quantity == "eigenvalue":
        return complex(row.value, row.second)
    if row.quantity == "mode":
        w = 2 * math.pi * row.value
        return complex(-row.second * w / math.sqrt(1 - row.second**2), w)
    return row.value


def _nearest(eigenvalues: np.ndarray, rows: Sequence[Published]) -> list[complex]:
    """One of our eigenvalues for each published one, with the least sum of relative distances; NaN if we have fewer."""
    wanted, found = np.array([_value(row) for row in rows]), eigenvalues[eigenvalues.imag >= 0]
    distance = np.abs(wanted[:, None] - found) / (0.1 + np.abs(wanted))[:, None]
    nearest = dict(zip(*map(list, linear_sum_assignment(distance)), strict=True))
    return [complex(found[nearest[i]]) if i in nearest else complex("nan") for i in range(len(rows))]


def text(value: float | complex) -> str:
    """A number, or an eigenvalue as real part ± imaginary part."""
    if isinstance(value, complex):
        return f"{value.real:.6g} ± {value.imag:.6g}j" if value.imag else f"{value.real:.6g}"
    return f"{value:.7g}"
