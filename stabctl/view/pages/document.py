"""Pages: one self-contained HTML file each, from Jinja2 templates, with its figures as SVG.

They read well on a phone, in light and dark mode, and on paper. The figures have the colors of the page, and the names
of their parts. The one script of a page sorts its tables, enlarges its figures and shows these names; the browser runs
no other (Content-Security-Policy).
"""

import base64
import hashlib
import io
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.etree import ElementTree

from stabctl._util import files
from stabctl._util.errors import StudyError

from ..figures import style
from ..figures.palette import COLORS, GRAY, INK, css
from ..figures.style import whole

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


TEMPLATES = Path(__file__).parent / "templates"
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


@cache
def environment(*folders: Path) -> "Environment":
    """Return the environment of our templates and those in further folders; everything inserted is escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    loader = FileSystemLoader([*folders, TEMPLATES])
    made = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    made.globals["colors"] = Markup(css())
    made.globals["script"] = _script()
    return made


class Script(NamedTuple):
    """The script of all pages, and the hash by which a browser allows it."""

    text: "Markup"
    hash: str


def _script() -> Script:
    from markupsafe import Markup

    text = "\n" + (TEMPLATES / "page.js").read_text(encoding="utf-8")
    found = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    return Script(Markup(text), f"sha256-{found}")


def svg(drawn: "Figure | Axes", label: str) -> "Markup":
    """Return a figure (or that of some axes) as an SVG element with a label for screen readers, and close it."""
    import matplotlib.pyplot as plt
    from markupsafe import Markup, escape

    image = io.StringIO()
    parts = {f"hover-{k}": pair for k, pair in enumerate(style.named(whole(drawn).findobj()))}
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


def write(folder: str | Path, stem: str, html: str) -> Path:
    """Write a page into a folder, which is created if it is missing.

    Parameters
    ----------
    folder
        Folder of the page.
    stem
        Name of the file without suffix. Characters that do not belong in a file name become underscores, so that the
        page stays in its folder.
    html
        The page. An existing page is replaced only when the new one is complete.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    StudyError
        If the folder cannot be created or written to.
    """
    folder = Path(folder)
    path = folder / f"{files.safe_name(stem)}.html"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        files.replace(path, html)
    except OSError as error:
        raise StudyError(
            f"The report {path.name} cannot be written to {folder}: {error.strerror or error}. Give another folder."
        ) from None
    return path
