"""The page of a siting study: the fleet, the contingencies, variations of the fleet, convergence."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stabctl.placement.siting import Evidence, Siting

from ..figures import one_line
from ..figures import siting as figures
from . import pattern
from .pattern import Figure, Page, Section, figure, table

if TYPE_CHECKING:
    from stabctl.dynamics.operating_point import OperatingPoint
    from stabctl.model.case import Case


CONTINGENCIES = (
    "fault and trip", "required (cycles)", "critical (cycles)", "margin (cycles)", "binding", "critical machine",
)  # fmt: skip


def page(siting: Siting, base: "Case | OperatingPoint | None" = None, name: str = "") -> Page:
    """Return the page of a siting study; with the system also a one-line diagram."""
    return Page(
        f"{name or siting.case}_place",
        f"Storage siting for {siting.case}",
        [*([siting.title] if siting.title else []), *siting.remarks()],
        list(_numbers(siting)),
        [
            Section("Sites", [table(_heads(siting), _sites(siting), _on_sites(siting)), *_drawn(siting, base)]),
            Section(
                "Contingencies",
                [
                    table(
                        CONTINGENCIES,
                        _contingencies(siting),
                        "Required: the clearing time with which the contingency must be stable. Critical: the longest "
                        "stable clearing time with this fleet. Binding: unstable with 3 % less storage. Critical "
                        "machine: the machine that loses synchronism just beyond the critical clearing time.",
                    )
                ],
            ),
            Section(
                "Variations of the fleet",
                [
                    pattern.made(
                        "variations.html",
                        contingencies=siting.contingencies,
                        variations=[_variation(siting, row) for row in siting.evidence],
                        note=_on_variations(siting),
                    ),
                    *_converged(siting),
                ],
            ),
        ],
    )


def _heads(siting: Siting) -> tuple[str, ...]:
    return "site", "machine", "rating (MW)", *_of_converters(siting), "largest allowed (MW)", "energy (kWh)"


def _on_sites(siting: Siting) -> str:
    """What the columns of the sites mean."""
    of_converters = (
        " MVA set by: whether the current of the converter reaches its limit in any contingency, and the lowest bus "
        "voltage at which it does; otherwise the largest current."
    )
    capacity = "Energy: the capacity that the device needs for the most demanding contingency."
    return capacity + (of_converters if siting.converters else "")


def _drawn(siting: Siting, base: "Case | OperatingPoint | None") -> Iterator[Figure]:
    if base and siting.sites:
        yield figure(
            one_line.plot(base, siting),
            "Where the storage is.",
            "Squares at the machines: their area is in proportion to the rating, MW.",
        )
    if siting.candidates:
        yield figure(
            figures.plot(siting),
            "Ratings by site.",
            "The uniform fleet has the same share of the machine's MVA rating at every candidate site, up to its cap: "
            "the smallest share that is sufficient.",
        )


def _on_variations(siting: Siting) -> str:
    """What the names of the variations mean, with a site of this study as the example."""
    kinds = {
        "x": any(row.scale != 1.0 and not row.site for row in siting.evidence),
        "without": any(row.without for row in siting.evidence),
        "site": any(row.site for row in siting.evidence),
    }
    one = next((s for s in siting.sites), None)
    site = f"{one.machine}@{one.bus}" if one else ""
    told = [
        "Critical minus required clearing time, in cycles, on a grid of about 1/8 cycle.",
        "x0.9: every device with nine tenths of its rating." * kinds["x"],
        f"Without {site}: all devices except that of machine {one.machine} at bus {one.bus}."
        if one and kinds["without"]
        else "",
        f"{site} x1.1: only that device with 1.1 times its rating, simulated at the required clearing times alone."
        if one and kinds["site"]
        else "",
        "A cross marks a contingency that is unstable at the required clearing time. If the fleet is minimal, every "
        "smaller fleet has a cross.",
    ]
    return " ".join(filter(None, told))


def _converged(siting: Siting) -> Iterator[Figure]:
    if len(siting.history) > 1:
        yield figure(
            figures.convergence(siting),
            "Cost by iteration.",
            "In each iteration a linear program plans the cheapest fleet that satisfies all cuts found so far. "
            "Simulation then scales this plan until every contingency is stable; a missing mark means that no scaling "
            "of the plan is stable. The cheapest scaled plan is kept.",
        )


def write(siting: Siting, folder: str | Path, name: str = "", *, base: "Case | OperatingPoint | None" = None) -> Path:
    """Write the page into a folder as NAME_place.html and return its path.

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
    return pattern.write(page(siting, base, name), folder)


def _numbers(siting: Siting) -> Iterator[tuple[str, str]]:
    """The megawatts at the top of the page."""
    yield _mw(siting.total_mw), "MW in the optimized fleet"
    yield _mw(siting.uniform_mw), "MW in the smallest uniform fleet"
    yield _mw(siting.linear_mw), "MW in the allocation by linear analysis"
    if siting.cuts_mw is not None:
        yield _mw(siting.cuts_mw), "MW that the cuts allow"


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
            c.critical,
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
    margins = map(_margin, row.critical_cycles, required, row.stable)
    return {"fleet": row.fleet, "mw": f"{row.mw:.1f}", "margins": list(zip(margins, row.stable, strict=True))}


def _margin(critical: float | None, required: float | None, stable: bool) -> str:
    if required is None:
        return ""
    if critical is None:
        return "stable" if stable else "none"
    return f"{round(critical - required, 3) + 0.0:+.3f}"


def _mw(value: float | None) -> str:
    return "none" if value is None else f"{value:.1f}"
