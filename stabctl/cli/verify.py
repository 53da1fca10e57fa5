"""`stabctl verify`: reference numbers of known systems beside ours."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from . import options, shared
from .parameters import Argument, Option

if TYPE_CHECKING:
    from stabctl.verification import Comparison, Verification

Name = Annotated[str | None, Argument(metavar="[SYSTEM]", help="Only this system, with every number.")]
Folder = Annotated[Path | None, Option("--folder", help="Where downloaded files are (default: in the user's cache).")]
Download = Annotated[
    bool, Option("--download/--no-download", help="Download the files that may not be passed on, and check them.")
]
Plot = Annotated[Path | None, Option("--plot", metavar="FILE", help="Write the figure to FILE.png, .svg or .pdf.")]
OUTSIDE = 1  # exit code


def verify(
    system: Name = None,
    *,
    download: Download = False,
    folder: Folder = None,
    plot: Plot = None,
    as_json: options.Json = False,
) -> None:
    """Compare published numbers of known systems, and those of other programs, with ours.

    Power flows, eigenvalues and clearing times: the largest difference of every system, or every number of SYSTEM.
    Exit code 1: a difference is above its tolerance.
    """
    from stabctl.verification import verify
    from stabctl.verification.systems import systems

    shared.file(plot, ".png", ".svg", ".pdf")
    found = verify(system, folder=folder, download_missing=download)
    if plot:
        found.save(plot)
    if as_json:
        shared.print_json(plain(found))
    else:
        console = shared.console()
        console.print(_numbers(found) if system else _systems(found))
        about = systems()[system] if system else None
        for sentence in (*((f"{about.title}.", *about.sentences()) if about else ()), *str(found).splitlines()):
            console.print(sentence, highlight=False)
    if found.outside:
        raise SystemExit(OUTSIDE)


def plain(found: "Verification") -> dict[str, Any]:
    """The result as JSON has it."""
    return {"numbers": found.numbers, "missing": found.missing, "rows": found.df.to_dict("records")}


def _systems(found: "Verification") -> Any:
    from rich.table import Table

    table, last = Table("system", "quantity", "numbers", "difference", "tolerance"), ""
    for column in (0, 2, 3, 4):
        table.columns[column].no_wrap = True
    for row, count in found.largest():
        table.add_row(row.system if row.system != last else "", _what(row), str(count), *_off(row))
        last = row.system
    return table


def _numbers(found: "Verification") -> Any:
    from rich.table import Table

    from stabctl.verification.compare import text

    table = Table("quantity", "of", "reference", "here", "difference", "tolerance")
    for row in found.rows:
        table.add_row(_what(row), row.object, text(row.published), text(row.ours), *_off(row))
    return table


def _what(row: "Comparison") -> str:
    return f"{row.quantity} ({row.unit})"


def _off(row: "Comparison") -> tuple[str, str]:
    return f"{row.difference:.2g}", f"{row.tolerance:g}"
