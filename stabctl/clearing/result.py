"""A critical clearing time: the longest fault, on a grid of clearing times, after which the system stays stable."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Literal

from stabctl._util.tabular import Tabular, machine_column
from stabctl._util.verbs import verb
from stabctl._util.wording import counted, enumerated
from stabctl.model import naming
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.events import event
from stabctl.simulation.outcome import Kind
from stabctl.simulation.swings import Swings

from .trial import Run, Search

if TYPE_CHECKING:
    import pandas as pd


def watched(search: Search, longest: float, contingencies: Iterable[Contingency]) -> str:
    """How stable runs were observed: `observed 5 to 20 s after clearing`, and by which criteria."""
    time = f"{search.observed_s:g}" + (f" to {longest:g}" if longest > search.observed_s + 1e-6 else "")
    kept = f", criteria {search.criteria.title}" if search.criteria else ""
    since = "the last event" if any(map(_goes_on, contingencies)) else "clearing"
    return f"observed {time} s after {since}{kept}"


def _goes_on(one: Contingency) -> bool:
    """Whether an event may follow the clearing."""
    return bool(one.events) or any(event(e, 60.0).at > 0 for e in one.after)


LIMITS = {
    Kind.LOST_SYNCHRONISM: "synchronism",
    Kind.FREQUENCY_INSTABILITY: "frequency",
    Kind.VOLTAGE_COLLAPSE: "voltage",
}  # what an unstable run has lost
Status = Literal["found", "unstable_at_zero", "stable_at_limit"]


@dataclass(frozen=True, repr=False)
class ClearingTime(Tabular):
    """A critical clearing time, and how it was found.

    Attributes
    ----------
    case : str
        Name of the case.
    contingency : Contingency
        The contingency; its own clearing time is ignored.
    status : {"found", "unstable_at_zero", "stable_at_limit"}
        Whether a critical clearing time was found within the search limit.
    cycles, seconds : float or None
        Longest stable clearing time on the grid; None if none is critical: the system is unstable even if cleared
        immediately, or stable up to the limit, as `status` says. `reach_cycles` is the longest survived in any case.
    machine : int, str or None
        Machine that loses synchronism first just beyond it.
    search : Search
        Grid, limits and observation window of the search.
    runs : tuple of Run
        Every simulation with the fault cleared, by clearing time.
    wall_s : float, s
        Computing time.

    Examples
    --------
    >>> found = st.load("two_area").clearing_time(st.Contingency("7", trip="7-8"))
    >>> found.status, found.cycles, found.seconds, found.machine, found.monotone
    ('found', 9.0, 0.15, 4, True)
    """

    case: str
    contingency: Contingency
    status: Status
    cycles: float | None
    seconds: float | None
    machine: int | str | None
    search: Search
    runs: tuple[Run, ...]
    wall_s: float

    plot = verb("stabctl.view.figures.clearing:plot_clearing_time")
    report = verb("stabctl.view.pages.pattern:report")

    @property
    def fault(self) -> str:
        """Fault location, as text."""
        return str(self.contingency.fault)

    @property
    def place(self) -> str:
        """What the contingency is called, or the place of its fault: `bus 7`, `7-8@0.4`."""
        on_line = isinstance(self.contingency.fault, naming.Circuit)
        return self.contingency.name or (self.fault if on_line else f"bus {self.fault}")

    @property
    def trip(self) -> tuple[str, ...]:
        """Circuits opened to clear it, in addition to the faulted one, machines tripped, and what follows, as text."""
        return self.contingency.tripped

    @property
    def reach_cycles(self) -> float:
        """Longest clearing time survived: 0 if there is none, the limit of the search if every one tried is."""
        return self.search.limit_cycles if self.status == "stable_at_limit" else self.cycles or 0.0

    @property
    def shown(self) -> str:
        """The cycles as text: `0`, `20.375`, or `60 or more` with the limit of the search."""
        return f"{self.reach_cycles:g}" + " or more" * (self.status == "stable_at_limit")

    @property
    def cell(self) -> str:
        """The cycles in a table: as `shown`, or `unstable at any` if there are none."""
        return "unstable at any" if self.status == "unstable_at_zero" else self.shown

    @property
    def lowest_unstable(self) -> float | None:
        """Lowest unstable clearing time found, cycles; None if every one tried was stable."""
        return min((r.cycles for r in self.runs if not r.stable), default=None)

    @property
    def limited_by(self) -> str | None:
        """What the lowest unstable run lost first: "synchronism", "frequency" or "voltage", or "criteria" not kept.

        None if there is none.
        """
        if self._lost is None:
            return None
        return "criteria" if self._lost.violated else LIMITS[self._lost.outcome]

    @property
    def _lost(self) -> Run | None:
        """The lowest unstable run; None if there is none."""
        return next((r for r in self.runs if not r.stable), None)

    @property
    def limit(self) -> str:
        """What limits the clearing time, in a few words: `synchronism of machine 4`, `voltage at bus 8`, or nothing.

        A rule of the criteria is named with its place: `WR1.3: bus 8`.
        """
        if self._lost and self._lost.violated:
            return self._lost.violated.label
        place = f" at bus {self._lost.bus}" if self._lost and self._lost.bus is not None else ""
        return (self.limited_by or "") + (f" of {naming.unit(self.machine)}" if self.machine is not None else place)

    @property
    def stable_above(self) -> tuple[float, ...]:
        """Clearing times (cycles) above the lowest unstable one that were found stable again."""
        least = self.lowest_unstable
        return () if least is None else tuple(r.cycles for r in self.runs if r.stable and r.cycles > least)

    @property
    def longest_stable(self) -> Run | None:
        """The longest stable run before an unstable one; None if there is none."""
        least = self.lowest_unstable
        stable = [r for r in self.runs if r.stable and (least is None or r.cycles < least)]
        return stable[-1] if stable else None

    @property
    def swings(self) -> Swings | None:
        """The last swings of the longest stable run before an unstable one; None if there are none, or not judged."""
        longest = self.longest_stable
        return longest.swings if longest else None

    @property
    def stalled(self) -> tuple[int, ...]:
        """Numbers of the buses whose motor loads have stalled at the end of the longest stable run."""
        longest = self.longest_stable
        return longest.stalled if longest else ()

    @property
    def observed_s(self) -> float:
        """Longest time (s) that a stable run was watched after its last event."""
        return max((r.observed_s for r in self.runs if r.stable), default=self.search.observed_s)

    @property
    def monotone(self) -> bool | None:
        """Whether every longer fault of the scan was unstable; None if none was tried.

        On the default grid of an eighth of a cycle the scan tries every point. A stable window beyond it, or between
        two of its points on a finer grid, is not found.
        """
        scanned = self.status == "found" and self.search.above_cycles > 0
        return False if self.stable_above else True if scanned else None

    @property
    def df(self) -> "pd.DataFrame":
        """The simulations of the search, a row for each clearing time tried."""
        import pandas as pd

        columns = "clearing_cycles", "stable", "outcome", "machine", "end_s", "violated"
        rows = [(r.cycles, r.stable, r.outcome.value, r.machine, r.time_s, str(r.violated or "")) for r in self.runs]
        frame = machine_column(pd.DataFrame(rows, columns=columns))
        return frame if self.search.criteria else frame.drop(columns="violated")

    def grouped(self) -> list[tuple[str, ...]]:
        """The simulations in words: clearing times (cycles), number, outcome, machine, end (s); ends alike in one "
        "row."""

        def span(values: list[float], form: str) -> str:
            return " to ".join(dict.fromkeys(f"{v:{form}}" for v in (min(values), max(values))))

        rows: list[tuple[str, ...]] = []
        for (outcome, machine, broken), group in groupby(self.runs, lambda r: (r.outcome, r.machine, bool(r.violated))):
            alike = list(group)
            times, ends = span([r.cycles for r in alike], "g"), span([r.time_s for r in alike], ".2f")
            first = "" if machine is None else naming.unit(machine)
            said = "criteria not kept" if broken else outcome.value.replace("_", " ")
            rows.append((times, str(len(alike)), said, first, ends))
        return rows

    def brief(self) -> str:
        """The answer, without case and search.

        Examples
        --------
        >>> st.load("two_area").clearing_time("7-8@0.4").brief()
        'fault 7-8@0.4: 20.375 cycles; machine 4 loses synchronism first'
        """
        first, what = self._first(), f"fault {self.fault}" + (f", trip {', '.join(self.trip)}" if self.trip else "")
        if self.status == "unstable_at_zero":
            return f"{what}: {self._never()}{first}"
        if self.status == "stable_at_limit":
            return f"{what}: stable up to the limit"
        return f"{what}: {self.cycles:g} cycles{first}"

    def _never(self) -> str:
        """What is the matter with every clearing time."""
        what = "against the criteria" if self._lost and self._lost.violated else "unstable"
        return f"{what} even if cleared immediately"

    def _first(self) -> str:
        """What fails first just beyond, as the end of a sentence; empty if nothing does."""
        if self._lost and self._lost.violated:
            return f"; beyond, {str(self._lost.violated).removesuffix('.')}"
        if self.limited_by in ("frequency", "voltage"):
            return f"; limited by {self.limit}, not by loss of synchronism"
        return f"; {naming.unit(self.machine)} loses synchronism first" if self.machine is not None else ""

    def window(self) -> str:
        """A sentence on the stable clearing times above the lowest unstable one; empty if there are none."""
        if not self.stable_above:
            return ""
        again = ", ".join(f"{cycles:g}" for cycles in self.stable_above[:8])
        least = f"unstable at {self.lowest_unstable:g} cycles, the lowest unstable time found"
        return f"Stability is not monotone: {least}, and stable again at {again} cycles."

    def stall(self) -> str:
        """A sentence on motor loads that have stalled in the longest stable run; empty if there are none."""
        where = enumerated("bus", self.stalled)
        return f"In the longest stable run, motor loads at {where} have stalled." if self.stalled else ""

    def cut_off(self) -> str:
        """A sentence on what the switching separates or blacks out in the longest stable run; empty if it does not."""
        longest = self.longest_stable
        return longest.cut_off if longest else ""

    def undecided(self) -> str:
        """A sentence on a rule for which the longest stable run is too short; empty if there is none."""
        longest = self.longest_stable
        return longest.undecided if longest else ""

    def remark(self) -> str:
        """A sentence on large swings of the answer that last, and on any that grow; empty if there are none."""
        if self.swings is None or self.swings.settled or not (self.swings.growing or self.swings.lasting):
            return ""
        how = "grow" if self.swings.growing else "do not decay"
        seconds = f"{self.observed_s:g} s"
        return f"Its swings {how} within {seconds}; with a longer observation, the clearing time may be shorter."

    def __str__(self) -> str:
        observed = f"{watched(self.search, self.observed_s, [self.contingency])}, {counted(len(self.runs), 'run')}"
        what = f"{self.case}, fault {self.fault}" + (f", trip {', '.join(self.trip)}" if self.trip else "")
        first = self._first()
        if self.status == "unstable_at_zero":
            return f"{what}: {self._never()}{first} ({observed})."
        text = f"{what}: stable up to the search limit of {self.search.limit_cycles:g} cycles ({observed})."
        if self.cycles is not None:
            text = f"{what}: critical clearing time {self.cycles:g} cycles ({self.seconds:.4f} s){first} ({observed})."
        said = text, self.cut_off(), self.stall(), self.remark(), self.undecided(), self.window()
        return " ".join(part for part in said if part)
