"""One HTML page of the modes of a case: self-contained, no scripts, readable on a phone, light or dark."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

from stabctl.report.drawing import compass, s_plane
from stabctl.smallsignal import Areas, Mode, Modes

from .document import document
from .modes_table import number

BARS = 5
STYLE = """
tr.swing td{font-weight:600}tr.grows td{color:var(--bad)}
.cards{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,320px),1fr));gap:.8rem}
.card{background:var(--card);border-radius:8px;padding:.8rem;min-width:0}
.bar{display:grid;grid-template-columns:minmax(0,11rem) 1fr 2.6rem;gap:.5rem;align-items:center;font-size:.8125rem}
.bar i{display:block;height:.6rem;background:var(--a);border-radius:2px}.bar b{font-weight:400;text-align:right}
.area{display:inline-block;margin:.15rem;padding:.1rem .5rem;border:1px solid var(--line);border-radius:4px}
.area.first{border-color:var(--a);color:var(--a)}
svg{width:100%;height:auto;font:12px system-ui,sans-serif}svg text{fill:var(--soft)}
svg.compass{max-width:300px;display:block;
margin:0 auto}.plane{max-width:680px}
svg text.ray{paint-order:stroke;stroke:var(--paper);stroke-width:4px}
.grid{stroke:var(--line);fill:none}.axis{stroke:var(--soft)}line.ray{stroke:var(--soft);stroke-dasharray:5 4}
circle.swing{fill:var(--a)}circle.other{fill:none;stroke:var(--soft)}circle.grows{fill:var(--bad)}
.with line{stroke:var(--a);stroke-width:2}.with circle{fill:var(--a)}svg text.with{fill:var(--a)}
.against line{stroke:var(--b);stroke-width:2}.against circle{fill:var(--b)}svg text.against{fill:var(--b)}
.leader{stroke:var(--line);stroke-width:.8}
.dot{display:inline-block;width:.7em;height:.7em;border-radius:50%;margin:0 .3em 0 .8em}.dot.swing{background:var(--a);
margin-left:0}.dot.other{border:1px solid var(--soft)}.dot.grows{background:var(--bad)}
"""


def page(modes: Modes, areas: Areas | None, band: tuple[float, float]) -> str:
    """The page: s-plane, mode table, a card with shape and participation for every swing, areas."""
    case = modes.linear.point.case
    inside = [modes.mode(k) for k in modes.within(*band)]
    every = [modes.mode(k) for k in range(len(modes)) if modes.eigenvalues[k].imag > 0]
    zeros = [modes.mode(k) for k in range(len(modes)) if modes.eigenvalues[k] == 0]
    swings = [m for m in inside if m.electromechanical]
    parts = [
        f"<h1>Modes of {escape(case.name)}</h1><p>{escape(case.title)}</p><p>{escape(str(modes))}</p>",
        f'<h2>Eigenvalues</h2><div class="plane">{s_plane(every)}</div>',
        _zeros(zeros),
        _cards(swings),
        _areas(areas) if areas else "",
        f"<h2>Oscillating modes from {band[0]:g} to {band[1]:g} Hz</h2>{_table(inside)}",
        f'<p class="soft">Data: {escape(case.source)}</p>' if case.source else "",
    ]
    return document(f"Modes of {case.name}", STYLE, parts)


def write(folder: str | Path, modes: Modes, areas: Areas | None, band: tuple[float, float]) -> Path:
    """Write the page into a folder (made if need be) as CASE_modes.html; its path."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{modes.linear.point.case.name}_modes.html"
    path.write_text(page(modes, areas, band), encoding="utf-8")
    return path


def _zeros(zeros: Sequence[Mode]) -> str:
    lines = "".join(f"<li>{escape(m.label)}</li>" for m in zeros)
    return f"<p>Eigenvalues that are zero, none of them an instability:</p><ul>{lines}</ul>" if zeros else ""


def _table(modes: Sequence[Mode]) -> str:
    if not modes:
        return "<p>There is none in this band.</p>"
    rows = []
    for m in modes:
        kind = "grows" if m.eigenvalue.real > 1e-7 else "swing" if m.electromechanical else ""
        s = m.eigenvalue
        figures = number(m.frequency_hz, 3), number(100 * m.damping_ratio, 2), number(s.real, 4), number(s.imag, 4)
        cells = "".join(f"<td>{f}</td>" for f in figures)
        leading = f'<td class="text">{escape(m.participation[0].state)}</td>'
        rows.append(f'<tr class="{kind}"><td class="text">{escape(m.label)}</td>{cells}{leading}</tr>')
    heads = "".join(f"<th>{h}</th>" for h in ("Hz", "damping, %", "real, 1/s", "imag, rad/s"))
    heads = f'<th class="text">mode</th>{heads}<th class="text">leading state</th>'
    note = "Bold: machines swing against each other. The other modes bear the name of their leading state."
    table = f"<table><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    return f'<div class="scroll">{table}</div><p class="soft">{note}</p>'


def _cards(swings: Sequence[Mode]) -> str:
    if not swings:
        return ""
    note = (
        "<h2>Swings: shape and participation</h2><p class='soft'>Arrows are the speeds of the machines, the largest of "
        "length 1; colors tell the two sides; the four largest of each side are named. Bars are the largest "
        "participations, in percent of all.</p>"
    )
    return f'{note}<div class="cards">{"".join(_card(m) for m in swings)}</div>'


def _card(m: Mode) -> str:
    widest = m.participation[0].share or 1.0
    bars = "".join(
        f'<div class="bar"><span>{escape(p.state)}</span><i style="width:{100 * p.share / widest:.1f}%"></i>'
        f"<b>{100 * p.share:.1f}</b></div>"
        for p in m.participation[:BARS]
    )
    facts = f"{number(m.frequency_hz, 3)} Hz, damping {number(100 * m.damping_ratio, 2)} %"
    return f'<section class="card"><h3>{escape(m.label)}</h3><p class="soft">{facts}</p>{compass(m)}{bars}</section>'


def _areas(areas: Areas) -> str:
    slow = ", ".join(f"{f:.3f}" for f in areas.frequencies_hz) or "none"
    groups = []
    for k, group in enumerate(areas.groups):
        chips = "".join(
            f'<span class="area{" first" if machine == group[0] else ""}">{machine}</span>' for machine in sorted(group)
        )
        groups.append(f'<section class="card"><h3>Area {k + 1}</h3><div>{chips}</div></section>')
    return (
        f'<h2>Coherent areas</h2><p class="soft">Machines that move together in the slow swings (Hz: {slow}); outlined '
        f"in color the machine that stands for each area. Worst agreement of a machine with its own: "
        f'{areas.agreement:.2f} (1: moves exactly like it).</p><div class="cards">{"".join(groups)}</div>'
    )
