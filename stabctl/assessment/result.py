"""The result of a stability study: margins, damping and voltages against what is wanted, tables, sentences."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl._util import files
from stabctl._util.errors import StudyError
from stabctl._util.tabular import Tabular, inert
from stabctl._util.units import cycles
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.clearing import ClearingTime, Screen, Severity
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.io.contingencies import Monitored
from stabctl.judgment import Criteria, Judged, judge
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.powerflow import PowerFlow
from stabctl.model.short_circuit import ShortCircuitRatio
from stabctl.model.unusual import UnusualData
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control
from stabctl.simulation.trajectory import Trajectory
from stabctl.smallsignal import Modes
from stabctl.smallsignal.analysis import DAMPING
from stabctl.smallsignal.contributions import Contributions, contributions

from .remedy import Remedy
from .remedy import table as remedy_table

if TYPE_CHECKING:
    import pandas as pd

BAND = 0.1, 3.0  # Hz   of the modes that are judged
NORMAL = 0.95, 1.05  # pu   voltages in normal operation
SHEET = ".xlsx"
BOUND = {"unstable_at_zero": " or less", "found": "", "stable_at_limit": " or more"}  # of a margin


class Wanted(NamedTuple):
    """What a system must fulfil: voltages are reported, the others judged."""

    cycles: float  # clearing time that protection guarantees
    damping: float  # damping ratio of every oscillation in `BAND`
    voltages: tuple[float, float] = NORMAL  # pu   in normal operation
    monitored: Monitored | None = None  # ranges of some buses in place of it

    @property
    def dampings(self) -> tuple[float, float]:
        """Damping ratios of the modes computed where these are not all."""
        return DAMPING[0], max(DAMPING[1], self.damping)


class Margin(NamedTuple):
    """A contingency with its critical clearing time."""

    found: ClearingTime
    cycles: float  # beyond the required clearing time; negative: not survived; a bound where no time is critical
    required: float  # cycles   clearing time of the contingency itself, or else that which protection guarantees

    @property
    def secure(self) -> bool:
        """Whether it is survived."""
        return self.cycles >= 0 and self.found.status != "unstable_at_zero"

    @property
    def known_cycles(self) -> float | None:
        """The cycles; None if they are a bound."""
        return self.cycles if self.found.status == "found" else None

    @property
    def shown(self) -> str:
        """The cycles as text: `+3`, `+2 or more` at the limit of the search, `-6 or less` if no time is survived."""
        return f"{self.cycles:+g}{BOUND[self.found.status]}"


@dataclass(frozen=True, repr=False, eq=False)
class Study(Tabular):
    """A stability study; parts that are not done yet are None.

    Attributes
    ----------
    point : OperatingPoint
        The system at its operating point.
    wanted : Wanted
        What it must fulfil.
    unusual : UnusualData
        Data outside the usual ranges.
    flow : PowerFlow
        The power flow.
    modes : Modes or None
        The modes: all, or those of 0.1 to 3 Hz of a large system.
    no_modes : str
        Why there are none, if the system cannot be linearized.
    ratios : ShortCircuitRatio or None
        Short-circuit ratios; None also without converters.
    screen : Screen or None
        Critical clearing times.
    ranking : tuple of Severity
        During the screen: the contingencies in the order of a short run of each, the worst first.
    worst : tuple of Trajectory
        Runs of the contingencies with the smallest margins, cleared after the required time.
    how : Settings
        How it was computed.
    remedies : tuple of Remedy
        What would help, as far as it was asked for.
    wall_s : float, s
        Computing time.

    Examples
    --------
    >>> study = st.study(st.load("two_area"), clear="10cyc", faults="lines", worst=1)
    >>> study.secure, [round(margin.cycles, 3) for margin in study.margins]
    (False, [-1.0, 5.875, 37.0, 37.75])
    """

    point: OperatingPoint
    wanted: Wanted
    unusual: UnusualData
    flow: PowerFlow
    how: "Settings"
    modes: Modes | None = None
    no_modes: str = ""
    ratios: ShortCircuitRatio | None = None
    screen: Screen | None = None
    ranking: tuple[Severity, ...] = ()
    worst: tuple[Trajectory, ...] = ()
    remedies: tuple[Remedy, ...] = ()
    wall_s: float = 0.0

    report = verb("stabctl.view.pages.study_page:write")

    @cached_property
    def margins(self) -> tuple[Margin, ...]:
        """The contingencies, the smallest margin first."""
        pairs = self.screen.pairs if self.screen else ()
        found = [Margin(p, p.reach_cycles - (need := self._required(p)), need) for p in pairs]
        return tuple(sorted(found, key=lambda m: (m.cycles, [*BOUND].index(m.found.status))))

    def _required(self, found: ClearingTime) -> float:
        """Clearing time, cycles, of a contingency itself, or else that which protection guarantees."""
        own = found.contingency.clear
        return self.wanted.cycles if own is None else cycles(own, self.point.case.frequency_hz)

    @property
    def guaranteed(self) -> str:
        """The clearing time that contingencies must survive, in words: `6 cycles`, `6 cycles, or their own`."""
        own = [m.required != self.wanted.cycles for m in self.margins]
        theirs, time = "its own" if len(own) == 1 else "their own", _cycles(self.wanted.cycles)
        return theirs if own and all(own) else f"{time}, or {theirs}" if any(own) else time

    @property
    def insecure(self) -> tuple[Margin, ...]:
        """The contingencies that are not survived with the required clearing time."""
        return tuple(m for m in self.margins if not m.secure)

    @property
    def runs(self) -> list[tuple[Contingency, float]]:
        """The contingencies of `worst`, cleared after the required time, and an end (s) to `simulate` each run again.

        Examples
        --------
        >>> study = st.study(st.load("two_area"), clear="10cyc", faults="lines", worst=2)
        >>> [(contingency.label, round(until, 3)) for contingency, until in study.runs]
        [('7 trip 7-8', 21.167), ('9 trip 8-9', 6.167)]
        """
        found = []
        for m, run in zip(self.margins, self.worst, strict=False):
            one, last = cleared(m, self.point.case)
            longest = max(m.found.search.observed_s, m.found.search.longest_s)  # one that is lost ends earlier
            found.append((one, run.outcome.time_s if run.outcome.stable else last + longest))
        return found

    @property
    def oscillations(self) -> tuple[int, ...]:
        """The oscillatory modes of `BAND`, and those of any frequency that grow, the least damped first."""
        if (found := self.modes) is None:
            return ()
        judged = dict.fromkeys((*found.within(*BAND), *(k for k in found.unstable if found.eigenvalues[k].imag)))
        return tuple(sorted(judged, key=found.damping_ratio.__getitem__))

    @property
    def poorly_damped(self) -> tuple[int, ...]:
        """Those of them with less than the wanted damping ratio."""
        return tuple(k for k in self.oscillations if self.modes.damping_ratio[k] < self.wanted.damping)  # type: ignore[union-attr]

    @property
    def unstable(self) -> str:
        """Why the operating point is unstable, in words; empty if it is not, or not linearized."""
        found = self.modes
        return "" if found is None or found.stable else f"the operating point is unstable: {found.fastest_growing()}"

    def contributions(self, k: int) -> Contributions | None:
        """What the controls contribute to a mode; None for one that coincides with another, or without modes.

        Parameters
        ----------
        k : int
            Index of the mode in `modes`.

        Returns
        -------
        Contributions or None

        Examples
        --------
        >>> study = st.study(st.load("two_area"), clear="6cyc", faults="lines", worst=0)
        >>> study.contributions(study.modes.least_damped()[0]).damping[0].name
        'PSS 4'
        """
        try:
            return contributions(self.modes, k) if self.modes is not None else None
        except StudyError:
            return None

    @property
    def low_or_high(self) -> tuple[tuple[int, float], ...]:
        """Buses whose voltage (pu) is outside the normal range, the farthest first."""
        own = self.wanted.monitored.voltages if self.wanted.monitored else {}
        low, high = np.array([own.get(b.bus, self.wanted.voltages) for b in self.flow.case.buses]).T
        size = np.abs(self.flow.V)
        inside = [naming.internal(b) for b in self.flow.case.buses]
        beyond = np.where(inside, 0.0, np.maximum(low - size, size - high))
        rows = np.argsort(-beyond, kind="stable")[: int((beyond > 1e-9).sum())]
        return tuple((self.flow.case.buses[k].bus, float(size[k])) for k in rows)

    @cached_property
    def judged(self) -> tuple[Judged, ...]:
        """How the runs of the worst contingencies keep the criteria; nothing without criteria."""
        return tuple(judge(run, self.how.criteria) for run in self.worst) if self.how.criteria else ()

    @property
    def compliance(self) -> str:
        """How the worst contingencies keep the criteria, in a sentence; empty if none is judged."""
        if not self.judged:
            return ""
        wrong = sum(not one.kept for one in self.judged)
        told = next((str(v) for one in self.judged for v in (*one.violations, one.unstable) if v), "")
        of = f"{self.judged[0].title}, by the {counted(len(self.judged), 'contingency')} simulated"
        return f"{of}: {f'violated by {wrong}; the first, {told}' if wrong else 'kept.'}"

    @property
    def complete(self) -> bool:
        """Whether every part is done, and every contingency screened."""
        known = self.modes is not None or bool(self.no_modes)
        return known and self.screen is not None and len(self.screen.pairs) == self.screen.screened

    @property
    def secure(self) -> bool:
        """Whether the operating point is stable, every contingency survived, and oscillations damped as wanted.

        The worst contingencies must keep the criteria, and the modes be known. Voltages in normal operation do not
        count. Raises `StudyError` while a part is missing.
        """
        if not self.complete:
            raise StudyError(f"The study of {self.point.case.name} is not complete, so it has no verdict yet.")
        wrong = self.unstable or self.insecure or self.poorly_damped or self.no_modes
        return not wrong and all(one.kept for one in self.judged)

    @property
    def df(self) -> "pd.DataFrame":
        """A row for every contingency: fault, trip, required, critical and margin in cycles, status, what limits it.

        Without a critical clearing time there are neither critical cycles nor a margin, and `status` says why.
        """
        import pandas as pd

        rows = [
            (m.found.contingency.name or "", m.found.fault, ", ".join(m.found.trip), m.required)
            + (m.found.cycles, m.known_cycles, m.found.status, m.found.limit)
            for m in self.margins
        ]
        names = "name", "fault", "trip", "required_cycles", "critical_cycles", "margin_cycles", "status", "limited_by"
        return pd.DataFrame(rows, columns=names).astype({"critical_cycles": float, "margin_cycles": float})

    def tables(self) -> "dict[str, pd.DataFrame]":
        """Every table of the study, by name.

        Examples
        --------
        >>> [*st.study(st.load("two_area"), clear="6cyc", faults="lines", worst=1).tables()]
        ['contingencies', 'worst', 'modes', 'buses', 'branches']
        """
        import pandas as pd

        found = {"contingencies": self.df} if self.screen else {}
        if self.worst:
            rows = [
                (m.found.contingency.label, run.outcome.kind.value, run.outcome.message, run.max_angle_from_coi_deg)
                for m, run in zip(self.margins, self.worst, strict=False)
            ]
            found["worst"] = pd.DataFrame(rows, columns=["contingency", "outcome", "message", "largest_angle_deg"])
        if any(one.violations for one in self.judged):
            pairs = zip(self.margins, self.judged, strict=False)
            frames = [one.df.assign(contingency=m.found.contingency.label) for m, one in pairs if one.violations]
            found["violations"] = pd.concat(frames, ignore_index=True)
        if self.modes is not None:
            found["modes"] = self.modes.df
        found |= {"buses": self.flow.df.reset_index(), "branches": self.flow.branches.reset_index()}
        found |= {"remedies": remedy_table(self.remedies)} if self.remedies else {}
        return found | ({"converters": self.ratios.df} if self.ratios else {})

    def save(self, path: str | Path) -> Path:
        """Write the contingencies to a .csv file, or all tables to the sheets of an .xlsx file.

        Parameters
        ----------
        path : str or Path
            File to write; an existing one is replaced only when the new one is complete.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        StudyError
            For another ending, or a file that cannot be written.

        Examples
        --------
        >>> st.study(st.load("two_area"), clear="6cyc", faults="lines", worst=1).save("study.csv")
        PosixPath('study.csv')
        """
        if (path := files.path_of(path)).suffix.lower() != SHEET:
            return super().save(path)
        files.replace(path, _workbook(self.tables()))
        return path

    def remarks(self) -> list[str]:
        """The answer, in sentences: stability without a fault, contingencies, damping, voltages, what would help."""
        case, wanted = self.point.case.name, self.wanted
        said = [f"{case}: {self.unstable}. Clearing times hold for the time observed only."] * bool(self.unstable)
        if self.screen is not None:
            number, lost = counted(len(self.screen.pairs), "contingency"), self.insecure
            number += "" if self.complete else f" screened so far ({self.screen.screened} in all)"
            if lost:
                first, be = lost[0].found, "is" if len(lost) == 1 else "are"
                when = f"critical after {_cycles(first.reach_cycles)}"
                if first.status == "unstable_at_zero":
                    when = "lost even if cleared at once"
                elif -(grid := first.search.resolution_cycles) < lost[0].cycles:  # a time between two points
                    when += f" (only multiples of {_cycles(grid)} were tried)"
                said.append(
                    f"{case}: {len(lost)} of {number} {be} lost with a clearing time of at most "
                    f"{self.guaranteed}. The worst is {first.contingency.label}, {when}, limited by "
                    f"{first.limit}."
                )
            else:
                least = ""
                if self.margins:
                    smallest = self.margins[0]
                    bound = "at least " if smallest.known_cycles is None else ""
                    least = f"; the smallest margin is {bound}{_cycles(smallest.cycles)}"
                said.append(f"{case}: {number} survived with a clearing time of {self.guaranteed}, none lost{least}.")
            said += self.screen.idle()
        if self.modes is not None:
            if few := self.poorly_damped:
                which = f"of {BAND[0]:g} to {BAND[1]:g} Hz" + ", or growing," * bool(self.unstable)
                said.append(
                    f"{counted(len(few), 'oscillation')} {which} with a damping ratio below {wanted.damping:g}; "
                    f"the least damped: {_named(self.modes, few[0])}{_undamped(self.contributions(few[0]))}."
                )
            elif self.oscillations:
                said.append(
                    f"All oscillations of {BAND[0]:g} to {BAND[1]:g} Hz have a damping ratio of at least "
                    f"{wanted.damping:g}; the least damped: {_named(self.modes, self.oscillations[0])}."
                )
        if self.no_modes:
            said.append(f"Oscillations are not judged, so the system does not count as secure: {self.no_modes}")
        said += [self.compliance] * bool(self.judged)
        low, high = wanted.voltages
        outside = ", ".join(f"bus {bus} {size:.4f} pu" for bus, size in self.low_or_high[:5])
        more = f" and {len(self.low_or_high) - 5} more" if len(self.low_or_high) > 5 else ""
        if outside:
            limits = ", or the monitored ranges," if wanted.monitored else ""
            said.append(f"Voltages outside {low:g} to {high:g} pu{limits} in normal operation: {outside}{more}.")
        if wanted.monitored:
            said += wanted.monitored.remarks()
        if self.unusual.findings:
            said.append(f"{counted(len(self.unusual.findings), 'value')} of the data are unusual; see stabctl check.")
        return said + [str(remedy) for remedy in self.remedies]

    def __str__(self) -> str:
        return "\n".join(self.remarks())


class Settings(NamedTuple):
    """How a study is computed."""

    faults: Any
    control: Control
    criteria: Criteria | None = None
    remedies: tuple[str, ...] = ()  # that are looked for
    source: str = ""  # the line of Python that makes its operating point `base`, if that is known


def cleared(m: Margin, case: Case) -> tuple[Contingency, float]:
    """A contingency cleared after the required time, and the instant (s) of its last event."""
    one = m.found.contingency.with_clear(m.required / case.frequency_hz)
    return one, max(event.at for event in one.timed(case))


def _cycles(number: float) -> str:
    return f"{number:g} cycle{'s' * (number != 1)}"


def _named(found: Modes, k: int) -> str:
    """Frequency, damping ratio and name of a mode."""
    return f"{found.frequency_hz[k]:.3f} Hz, damping ratio {found.damping_ratio[k]:z.4f} ({found.label(k)})"


def _undamped(found: Contributions | None) -> str:
    """The controls that take most damping from a mode, as the end of a sentence; empty if there are none."""
    who = [one.name for one in found.undamping[:3]] if found else []
    return f", undamped most by {', '.join(who)}" if who else ""


def _workbook(tables: "dict[str, pd.DataFrame]") -> bytes:
    """The tables as the sheets of a workbook. Text that begins like a formula has an apostrophe before it."""
    import io

    import pandas as pd

    content = io.BytesIO()
    with pd.ExcelWriter(content, engine="openpyxl") as book:
        for name, frame in tables.items():
            kept = frame.copy()
            for column in kept.select_dtypes(exclude="number"):
                kept[column] = kept[column].map(lambda value: inert(value) if isinstance(value, str) else value)
            kept.to_excel(book, sheet_name=name, index=False, freeze_panes=(1, 0))
    return content.getvalue()
