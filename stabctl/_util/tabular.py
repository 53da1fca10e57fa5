"""Base class of results: they print themselves, convert to tables, and are saved to files."""

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from . import files
from .errors import StudyError
from .verbs import verb

if TYPE_CHECKING:
    import pandas as pd

IMAGES = (".png", ".svg", ".pdf")
ROWS = 20  # shown of a table in a notebook


def machine_column(frame: "pd.DataFrame") -> "pd.DataFrame":
    """The table with machines as whole numbers where they have no names; none is a missing value."""
    named = any(isinstance(name, str) for name in frame["machine"])
    return frame.astype({"machine": "string" if named else "Int64"})


def inert(text: str) -> str:
    """Text in a CSV file that no spreadsheet takes for a formula: with an apostrophe before `=`, `+`, `-` or `@`."""
    return f"'{text}" if _formula(text) else text


def plain(cell: str) -> str:
    """The text of which `inert` has made a cell."""
    return cell[1:] if cell.startswith("'") and _formula(cell[1:]) else cell


def _formula(text: str) -> bool:
    begins = text.lstrip("'")
    if not begins.startswith(("=", "+", "-", "@")):
        return False
    try:
        float(begins)
    except ValueError:
        return True
    return False


def csv_text(frame: "pd.DataFrame") -> str:
    """A table as CSV."""
    named = frame.rename(columns=lambda name: inert(str(name)))
    for name in named.select_dtypes(exclude="number"):
        named[name] = named[name].map(lambda value: inert(value) if isinstance(value, str) else value)
    return named.to_csv(index=False)


class Tabular:
    """A result with a table (`df`), a summary (`__str__`) and usually a figure (`plot`)."""

    _save_figure = verb("stabctl.view.figures.style:save")

    @property
    def df(self) -> "pd.DataFrame":
        """The result as a table."""
        raise NotImplementedError

    def save(self, path: str | Path) -> Path:
        """Write the result to a file and return its path.

        Parameters
        ----------
        path : str or Path
            A table ending in .csv, or the figure of `plot` ending in .png, .svg or .pdf. An existing file is replaced
            only when the new one is complete.

        Raises
        ------
        StudyError
            If the file has another ending or cannot be written.
        """
        path = files.path_of(path)
        ending, plot = path.suffix.lower(), getattr(self, "plot", None)
        if ending in IMAGES and plot:
            return Tabular._save_figure(plot(), path)
        if ending != ".csv":
            allowed = ", ".join((".csv", *IMAGES)) if plot else ".csv"
            raise StudyError(f"The file {path.name!r} must end in {allowed}.")
        files.replace(path, csv_text(self.df))
        return path

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        lines = "<br>".join(escape(line) for line in self._head().splitlines())
        return f"<p>{lines}</p>{self.df.to_html(index=False, float_format='{:.4g}'.format, max_rows=ROWS)}"

    def _head(self) -> str:
        """The sentences above the table in a notebook."""
        return str(self)
