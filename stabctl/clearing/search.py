"""How critical clearing times are searched: one record for a single fault, a screen and a siting study."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.simulation.criterion import DEFAULT, Criterion, checked
from stabctl.units import cycles, seconds

LONGEST_SCAN = 600.0  # cycles
AUTO = "auto"  # a scan of `BELOW`, as the swings of the answer demand, and of `ABOVE`
BELOW, ABOVE = 2.0, 4.0  # cycles
SPACING = 0.125  # cycles between the faults of a scan, and between those tried first on a finer grid
HALF = 0.5  # cycles   between an answer and the one shorter fault that is always tried


class Scan(NamedTuple):
    """Other faults to be tried on one side of an answer."""

    spacing: int  # points of the grid
    number: int


NO_SCAN = Scan(1, 0)


@dataclass(frozen=True)
class Search:
    """The grid of clearing times and the criterion by which each is judged, in cycles and seconds.

    Raises `StudyError` for a grid without points or an empty observation window.
    """

    resolution_cycles: float = 0.125
    limit_cycles: float = 60.0
    observed_s: float = 5.0  # s   observed after clearing
    step: float | None = None  # s
    criterion: Criterion = DEFAULT
    scan_cycles: float | None = None  # range below the answer in which others are tried; None: as its swings demand
    above_cycles: float = 0.0  # the same above it
    longest_s: float = 0.0  # s   observed at most, while the swings have not settled; if less than `observed_s`: never

    def __post_init__(self) -> None:
        if not 0 < self.resolution_cycles <= self.limit_cycles < math.inf:
            raise StudyError(
                f"The resolution of {self.resolution_cycles:g} cycles is not allowed; it must be more than 0 and at "
                f"most the search limit of {self.limit_cycles:g} cycles."
            )
        if not 0 < self.observed_s < math.inf:
            raise StudyError(f"The observation window of {self.observed_s:g} s is not allowed; it must be more than 0.")
        if not 0 <= self.longest_s < math.inf:
            raise StudyError(f"The longest observation of {self.longest_s:g} s is not allowed; give at least 0.")
        if not 0 <= self.range_cycles <= LONGEST_SCAN:
            raise StudyError(
                f"The scan of {self.range_cycles:g} cycles is not allowed; give 0 to {LONGEST_SCAN:g} cycles."
            )

    @classmethod
    def of(
        cls,
        case: Case,
        *,
        resolution: Any,
        limit: Any,
        observe: Any,
        step: Any,
        criterion: Criterion = DEFAULT,
        scan: Any = AUTO,
        longest: Any = 0.0,
    ) -> "Search":
        """The search with quantities as a user gives them: text with a unit, or seconds."""
        hz = case.frequency_hz
        grid, last = cycles(resolution, hz), cycles(limit, hz)
        h = None if step is None else seconds(step, hz)
        observed, most, rules = seconds(observe, hz), seconds(longest, hz), checked(criterion, hz)
        reach = None if scan == AUTO else cycles(scan, hz)
        return cls(grid, last, observed, h, rules, scan_cycles=reach, longest_s=most)

    @property
    def range_cycles(self) -> float:
        """Range below the answer in which others are tried, if they are."""
        return BELOW if self.scan_cycles is None else self.scan_cycles

    def scan(self, reach: float) -> Scan:
        """The faults tried on one side of the answer, over a range in cycles."""
        spacing = self.points(SPACING)
        return Scan(spacing, math.ceil(reach / (spacing * self.resolution_cycles) - 1e-9))

    def shorter(self) -> dict[str, Any]:
        """Which shorter faults are tried, for `last_stable`: one rule for every study of clearing times."""
        half, wide = Scan(self.points(HALF), 1), self.scan(self.range_cycles)
        if self.scan_cycles is None:
            return {"always": half, "lasting": wide, "coarse": wide.spacing}
        return {"always": wide, "coarse": wide.spacing} if wide.number else {"always": half}

    @property
    def last(self) -> int:
        """The last point of the grid; the first is 0."""
        return math.floor(self.limit_cycles / self.resolution_cycles + 1e-9)

    def points(self, length_cycles: float) -> int:
        """A length in points of the grid, at least 1."""
        return max(1, round(length_cycles / self.resolution_cycles))
