"""The pattern of all pages: a title, sentences, numbers, and sections of figures, tables and notes."""

import re
from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from stabctl.model import conventions
from stabctl.model.case import Case

from ..figures.style import whole
from . import document
from .document import svg

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

FLOAT = r"[+\-−]?\d+(\.\d+)?(e[+\-]?\d+)?"
NUMBER = re.compile(rf"{FLOAT}( (to|/) {FLOAT}| or more| ?[a-zA-Z%°]{{1,4}})?|over {FLOAT}")
NO_NUMBER = "none", "all", "unstable"
PAGES = {
    "Trajectory": "run_pages:simulation",
    "Estimates": "run_pages:estimates",
    "Optimum": "run_pages:optimum",
    "Results": "run_pages:sweep",
    "ClearingTime": "clearing_pages:clearing_time",
    "PowerFlow": "network_pages:power_flow",
    "ShortCircuit": "network_pages:short_circuit",
    "WeakGrid": "network_pages:weak_grid",
    "ImportReport": "network_pages:imported",
}  # class of a result -> module and function of its page
HALF = 75  # letters in half the width of a page
MOST = 2000  # rows of a table; a browser sorts them in a fraction of a second


class Figure(NamedTuple):
    """A figure with its caption, whose beginning is set in bold."""

    drawn: "Markup"
    title: str
    text: str = ""
    kind: str = "figure"


class Table(NamedTuple):
    """A table: heads, rows of text or markup, and a note below it. A row whose class is given is set apart.

    A table that is folded shows this text, until it is opened.
    """

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    classes: Sequence[str] = ()
    folded: str = ""
    kind: str = "table"

    @property
    def words(self) -> list[bool]:
        """Whether a column holds words: the first one, and those whose cells are no numbers."""
        columns = zip(*self.rows, strict=True) if self.rows else [()] * len(self.heads)
        return [k == 0 or not _numeric(column) for k, column in enumerate(columns)]

    @property
    def letters(self) -> int:
        """Letters of a row with the widest cell of every column, and the space between them."""
        return sum(3 + max(len(str(cell)) for cell in column) for column in zip(self.heads, *self.rows, strict=True))


def _numeric(cells: Iterable[str]) -> bool:
    """Whether cells are numbers, with a unit of a few letters at most, ranges or pairs of them, or `none` instead."""
    given = [str(cell) for cell in cells if str(cell)]
    return any(NUMBER.fullmatch(cell) for cell in given) and all(NUMBER.fullmatch(c) or c in NO_NUMBER for c in given)


def about(case: Case) -> list[str]:
    """What a page says of a case: its title, and the equations of its machines if there is a choice."""
    said = conventions.of(case)
    return [*([case.title] if case.title else []), *([f"Machine equations: {said}."] if said else [])]


class Text(NamedTuple):
    """A paragraph; soft: in small print."""

    text: str
    soft: bool = False
    kind: str = "text"


class Made(NamedTuple):
    """A part that a template of its own makes."""

    html: "Markup"
    kind: str = "made"


class Pair(NamedTuple):
    """Two figures side by side where there is room."""

    first: Figure
    second: Figure
    kind: str = "pair"


Part = Figure | Table | Text | Made | Pair


class Section(NamedTuple):
    """Parts below a heading, or without one."""

    heading: str
    parts: Sequence[Part]

    @property
    def narrow(self) -> bool:
        """Whether it fits into half of a wide page: nothing but tables of few letters in a row."""
        return all(isinstance(part, Table) and part.letters < HALF for part in self.parts)


class Page(NamedTuple):
    """A page of a result."""

    stem: str  # of its file: CASE_COMMAND
    title: str
    sentences: Sequence[str]
    numbers: Sequence[tuple[str, str]]  # at the top: number, what it is
    sections: Sequence[Section]

    def html(self) -> str:
        """The page. Sections and parts without content are left out."""
        return document.environment().get_template("page.html").render(page=self, title=self.title)


def figure(drawn: "Drawing | Axes", title: str, text: str = "") -> Figure:
    """A figure with its caption, which says what its own title says; the caption names it for screen readers, too."""
    if whole(drawn).get_suptitle():
        whole(drawn).suptitle("")
    return Figure(svg(drawn, title.rstrip(".")), title, text)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], note: str = "", *, classes: Sequence[str] = ()) -> Table:
    """A table without the columns that are blank in every row; of many rows the first."""
    every = list(rows)
    kept = [k for k in range(len(heads)) if not every or any(row[k] for row in every)]
    more = f"The first {MOST} of {len(every)} rows. " if len(every) > MOST else ""
    cells = [[row[k] for k in kept] for row in every[:MOST]]
    return Table([heads[k] for k in kept], cells, f"{more}{note}".strip(), classes)


def made(template: str, **values: Any) -> Made:
    """What a template makes of values."""
    from markupsafe import Markup

    return Made(Markup(document.environment().get_template(template).render(**values)))


def write(page: Page, folder: str | Path) -> Path:
    """Write a page into a folder; see `document.write`."""
    return document.write(folder, page.stem, page.html())


def report(result: Any, folder: str | Path) -> Path:
    """Write a page on the result into a folder, as CASE_COMMAND.html: two_area_simulate.html.

    Parameters
    ----------
    result
        The result.
    folder
        Folder of the page, created if it is missing.

    Returns
    -------
    Path
        The page: one file with its figures, which needs no network.

    Raises
    ------
    StudyError
        If the folder cannot be created or written to, or a simulation has no rows recorded.

    Examples
    --------
    >>> st.load("two_area").simulate("7-8@1s", until="3s").report("pages")
    PosixPath('pages/two_area_simulate.html')
    """
    module, _, name = PAGES[type(result).__name__].partition(":")
    page = getattr(import_module(f"stabctl.view.pages.{module}"), name)
    return write(page(result), folder)
