"""The page of all studies, index.html: every table and figure of the paper beside ours, and what goes beyond."""

import base64
import re
import struct
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

from . import index_summary
from .document import document, table
from .index_summary import MARKS, anchor
from .study import Comparison, Picture, Study

TYPES = {".png": "image/png", ".svg": "image/svg+xml"}
STYLE = """
.facts{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,150px),1fr));gap:.8rem;margin:1rem 0}
.card{background:var(--card);border-radius:8px;padding:.6rem .8rem}.card b{display:block;font-size:1.5rem}
section{border-top:1px solid var(--line);margin-top:2rem}section h2{margin-top:1rem}
nav ol,nav ul{padding-left:1.4rem;columns:18rem;column-gap:2.4rem;margin:.4rem 0}nav li{break-inside:avoid}
section h3{margin:1.2em 0 .3em}th{white-space:normal;vertical-align:bottom}
td.words,td.text{white-space:normal;min-width:5rem}td.text.words{min-width:14rem}.compared td.text{min-width:8rem}
@media(max-width:600px){th,td{padding:.3em .4em}}
td.mark{padding:.3em .2em;text-align:center;font-weight:700}.mark abbr{text-decoration:none}
.differs{color:var(--bad)}.close{color:var(--b)}.printed,.given{color:var(--a)}
td small{display:block;color:var(--soft)}ol.notes{font-size:.875rem;padding-left:1.4rem;margin:.4rem 0}
.failed{color:var(--bad)}figure{margin:1.2rem 0}figcaption{font-size:.875rem;margin-top:.4rem}
.picture input{position:absolute;opacity:0;pointer-events:none}
.picture .frame{display:block;overflow-x:auto;background:#fff;border:1px solid var(--line);border-radius:8px;
padding:.5rem;cursor:zoom-in}.picture img{display:block;max-width:100%;height:auto;margin:auto}
.picture input:checked+.frame{cursor:zoom-out}.picture input:checked+.frame img{max-width:none}
.picture input:focus-visible+.frame{outline:3px solid var(--a)}
@media print{nav,.key{display:none}td.text,td.words{white-space:normal}}
"""


class Ran(NamedTuple):
    """A script of a study that was run: its records, or a sentence on how it failed."""

    script: str  # sims/omib.py
    seconds: float
    studies: tuple[Study, ...] = ()
    failure: str = ""


class About(NamedTuple):
    """When and where the studies ran."""

    date: str
    machine: str
    seconds: float
    left_out: tuple[str, ...] = ()  # scripts that need --full


def page(ran: Sequence[Ran], folder: Path, about: About) -> str:
    """The page; pictures are read from the folder and put into it."""
    found = sorted(((s, r) for r in ran for s in r.studies), key=lambda pair: order(pair[0]))
    studies, failed = [study for study, _ in found], [r for r in ran if r.failure]
    left_out = f" Left out, for --full: {', '.join(about.left_out)}." if about.left_out else ""
    introduction = (
        "<h1>The paper reproduced</h1><p>Feedback control of distributed energy storage for transient stability "
        "(2022, MDPI, CC BY 4.0): every table and figure with results beside what stabctl finds, and studies that go "
        f'beyond it.</p><p class="soft">{escape(about.date)}, {about.seconds:.0f} s on {escape(about.machine)}.'
        f"{escape(left_out)}</p>"
    )
    return document(
        "The paper reproduced",
        STYLE,
        (
            introduction,
            index_summary.summary(studies),
            "".join(_failed(r) for r in failed),
            index_summary.contents(studies),
            *(_section(study, r, folder) for study, r in found),
        ),
    )


def order(study: Study) -> tuple[bool, list[int], str]:
    """Sections of the paper in its order, then what goes beyond."""
    return not study.section, [int(n) for n in re.findall(r"\d+", study.section)], study.title


def _failed(r: Ran) -> str:
    return f'<p class="failed" id="{anchor(r.script)}"><b>{escape(r.script)} failed.</b> {escape(r.failure)}</p>'


def _section(study: Study, r: Ran, folder: Path) -> str:
    number = f"Section {study.section}: " if study.section else "Beyond the paper: "
    tables = (f"<h3>{escape(t.title)}</h3>{table(t.heads, t.rows)}" for t in study.tables)
    pages = "".join(
        f'<li><a href="{escape(file)}">{escape(what)}</a></li>'
        for what, file in study.pages.items()
        if (folder / file).is_file()
    )
    parts = (
        f'<section id="{anchor(study.title)}"><h2>{escape(number + study.title)}</h2>',
        *(f"<p>{escape(paragraph)}</p>" for paragraph in study.text),
        _compared(study),
        *tables,
        *(_picture(p, folder) for p in study.pictures),
        f"<p>Pages beside this one:</p><ul>{pages}</ul>" if pages else "",
        f'<p class="soft">{escape(r.script)}, {r.seconds:.0f} s</p></section>',
    )
    return "".join(parts)


def _compared(study: Study) -> str:
    if not study.comparisons:
        return ""
    heads = '<th></th><th class="text">in the paper</th><th>paper</th><th>ours, difference</th>'
    rows = "".join(_row(c, study.notes) for c in study.comparisons)
    notes = "".join(f"<li>{escape(note)}</li>" for note in study.notes)
    inside = f"<thead><tr>{heads}</tr></thead><tbody>{rows}</tbody>"
    beneath = f'<ol class="notes">{notes}</ol>' if notes else ""
    return f'<div class="scroll"><table class="compared">{inside}</table></div>{beneath}'


def _row(c: Comparison, notes: Sequence[str]) -> str:
    sign, kind = MARKS[c.verdict]
    p = c.printed
    note = f"<sup>{notes.index(c.remark) + 1}</sup>" if c.remark else ""
    what = f"{p.what}, {p.unit}" if p.unit else p.what
    words = ' class="words"' if c.difference is None else ""
    return (
        f'<tr><td class="mark {kind}"><abbr title="{c.verdict}">{sign}</abbr></td>'
        f'<td class="text">{escape(what)}{note}<small>{escape(p.where)}</small></td>'
        f"<td{words}>{escape(p.text)}</td><td{words}>{escape(c.shown)}<small>{_difference(c)}</small></td></tr>"
    )


def _difference(c: Comparison) -> str:
    if c.difference is None or c.shown == c.printed.text:
        return ""
    share = f" ({100 * c.relative:+.2g} %)" if c.relative is not None else ""
    return f"{c.difference:+.{c.printed.decimals}f}{share}"


def _picture(p: Picture, folder: Path) -> str:
    of = ", ".join(p.of)
    shows = " ".join(f"The paper's {name}: {index_summary.shows(name)}." for name in p.of)
    title = f"{of}: {p.title}" if of else p.title
    caption = f"<figcaption><b>{escape(title)}.</b> {escape(p.caption)} "
    caption += f'<span class="soft">{escape(shows)}</span></figcaption>'
    try:
        data = (folder / p.file).read_bytes()
    except OSError:
        return f'<figure><p class="failed">The picture {escape(p.file)} is missing.</p>{caption}</figure>'
    source = f"data:{TYPES[Path(p.file).suffix]};base64,{base64.b64encode(data).decode()}"
    size = ' width="{}" height="{}"'.format(*struct.unpack(">II", data[16:24])) if p.file.endswith(".png") else ""
    return (
        f'<figure id="{anchor(p.file)}"><label class="picture"><input type="checkbox" '
        f'aria-label="Enlarge: {escape(p.title)}"><span class="frame">'
        f'<img src="{source}" alt="{escape(p.alt)}"{size}></span></label>{caption}</figure>'
    )
