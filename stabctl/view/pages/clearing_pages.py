"""The pages of a critical clearing time, and of a screen of all line faults."""

from pathlib import Path
from typing import TYPE_CHECKING

from stabctl.clearing import ClearingTime, Screen

from ..figures import clearing as figures
from ..figures import one_line
from . import pattern
from .pattern import Page, Section, figure, table

if TYPE_CHECKING:
    from stabctl.dynamics.operating_point import OperatingPoint
    from stabctl.model.case import Case

RUNS = "clearing time (cycles)", "runs", "outcome", "loses synchronism first", "end (s after the fault)"


def clearing_time(found: ClearingTime) -> Page:
    """Return the page of a critical clearing time."""
    time = () if found.seconds is None else ((f"{1e3 * found.seconds:.1f}", "ms"),)
    return Page(
        f"{found.case}_clearing-time",
        f"Critical clearing time of {found.case}",
        [f"{found}"],
        [(found.shown, "cycles, the critical clearing time"), *time, (found.limit or "nothing", "limits it")],
        [
            Section("Runs", [figure(figures.plot_clearing_time(found), "End of every run against the clearing time.")]),
            Section(
                "", [table(RUNS, found.grouped(), "Runs with the same end, and neighbors on the grid, in one row.")]
            ),
        ],
    )


def screen(found: Screen, base: "Case | OperatingPoint | None" = None) -> Page:
    """Return the page of a screen; with the system also a one-line diagram."""
    shortest = [(p.shown, "cycles, the shortest critical clearing time") for p in found.pairs[:1]]
    drawn = []
    if found.pairs:
        drawn.append(
            figure(
                figures.plot_screen(found),
                "The shortest critical clearing times.",
                "Each bar is labeled with what limits it: the machine that loses synchronism first just beyond it, "
                "frequency or voltage.",
            )
        )
    if found.pairs and base:
        drawn.append(figure(one_line.plot(base, found), "Clearing times on the network.", one_line.CAPTION))
    rows = [(p.place, ", ".join(p.trip), p.cell, p.limit, _swings(p)) for p in found.pairs]
    heads = "fault at", "opened to clear it", "critical clearing time (cycles)", "limited by", "swings"
    note = (
        "Unstable at any: after opening the line, even without a fault. Swings: those of the longest stable run, "
        "at the end of its observation. Where they grow or do not decay, the clearing time may be shorter with a "
        "longer observation."
    )
    return Page(
        f"{found.case}_screen",
        f"Critical clearing times of {found.case}",
        found.remarks(),
        [*shortest, (str(len(found.pairs)), f"pairs of fault and trip, of {found.screened} screened")],
        [Section("", drawn), Section("Faults" if rows else "", [table(heads, rows, note)] if rows else [])],
    )


def write_screen(found: Screen, folder: str | Path, *, base: "Case | OperatingPoint | None" = None) -> Path:
    """Write the page into a folder as CASE_screen.html and return its path.

    Parameters
    ----------
    found
        The result of a screen.
    folder
        Folder of the page, created if it is missing.
    base
        The system of the screen, for a one-line diagram with the clearing times.

    Raises
    ------
    StudyError
        If the folder cannot be created or written to, or the system lacks a line of the screen.

    Examples
    --------
    >>> base = st.load("two_area").initialize()
    >>> base.screen("10cyc").report("pages", base=base)
    PosixPath('pages/two_area_screen.html')
    """
    return pattern.write(screen(found, base), folder)


def _swings(p: ClearingTime) -> str:
    """What the swings of the longest stable run do; nothing if there is no such run, or they are not judged."""
    if p.swings is None:
        return ""
    if p.remark():
        return "grow" if p.swings.growing else "do not decay"
    return "decay" if p.swings.decaying else "stay small"
