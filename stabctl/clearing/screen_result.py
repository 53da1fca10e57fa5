"""The result of a screen: faults at both ends of every line, the shortest clearing time first."""

import csv
import io
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from stabctl._util import files
from stabctl._util.errors import StudyError
from stabctl._util.tabular import inert, machine_column
from stabctl._util.units import cycles
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.model import naming, network
from stabctl.model.case import Case
from stabctl.model.naming import Circuit
from stabctl.model.tables import Branch

from .result import ClearingTime, watched
from .trial import Search

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = "fault", "trip", "cycles", "status", "machine", "limited_by", "name"  # of a table


class Lines(NamedTuple):
    """The lines of a case."""

    screened: tuple[Circuit, ...]
    bridges: tuple[Circuit, ...]  # whose opening splits the network
    twins: tuple[Circuit, ...]  # left out for an equal circuit that is screened


@dataclass(frozen=True, repr=False)
class Screen:
    """Clearing times of faults at the ends of lines, the shortest first, and how they were found.

    Attributes
    ----------
    case : str
        Name of the case.
    pairs : tuple of ClearingTime
        Clearing times of the pairs of a fault and the line opened to clear it.
    lines : Lines
        The lines screened, and those left out.
    search : Search
        Grid, limits and observation window of the search.
    frequency_hz : float, Hz
        Rated frequency, which converts cycles.
    screened : int
        Number of pairs tried.
    simulations : int
        Number of simulations of the searches.
    wall_s : float, s
        Computing time.
    left_out : tuple of str
        A sentence about each contingency of a file that names something out of service.

    Examples
    --------
    >>> screen = st.load("two_area").screen(below="10cyc")
    >>> screen.screened, [(pair.fault, pair.trip, pair.cycles) for pair in screen.pairs]
    (4, [('7', ('7-8',), 9.0)])
    """

    case: str
    pairs: tuple[ClearingTime, ...]
    lines: Lines
    search: Search
    frequency_hz: float
    screened: int
    simulations: int
    wall_s: float
    left_out: tuple[str, ...] = ()

    plot = verb("stabctl.view.figures.clearing:plot_screen")
    report = verb("stabctl.view.pages.clearing_pages:write_screen")

    def below(self, longest: str | float) -> "Screen":
        """The pairs with a shorter clearing time, and those that are always unstable.

        Parameters
        ----------
        longest : str or float
            Clearing time, "8cyc", or seconds.

        Returns
        -------
        Screen

        Raises
        ------
        StudyError
            If `longest` is not a time.

        Examples
        --------
        >>> screen = st.load("two_area").screen()
        >>> len(screen.pairs), len(screen.below("10cyc").pairs)
        (4, 1)
        """
        limit = cycles(longest, self.frequency_hz)
        kept = (p for p in self.pairs if p.status == "unstable_at_zero" or (p.cycles is not None and p.cycles < limit))
        shortest, longest = self.search.resolution_cycles, self.search.limit_cycles
        search = replace(self.search, limit_cycles=max(shortest, min(limit, longest)))
        return replace(self, pairs=tuple(kept), search=search)

    @property
    def observed_s(self) -> float:
        """Longest time (s) that a stable run was watched after its last event."""
        return max((p.observed_s for p in self.pairs), default=self.search.observed_s)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the table; the last, `name`, is that of a contingency, if there is one with a name."""
        return COLUMNS if any(p.contingency.name for p in self.pairs) else COLUMNS[:-1]

    def rows(self) -> list[tuple[Any, ...]]:
        """A row of `columns` for every pair.

        Examples
        --------
        >>> st.load("two_area").screen(below="10cyc").rows()
        [('7', '7-8', 9.0, 'found', 4, 'synchronism')]
        """
        columns = self.columns
        return [
            (p.fault, ", ".join(p.trip), p.cycles, p.status, p.machine, p.limited_by, p.contingency.name)[
                : len(columns)
            ]
            for p in self.pairs
        ]

    @property
    def df(self) -> "pd.DataFrame":
        """The pairs, a row each; `machine` loses synchronism first just beyond the clearing time.

        `limited_by` is what is lost there: "synchronism", "frequency" or "voltage", or "criteria" that are not kept.
        """
        import pandas as pd

        return machine_column(pd.DataFrame(self.rows(), columns=self.columns).astype({"cycles": float}))

    def save(self, path: str | Path) -> Path:
        """Write the pairs to a CSV file, atomically.

        Parameters
        ----------
        path : str or Path
            File to write, ending in .csv.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        StudyError
            If the name does not end in .csv, or the file cannot be written.

        Examples
        --------
        >>> st.load("two_area").screen(below="10cyc").save("screen.csv")
        PosixPath('screen.csv')
        """
        path = files.path_of(path)
        if path.suffix.lower() != ".csv":
            raise StudyError(f"The file {path.name!r} must end in .csv.")
        text = io.StringIO()
        csv.writer(text).writerows(
            [self.columns, *([inert(c) if isinstance(c, str) else c for c in r] for r in self.rows())]
        )
        files.replace(path, text.getvalue())
        return path

    def remarks(self) -> tuple[str, ...]:
        """How the pairs were found and what was left out, in sentences."""
        search, lost = self.search, [p for p in self.pairs if p.status == "unstable_at_zero"]
        what = (
            counted(self.screened, "contingency")
            if not self.lines.screened
            else f"{self.screened} fault and trip pairs"
        )
        shown = f"{len(self.pairs)} of {what}"
        if not self.pairs:
            shown = f"all {what} are stable for {search.limit_cycles:g} cycles"
        said = [
            f"{self.case}: {shown} (grid of {search.resolution_cycles:g} cycles up to {search.limit_cycles:g}, "
            f"{watched(search, self.observed_s, (p.contingency for p in self.pairs))}, {self.simulations} simulations "
            f"in {self.wall_s:.1f} s)."
        ]
        if lasting := sum(bool(p.remark()) for p in self.pairs):
            said.append(
                f"The swings of {counted(lasting, 'pair')} do not decay within {self.observed_s:g} s; with a longer "
                "observation, the clearing time may be shorter."
            )
        if cut := [p.contingency.label for p in self.pairs if p.cut_off()]:
            said.append(f"The switching cuts off a part of the system, whose load may be lost: {'; '.join(cut)}.")
        if lost:
            opened = dict.fromkeys(name for p in lost for name in p.trip)
            either = "Unstable, or against the criteria," if search.criteria else "Unstable"
            what = "the loss" if any(p.contingency.after for p in lost) else "opening the line"
            said.append(f"{either} after {what}, even without a fault: {', '.join(opened)}.")
        if self.lines.bridges:
            said.append(f"Left out because opening them splits the network: {', '.join(map(str, self.lines.bridges))}.")
        if self.lines.twins:
            said.append(f"Left out because a parallel circuit is identical: {', '.join(map(str, self.lines.twins))}.")
        return (*said, *self.idle())

    def idle(self) -> list[str]:
        """How many contingencies are left out because they name something out of service, and the first of them."""
        many = f"{counted(len(self.left_out), 'contingency')} left out that name something out of service; the first: "
        return [(many if len(self.left_out) > 1 else "") + first for first in self.left_out[:1]]

    def __str__(self) -> str:
        first, *others = self.remarks()
        return "\n".join([first, *(f"  {p.brief()}" for p in self.pairs), *others])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        first, *others = map(escape, self.remarks())
        return f"<p>{first}</p>{self.df.to_html(index=False)}<p>{'<br>'.join(others)}</p>"


def lines(case: Case) -> Lines:
    """The lines at the high-voltage buses of a case, in the order of its table.

    A line is a branch with reactance, of turns ratio 1 without phase shift, that does not end at a machine with a
    step-up transformer (a terminal whose storage belongs to another bus) or inside a transformer, and that either joins
    buses of one rated voltage or has charging.
    """
    apart = {m.bus for m in case.machines if m.storage_bus != m.bus} | {b.bus for b in case.buses if naming.internal(b)}
    rated = {b.bus: b.rated for b in case.buses}
    net = network.build(case)
    whole = network.islands(net).max()
    screened, bridges, twins = [], [], []
    beside: dict[frozenset[int], list[Branch]] = {}
    for row, (k, circuit) in enumerate(zip(case.branches, naming.circuits(case.branches), strict=True)):
        parallel = beside.setdefault(frozenset((k.from_bus, k.to_bus)), [])
        parallel.append(k)
        if not _is_line(k, rated, apart):
            continue
        if network.islands(net, network.without([row])).max() > whole:
            bridges.append(circuit)
        elif any(_same(k, other) for other in parallel[:-1]):
            twins.append(circuit)
        else:
            screened.append(circuit)
    return Lines(tuple(screened), tuple(bridges), tuple(twins))


def _is_line(k: Branch, rated: dict[int, float], apart: set[int]) -> bool:
    plain = k.tap == 1 and k.phase == 0 and k.x != 0 and not {k.from_bus, k.to_bus} & apart
    return plain and (rated[k.from_bus] == rated[k.to_bus] or k.b > 0)


def _same(one: Branch, other: Branch) -> bool:
    same = other._replace(from_bus=one.from_bus, to_bus=one.to_bus, circuit=one.circuit)
    return one == same
