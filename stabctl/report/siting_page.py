"""One HTML page of a siting study: the fleet, what it survives, the evidence, how the cost came down."""

import io
from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from stabctl._util import files
from stabctl.errors import StudyError
from stabctl.placement.siting import Evidence, Siting
from stabctl.plotting import siting as figures

from . import embedded
from .document import document, table
from .study import DPI

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = """
.lost{color:var(--bad)}th{white-space:normal;vertical-align:bottom}table.evidence th{white-space:nowrap}
td.text:first-child{min-width:7.5rem}
table.evidence th:first-child,table.evidence td:first-child{position:sticky;left:0;background:var(--paper)}
@media(max-width:600px){th,td{padding:.3em .4em}}
"""
EVIDENCE = (
    "Cycles between the time at which a contingency must be cleared and the longest that is survived, on a grid of "
    "about 1/8 cycle. x0.9: nine tenths of every device; without: all devices but this one (machine@bus). Red with a "
    "cross: the contingency is lost at its target. A least fleet has a cross in every row of less than itself."
)
NOTES = {
    "sizes": "The uniform fleet has the same share of every machine's MVA, the smallest that survives everything.",
    "history": (
        "Each round the master program plans the cheapest fleet that the cuts so far allow; simulation scales it "
        "until it survives every contingency; where that is cheaper than the best fleet so far, it takes its place. "
        "Where the round mark is missing, no multiple of the plan survives."
    ),
}


def write(siting: Siting, folder: str | Path, name: str = "") -> Path:
    """Write the page and its figures into a folder (made if need be) as placement_CASE.html and .png; its path.

    `name` takes the place of CASE. Each file is written whole or not at all. Raises `StudyError` where it cannot be.
    """
    folder = Path(folder)
    path = folder / f"placement_{name or siting.case}.html"
    pictures = {}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for what, drawn in _figures(siting).items():
            pictures[what] = path.with_name(f"{path.stem}_{what}.png")
            files.replace(pictures[what], _png(drawn))
        files.replace(path, page(siting, pictures))
    except OSError as error:
        raise StudyError(
            f"The report cannot be written into {folder}: {error.strerror or error}; name a folder that can be "
            "written to."
        ) from None
    return path


def page(siting: Siting, pictures: dict[str, Path]) -> str:
    """The page; pictures (`sizes`, `history`) are read from their files. Raises OSError where they cannot be."""
    title = f"Storage for {siting.case}"
    parts = (
        f"<h1>{escape(title)}</h1>" + (f"<p>{escape(siting.title)}</p>" if siting.title else ""),
        _facts(siting),
        "".join(f"<p>{escape(sentence)}</p>" for sentence in siting.remarks()),
        _sites(siting),
        _picture(pictures, "sizes", "Megawatts by site", "Bars of the fleet beside those of the uniform fleet."),
        _contingencies(siting),
        _evidence(siting),
        _picture(pictures, "history", "Cost by round", "Planned and reached costs close in on each other."),
    )
    return document(title, embedded.STYLE + STYLE, parts)


def _figures(siting: Siting) -> "dict[str, Figure]":
    drawn = {}
    if siting.places:
        drawn["sizes"] = figures.plot(siting).figure
    if siting.history:
        drawn["history"] = figures.convergence(siting).figure
    return drawn


def _png(figure: "Figure") -> bytes:
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=DPI)
    return out.getvalue()


def _facts(siting: Siting) -> str:
    facts = [
        (siting.total_mw, "MW in the fleet found"),
        (siting.uniform_mw, "MW in the smallest uniform fleet that does the same"),
        (siting.linear_mw, "MW in the fleet of the linear stage that does the same"),
    ]
    if siting.lower_bound_mw is not None:
        facts.append((siting.lower_bound_mw, "MW, estimated lower bound"))
    cards = "".join(
        f'<div class="card"><b>{"none" if number is None else f"{number:.1f}"}</b>{escape(text)}</div>'
        for number, text in facts
    )
    return f'<div class="facts">{cards}</div>'


def _sites(siting: Siting) -> str:
    caps = {(p.bus, p.machine): f"{p.cap_mw:.1f}" for p in siting.places}
    rows = (
        (f"bus {s.bus}", f"{s.machine}", f"{s.mw:.2f}", caps.get((s.bus, s.machine), ""), f"{1e3 * s.mwh:.1f}")
        for s in siting.sites
    )
    note = '<p class="soft">kWh: what a device takes in or gives in its hardest run, and so has to hold.</p>'
    return f"<h2>Sites</h2>{table(('site', 'machine', 'MW', 'largest allowed, MW', 'kWh'), rows)}{note}"


def _contingencies(siting: Siting) -> str:
    rows = (
        (
            c.contingency.name,
            f"{c.target_cycles:.3f}",
            "none" if c.critical_cycles is None else f"{c.critical_cycles:.3f}",
            f"{c.margin_cycles:+.3f}" if c.stable else "lost",
            "yes" if c.binding else "",
            "" if c.machine is None else str(c.machine),
        )
        for c in siting.contingencies
    )
    heads = "fault and opening", "target, cycles", "critical, cycles", "margin", "binding", "first machine"
    note = (
        '<p class="soft">Critical: the longest clearing time that the fleet survives. Binding: lost with 3 % less of '
        "the fleet. First machine: goes first just beyond the critical time.</p>"
    )
    return f"<h2>Contingencies</h2>{table(heads, rows)}{note}"


def _evidence(siting: Siting) -> str:
    names = (escape(c.contingency.name).replace(" trip ", "<br>trip ") for c in siting.contingencies)
    heads = "".join(f"<th>{name}</th>" for name in ("MW", *names))
    rows = "".join(_row(row, [c.target_cycles for c in siting.contingencies]) for row in siting.evidence)
    inside = f'<thead><tr><th class="text">fleet</th>{heads}</tr></thead><tbody>{rows}</tbody>'
    whole = f'<div class="scroll"><table class="evidence">{inside}</table></div>'
    return f'<h2>Evidence</h2>{whole}<p class="soft">{EVIDENCE}</p>'


def _row(row: Evidence, targets: Iterable[float]) -> str:
    cells = "".join(
        f"<td{'' if stable else ' class=lost'}>{_margin(critical, target)}{'' if stable else '&nbsp;×'}</td>"
        for critical, target, stable in zip(row.critical_cycles, targets, row.stable, strict=True)
    )
    return f'<tr><td class="text">{escape(row.fleet)}</td><td>{row.mw:.1f}</td>{cells}</tr>'


def _margin(critical: float | None, target: float) -> str:
    return "none" if critical is None else f"{round(critical - target, 3) + 0.0:+.3f}"


def _picture(pictures: dict[str, Path], what: str, title: str, alt: str) -> str:
    if what not in pictures:
        return ""
    caption = f"<figcaption><b>{title}.</b> {NOTES[what]}</figcaption>"
    return f"<figure>{embedded.picture(pictures[what], title, alt, caption)}</figure>"
