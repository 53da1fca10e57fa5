"""Pages: one self-contained HTML file each, from Jinja2 templates; nothing is fetched from the network.

They read well on a phone, in light and dark mode, and on paper. The one script of a page sorts its tables, enlarges its
figures and names their parts; the browser runs no other (Content-Security-Policy).
"""

import base64
import hashlib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from stabctl._util import files
from stabctl.errors import StudyError
from stabctl.plotting.style import css

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

TEMPLATES = Path(__file__).parent / "templates"


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
