"""Figures as SVG inside a page, in the colors of the page, with the names of their parts."""

import hashlib
import io
import re
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from stabctl.plotting import tooltips
from stabctl.plotting.style import COLORS, GRAY, INK, whole

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

VARIABLES = {  # color of the figure -> variable of the page, which has another value in dark mode
    "#000000": "ink",
    INK: "ink",
    "#ffffff": "paper",
    GRAY: "soft",
    COLORS[0]: "a",
    COLORS[1]: "b",
    COLORS[2]: "c",
    COLORS[4]: "d",
    COLORS[5]: "e",
}
OPTIONS: Any = {"svg.fonttype": "none", "svg.hashsalt": "stabctl"}
NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))
SPACE, LINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"


def svg(drawn: "Figure | Axes", label: str) -> "Markup":
    """Return a figure (or that of some axes) as an SVG element with a label for screen readers, and close it."""
    import matplotlib.pyplot as plt
    from markupsafe import Markup, escape

    image = io.StringIO()
    parts = {f"hover-{k}": pair for k, pair in enumerate(tooltips.named(whole(drawn).findobj()))}
    for key, (artist, _) in parts.items():
        artist.set_gid(key)
    with plt.rc_context(OPTIONS):
        whole(drawn).savefig(image, format="svg", transparent=True, metadata=NO_METADATA)
    plt.close(whole(drawn))
    text = image.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"\s*<metadata>.*?</metadata>|\s*<defs>\s*<style.*?</style>\s*</defs>", "", text, flags=re.DOTALL)
    text = _with_titles(text, {key: texts for key, (_, texts) in parts.items()})
    text = re.sub(
        r' id="(?:(?:\w+\.)?[a-z\d]+_\d+|hover-\d+)"| font-family: [^;"]+;|^\s+', "", text, flags=re.MULTILINE
    )
    unique = hashlib.sha1(text.encode(), usedforsecurity=False).hexdigest()[:8]
    text = re.sub(r'(id="|url\(#|href="#)', rf"\g<1>f{unique}", text)
    for color, variable in VARIABLES.items():
        text = text.replace(color, f"var(--{variable})")
    size = re.findall(r'<svg[^>]*? width="([\d.]+)pt"', text)[0]
    opening = f'<svg role="img" aria-label="{escape(label)}" style="width:{size}pt"'
    return Markup(re.sub(r"^<svg(?=[ >])", opening, re.sub(r' (?:width|height)="[\d.]+pt"', "", text, count=2)))


def _with_titles(text: str, named: dict[str, tuple[str, ...]]) -> str:
    """The SVG with a title in each named part; a single name is that of the whole artist."""
    if not named:
        return text
    ElementTree.register_namespace("", SPACE)
    ElementTree.register_namespace("xlink", LINK)
    root = ElementTree.fromstring(text)
    group = {e.get("id"): e for e in root.iter() if e.get("id") in named}
    for key, texts in named.items():
        if key not in group:
            continue
        parts = [group[key]] if len(texts) == 1 else _drawn(group[key])[-len(texts) :]
        if len(parts) == len(texts):
            for part, name in zip(parts, texts, strict=True):
                title = ElementTree.Element(f"{{{SPACE}}}title")
                title.text = name
                part.insert(0, title)
    return ElementTree.tostring(root, encoding="unicode")


def _drawn(group: ElementTree.Element) -> list[ElementTree.Element]:
    """What an artist draws, in order, without the definitions of its markers."""
    found = []
    for child in group:
        if child.tag in (f"{{{SPACE}}}use", f"{{{SPACE}}}path"):
            found.append(child)
        elif child.tag != f"{{{SPACE}}}defs":
            found += _drawn(child)
    return found
