"""The page of a siting study: the fleet, the contingencies, variations of the fleet, convergence."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stabctl.placement.siting import Evidence, Siting, Survived

from ..figures import one_line
from ..figures import siting as figures
from . import document
from .document import svg

if TYPE_CHECKING:
    from stabctl.dynamics.operating_point import OperatingPoint
    from stabctl.model.case import Case


def page(siting: Siting, base: "Case | OperatingPoint | None" = None) -> str:
    """Return the page of a siting study; with the system also a one-line diagram."""
    template = document.environment().get_template("siting.html")
    return template.render(
        title=f"Storage siting for {siting.case}",
        siting=siting,
        numbers=list(_numbers(siting)),
        heads=("site", "machine", "rating (MW)", *_of_converters(siting), "largest allowed (MW)", "energy (kWh)"),
        sites=list(_sites(siting)),
        contingencies=list(_contingencies(siting)),
        variations=[_variation(siting, row) for row in siting.evidence],
        diagram=svg(one_line.plot(base, siting), "One-line diagram with the storage")
        if base and siting.sites
        else None,
        ratings=svg(figures.plot(siting), "Storage ratings by site") if siting.candidates else None,
        convergence=svg(figures.convergence(siting), "Cost by iteration") if len(siting.history) > 1 else None,
    )


def write(siting: Siting, folder: str | Path, name: str = "", *, base: "Case | OperatingPoint | None" = None) -> Path:
    """Write the page into a folder as placement_NAME.html and return its path.

    Parameters
    ----------
    siting
        The result of a siting study.
    folder
        Folder of the page, created if it is missing.
    name
        Name in place of the case's.
    base
        The system of the study, for a one-line diagram with the storage.

    Raises
    ------
    StudyError
        If the folder cannot be created or written to, or the system lacks a machine of the study.

    Examples
    --------
    >>> wanted = st.Contingency("7-8@0.4", clear="22cyc")
    >>> found = st.place(st.load("two_area"), wanted, candidates=[(1, 5)], observe="2s")
    >>> found.report("pages").exists()
    True
    """
    return document.write(folder, f"placement_{name or siting.case}", page(siting, base))


def _numbers(siting: Siting) -> Iterator[tuple[str, str]]:
    """The megawatts at the top of the page."""
    yield _mw(siting.total_mw), "MW in the optimized fleet"
    yield _mw(siting.uniform_mw), "MW in the smallest uniform fleet"
    yield _mw(siting.linear_mw), "MW in the allocation by linear analysis"
    if siting.lower_bound_mw is not None:
        yield _mw(siting.lower_bound_mw), "MW, estimated lower bound"


def _sites(siting: Siting) -> Iterator[tuple[str, ...]]:
    caps = {(p.bus, p.machine): f"{p.cap_mw:.1f}" for p in siting.candidates}
    for s in siting.sites:
        mva = (f"{s.mva or s.mw:.2f}", s.set_by) if siting.converters else ()
        yield f"bus {s.bus}", str(s.machine), s.size, *mva, caps.get((s.bus, s.machine), ""), f"{1e3 * s.mwh:.1f}"


def _of_converters(siting: Siting) -> tuple[str, ...]:
    """The columns of converters."""
    return ("MVA", "MVA set by") if siting.converters else ()


def _contingencies(siting: Siting) -> Iterator[tuple[str, ...]]:
    for c in siting.contingencies:
        yield (
            c.label,
            "" if c.target_cycles is None else f"{c.target_cycles:.3f}",
            _critical(c),
            "unstable" if not c.stable else "" if c.margin_cycles is None else f"{c.margin_cycles:+.3f}",
            "yes" if c.binding else "",
            "" if c.machine is None else str(c.machine),
        )
    for one in siting.infeasible:
        required = "" if one.target_cycles is None else f"{one.target_cycles:.3f}"
        yield one.label, required, "", "lost with every fleet tried", "", ""


def _variation(siting: Siting, row: Evidence) -> dict[str, Any]:
    """A fleet near the one chosen: its name, its megawatts, margin and stability of every contingency."""
    if not row.critical_cycles:
        cells = [("stable" if stable else "unstable", stable) for stable in row.stable]
        return {"fleet": row.fleet, "mw": f"{row.mw:.1f}", "margins": cells}
    required = [c.target_cycles for c in siting.contingencies]
    margins = [_margin(critical, target) for critical, target in zip(row.critical_cycles, required, strict=True)]
    return {"fleet": row.fleet, "mw": f"{row.mw:.1f}", "margins": list(zip(margins, row.stable, strict=True))}


def _critical(c: Survived) -> str:
    if c.target_cycles is None:
        return ""
    return "none" if c.critical_cycles is None else f"{c.critical_cycles:.3f}"


def _margin(critical: float | None, required: float | None) -> str:
    if required is None:
        return ""
    return "none" if critical is None else f"{round(critical - required, 3) + 0.0:+.3f}"


def _mw(value: float | None) -> str:
    return "none" if value is None else f"{value:.1f}"
