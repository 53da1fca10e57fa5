"""A self-contained HTML page: no scripts, no network, readable on a phone, light or dark, and on paper."""

from collections.abc import Iterable, Sequence
from html import escape

LONG = 24  # characters, from where on a cell is a sentence
CONTENT = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"  # the browser itself keeps to it
STYLE = """
:root{--ink:#1b1f24;--soft:#5b6470;--paper:#fff;--card:#f6f7f9;--line:#d5dae0;--a:#0072b2;--b:#c24f00;--bad:#c4002b}
@media(prefers-color-scheme:dark){:root{--ink:#e7eaee;--soft:#a3acb8;--paper:#14171b;--card:#1d2228;--line:#3a424c;
--a:#56b4e9;--b:#f0a040;--bad:#ff6b81}}
:root{color-scheme:light dark}*{box-sizing:border-box}
body{margin:0 auto;padding:1rem;max-width:1100px;font:16px/1.5 system-ui,sans-serif;color:var(--ink);
background:var(--paper);overflow-wrap:break-word}
h1{font-size:1.5rem;margin:.2em 0}h2{font-size:1.2rem;margin:1.8em 0 .4em}h3{font-size:1rem;margin:0}
p{margin:.4em 0}.soft,.key{color:var(--soft);font-size:.875rem}a{color:var(--a)}
.scroll{overflow-x:auto}table{border-collapse:collapse;font-size:.875rem;font-variant-numeric:tabular-nums}
th,td{padding:.3em .7em;border-bottom:1px solid var(--line);text-align:right;white-space:nowrap}
th{color:var(--soft);font-weight:600}td.text,th.text{text-align:left}
td.text:first-child{white-space:normal;min-width:9rem}
@media print{:root{--ink:#000;--soft:#444;--paper:#fff;--card:#fff;--line:#999;--a:#00507d;--b:#8a3800;--bad:#8c0020}
body{padding:0;max-width:none;font-size:11pt}.scroll{overflow:visible}figure,tr,.card{break-inside:avoid}
h2,h3{break-after:avoid}}
"""


def document(title: str, style: str, parts: Iterable[str]) -> str:
    """The page from its title, the style beside the common one, and the parts of its body."""
    head = f'<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{CONTENT}">'
    head += '<meta name="viewport" content="width=device-width, initial-scale=1">'
    head += f"<title>{escape(title)}</title><style>{STYLE}{style}</style>"
    body = "\n".join(part for part in parts if part)
    return f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body>\n{body}\n</body></html>\n'


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of plain text that scrolls inside its own box; the first column is words."""
    top = "".join(f"<th{_text(k)}>{escape(h)}</th>" for k, h in enumerate(heads))
    body = "".join(
        "<tr>" + "".join(f"<td{_text(k, cell)}>{escape(cell)}</td>" for k, cell in enumerate(row)) + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def _text(column: int, cell: str = "") -> str:
    return ' class="text"' if column == 0 else ' class="text words"' if len(cell) > LONG else ""
