"""The top of the page of all studies: how many numbers agree, which differ, where every table and figure stands."""

import re
from collections.abc import Sequence
from html import escape

from .paper import RESULTS
from .study import Comparison, Study, Verdict

MARKS = {  # sign and class
    Verdict.AS_PRINTED: ("=", "printed"),
    Verdict.CLOSE: ("≈", "close"),
    Verdict.DIFFERS: ("≠", "differs"),
    Verdict.GIVEN: ("·", "given"),
}
KEY = (
    "In the tables: = as printed (the same digits, or the same in words), ≈ within 1 %, ≠ differs, · a constant that "
    "is given, not found. Ours has as many decimals as the paper's, with the difference below it; small numbers point "
    "to the notes below the table. Pictures grow when touched."
)
UNEXPLAINED = "Not explained yet."


def anchor(text: str) -> str:
    """The name of a place on the page."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


def shows(result: str) -> str:
    """What a table or figure of the paper shows."""
    return RESULTS.get(result, "not among its results")


def summary(studies: Sequence[Study]) -> str:
    """How many results agree within what, and a table of those that differ."""
    compared = [(c, s) for s in studies for c in s.comparisons]
    of = {verdict: [(c, s) for c, s in compared if c.verdict is verdict] for verdict in Verdict}
    within = max((100 * abs(c.relative) for c, _ in of[Verdict.CLOSE]), default=0.0)
    differ = of[Verdict.DIFFERS]
    facts = (
        (len(of[Verdict.AS_PRINTED]), "results as printed, in every digit or word"),
        (len(of[Verdict.CLOSE]), f"more within {within:.2g} %" if within else "more within 1 %"),
        (len(differ), "differ"),
        (len(of[Verdict.GIVEN]), "constants given by the paper and taken over"),
    )
    cards = "".join(f'<div class="card"><b>{number}</b>{escape(text)}</div>' for number, text in facts)
    rows = "".join(_differs(c, s) for c, s in differ)
    heads = '<th class="text">what differs</th><th>paper</th><th>ours</th>'
    table = f'<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>'
    list_of = table if differ else ""
    return f'<h2 id="summary">In short</h2><div class="facts">{cards}</div>{list_of}<p class="key">{KEY}</p>'


def contents(studies: Sequence[Study]) -> str:
    """Sections, and every table and figure of the paper with the section where it stands."""
    links = "".join(f"<li>{_link(s, s.title)}{_counted(s)}</li>" for s in studies)
    places = {}
    for s in studies:
        shown = {c.printed.where for c in s.comparisons} | {name for p in s.pictures for name in p.of}
        for name in RESULTS:
            if any(re.match(rf"{name}\b", where) for where in shown):
                places.setdefault(name, s)
    index = "".join(
        f"<li>{_link(places[name], name) if name in places else escape(name) + ' (not shown)'}: {escape(what)}</li>"
        for name, what in RESULTS.items()
    )
    return (
        f'<nav><h2 id="contents">Contents</h2><ol>{links}</ol><h3>Tables and figures of the paper</h3><ul>{index}</ul>'
        '<p class="soft">The other figures of the paper are diagrams without results.</p></nav>'
    )


def _differs(c: Comparison, s: Study) -> str:
    p = c.printed
    unit = f", {p.unit}" if p.unit else ""
    why = escape(c.remark or UNEXPLAINED)
    return (
        f'<tr><td class="text">{_link(s, p.where)}: {escape(p.what + unit)}<small>{why}</small></td>'
        f'<td class="words">{escape(p.text)}</td><td class="words">{escape(c.shown)}</td></tr>'
    )


def _link(s: Study, text: str) -> str:
    return f'<a href="#{anchor(s.title)}">{escape(text)}</a>'


def _counted(s: Study) -> str:
    results = [c.verdict for c in s.comparisons if c.verdict is not Verdict.GIVEN]
    agree = len(results) - results.count(Verdict.DIFFERS)
    return f' <span class="soft">{agree} of {len(results)} agree</span>' if results else ""
