"""Run a study from its script: print the results and write pictures and records to the folder of the reports."""

import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from stabctl.errors import StabctlError, sentence

from . import records
from .study import Study


def present(study: Callable[[Path], Study | Iterable[Study]]) -> None:
    """Run the study of the current script.

    The folder of the reports is the first argument of the script; default: reports/. An error is one line on stderr and
    exit code 2.
    """
    os.environ.setdefault("MPLBACKEND", "agg")
    script, folder = Path(sys.argv[0]), Path(sys.argv[1] if len(sys.argv) > 1 else "reports")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        found = study(folder)
        studies = (found,) if isinstance(found, Study) else tuple(found)
        records.write(records.path_for(script, folder), studies)
    except (StabctlError, OSError) as error:
        print("stabctl:", sentence(error), file=sys.stderr)
        sys.exit(2)
    for record in studies:
        show(record, folder)


def show(study: Study, folder: Path) -> None:
    """Print a study."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else 120)
    console.print(study.title, style="bold")
    for paragraph in study.text:
        console.print(paragraph)
    if study.comparisons:
        table = Table("in the paper", "quantity", "paper", "ours", "unit", "", "note")
        for c in study.comparisons:
            p, note = c.printed, str(study.notes.index(c.remark) + 1) if c.remark else ""
            table.add_row(p.where, p.what, p.text, c.shown, p.unit, str(c.verdict), note)
        console.print(table)
    for number, note in enumerate(study.notes, 1):
        console.print(f"{number}: {note}")
    for given in study.tables:
        table = Table(*given.heads, title=given.title, title_justify="left")
        for row in given.rows:
            table.add_row(*row)
        console.print(table)
    for file in (*(p.file for p in study.pictures), *study.pages.values()):
        console.print(f"wrote {folder / file}")
