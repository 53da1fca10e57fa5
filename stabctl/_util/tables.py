"""Results as tables: written to CSV files, shown in notebooks."""

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from stabctl.errors import StudyError

from . import files

if TYPE_CHECKING:
    import pandas as pd


def save(table: "pd.DataFrame", path: str | Path) -> Path:
    """Write a table to a .csv file; the path. Raises StudyError if the file cannot be written."""
    path = Path(path)
    if path.suffix.lower() != ".csv":
        raise StudyError(f"The file {path.name!r} must end in .csv.")
    try:
        files.replace(path, table.to_csv(index=False))
    except OSError as error:
        raise StudyError(f"The file {path} cannot be written: {error.strerror or error}.") from None
    return path


def html(text: str, table: "pd.DataFrame") -> str:
    """Sentences and a table for a notebook."""
    lines = "<br>".join(escape(line) for line in text.splitlines())
    return f"<p>{lines}</p>{table.to_html(index=False, float_format='{:.4g}'.format)}"
