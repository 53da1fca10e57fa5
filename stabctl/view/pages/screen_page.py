"""The page of a screen: the clearing times of all line faults, as bars, on the one-line diagram, and as a table."""

from pathlib import Path
from typing import TYPE_CHECKING

from stabctl.clearing import ClearingTime, Screen

from ..figures import clearing as bars
from ..figures import one_line
from . import document
from .document import svg

if TYPE_CHECKING:
    from stabctl.dynamics.operating_point import OperatingPoint
    from stabctl.model.case import Case


def page(screen: Screen, base: "Case | OperatingPoint | None" = None) -> str:
    """Return the page of a screen; with the system also a one-line diagram."""
    first, *others = screen.remarks()
    times = [p.cycles for p in screen.pairs if p.status == "found" and p.cycles is not None]
    return (
        document.environment()
        .get_template("screen.html")
        .render(
            title=f"Critical clearing times of {screen.case}",
            first=first,
            others=others,
            numbers=_numbers(screen, times),
            bars=svg(bars.plot_screen(screen), "The shortest clearing times") if screen.pairs else None,
            diagram=svg(one_line.plot(base, screen), "One-line diagram") if base and screen.pairs else None,
            rows=[_row(p, screen.search.limit_cycles) for p in screen.pairs],
        )
    )


def write(screen: Screen, folder: str | Path, *, base: "Case | OperatingPoint | None" = None) -> Path:
    """Write the page into a folder as screen_CASE.html and return its path.

    Parameters
    ----------
    screen
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
    >>> case = st.load("two_area")
    >>> case.screen().report("pages", base=case).exists()
    True
    """
    return document.write(folder, f"screen_{screen.case}", page(screen, base))


def _numbers(screen: Screen, times: list[float]) -> list[tuple[str, str]]:
    """The numbers at the top of the page."""
    shortest = [(f"{min(times):g}", "cycles, the shortest critical clearing time")] if times else []
    return [*shortest, (str(len(screen.pairs)), f"pairs of fault and trip, of {screen.screened} screened")]


def _row(p: ClearingTime, limit: float) -> tuple[str, ...]:
    """A pair in the table."""
    cycles = {"unstable_at_zero": "0", "stable_at_limit": f"{limit:g} or more"}.get(p.status) or f"{p.cycles:g}"
    return cycles, f"bus {p.fault}", ", ".join(p.trip), p.limit, _swings(p)


def _swings(p: ClearingTime) -> str:
    """What the swings of the longest stable run do; nothing if there is no such run, or they are not judged."""
    if p.swings is None:
        return ""
    if p.remark():
        return "grow" if p.swings.growing else "do not decay"
    return "decay" if p.swings.decaying else "stay small"
