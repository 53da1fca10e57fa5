"""Figures as SVG inside a page, in the colors of the page."""

import hashlib
import io
import re
from typing import TYPE_CHECKING, Any

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
}
OPTIONS: Any = {"svg.fonttype": "none", "svg.hashsalt": "stabctl"}
NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))


def svg(drawn: "Figure | Axes", label: str) -> "Markup":
    """Return a figure (or that of some axes) as an SVG element with a label for screen readers, and close it."""
    import matplotlib.pyplot as plt
    from markupsafe import Markup, escape

    image = io.StringIO()
    with plt.rc_context(OPTIONS):
        whole(drawn).savefig(image, format="svg", transparent=True, metadata=NO_METADATA)
    plt.close(whole(drawn))
    text = image.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"\s*<metadata>.*?</metadata>|\s*<defs>\s*<style.*?</style>\s*</defs>", "", text, flags=re.DOTALL)
    text = re.sub(r' id="(?:\w+\.)?[a-z\d]+_\d+"| font-family: [^;"]+;|^\s+', "", text, flags=re.MULTILINE)
    unique = hashlib.sha1(text.encode(), usedforsecurity=False).hexdigest()[:8]
    text = re.sub(r'(id="|url\(#|href="#)', rf"\g<1>f{unique}", text)
    for color, variable in VARIABLES.items():
        text = text.replace(color, f"var(--{variable})")
    size = re.findall(r'<svg[^>]*? width="([\d.]+)pt"', text)[0]
    opening = f'<svg role="img" aria-label="{escape(label)}" style="width:{size}pt"'
    return Markup(re.sub(r"^<svg(?=[ >])", opening, re.sub(r' (?:width|height)="[\d.]+pt"', "", text, count=2)))
