"""An error in a case and where it is."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from stabctl.errors import CaseError


class RowError(CaseError):
    """An error in a row of a table (0 is the first below the header).

    Parameters
    ----------
    table, column : str
        Where it is; the column by its header.
    row : int
        Row of the table, from 0.
    text : str
        The message. If two rows contradict each other, `{rows}` in it stands for both row numbers.
    first : int, optional
        The other of the two rows.
    """

    def __init__(self, table: str, row: int, column: str, text: str, first: int | None = None) -> None:
        self.table, self.row, self.column, self.text, self.first = table, row, column, text, first
        super().__init__(self.located(f"{table}.csv", lambda row: row + 2))

    def located(self, path: Path | str, line: Callable[[int], int]) -> str:
        """The sentence with its place in a file; `line` gives the line of a row."""
        text = self.text
        if self.first is not None:
            text = text.replace("{rows}", f"rows {line(self.first)} and {line(self.row)}")
        return f"{path} row {line(self.row)}, column {self.column}: {text}"

    def __reduce__(self) -> tuple[Any, ...]:
        return RowError, (self.table, self.row, self.column, self.text, self.first)
