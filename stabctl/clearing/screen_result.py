"""The result of a screen: pairs of a fault and the line opened to clear it, the shortest clearing time first."""

import csv
import io
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from stabctl._util import files
from stabctl._util.tabular import inert, machine_column
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.errors import StudyError
from stabctl.units import cycles

from .lines import Lines
from .result import ClearingTime, watched
from .search import Search

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = "fault", "trip", "cycles", "status", "machine"  # of a table


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
        Number of simulations.
    wall_s : float, s
        Computing time.
    """

    case: str
    pairs: tuple[ClearingTime, ...]
    lines: Lines
    search: Search
    frequency_hz: float
    screened: int
    simulations: int
    wall_s: float

    plot = verb("stabctl.plotting.screen:plot")
    report = verb("stabctl.report.screen_page:write")

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
        """
        limit = cycles(longest, self.frequency_hz)
        kept = (p for p in self.pairs if p.status == "unstable_at_zero" or (p.cycles is not None and p.cycles < limit))
        shortest, longest = self.search.resolution_cycles, self.search.limit_cycles
        search = replace(self.search, limit_cycles=max(shortest, min(limit, longest)))
        return replace(self, pairs=tuple(kept), search=search)

    @property
    def observed_s(self) -> float:
        """Longest time (s) that a stable run was watched after clearing."""
        return max((p.observed_s for p in self.pairs), default=self.search.observed_s)

    def rows(self) -> list[tuple[str, str, float | None, str, int | str | None]]:
        """A row of `COLUMNS` for every pair."""
        return [(p.fault, " ".join(p.trip), p.cycles, p.status, p.machine) for p in self.pairs]

    @property
    def df(self) -> "pd.DataFrame":
        """The pairs, a row each; `machine` loses synchronism first just beyond the clearing time."""
        import pandas as pd

        return machine_column(pd.DataFrame(self.rows(), columns=COLUMNS).astype({"cycles": float}))

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
        """
        path = files.path_of(path)
        if path.suffix.lower() != ".csv":
            raise StudyError(f"The file {path.name!r} must end in .csv.")
        text = io.StringIO()
        csv.writer(text).writerows(
            [COLUMNS, *([inert(c) if isinstance(c, str) else c for c in r] for r in self.rows())]
        )
        files.replace(path, text.getvalue())
        return path

    def remarks(self) -> tuple[str, ...]:
        """How the pairs were found and what was left out, in sentences."""
        search, lost = self.search, [p for p in self.pairs if p.status == "unstable_at_zero"]
        shown = f"{len(self.pairs)} of {self.screened} fault and trip pairs"
        if not self.pairs:
            shown = f"all {self.screened} fault and trip pairs are stable for {search.limit_cycles:g} cycles"
        said = [
            f"{self.case}: {shown} (grid of {search.resolution_cycles:g} cycles up to {search.limit_cycles:g}, "
            f"observed {watched(search, self.observed_s)} after clearing, {self.simulations} simulations in "
            f"{self.wall_s:.1f} s)."
        ]
        if lasting := sum(bool(p.remark()) for p in self.pairs):
            said.append(
                f"The swings of {counted(lasting, 'pair')} do not decay within {self.observed_s:g} s; with a longer "
                "observation, the clearing time may be shorter."
            )
        if lost:
            opened = dict.fromkeys(name for p in lost for name in p.trip)
            said.append(f"Unstable after opening the line, even without a fault: {', '.join(opened)}.")
        if self.lines.bridges:
            said.append(f"Left out because opening them splits the network: {', '.join(self.lines.bridges)}.")
        if self.lines.twins:
            said.append(f"Left out because a parallel circuit is identical: {', '.join(self.lines.twins)}.")
        return tuple(said)

    def __str__(self) -> str:
        first, *others = self.remarks()
        return "\n".join([first, *(f"  {p.brief()}" for p in self.pairs), *others])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        first, *others = map(escape, self.remarks())
        return f"<p>{first}</p>{self.df.to_html(index=False)}<p>{'<br>'.join(others)}</p>"
