"""`stabctl verify`: reference numbers of known systems beside ours."""

from collections.abc import Iterator
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

    shared.file(plot, ".png", ".svg", ".pdf")
    found = verify(system, folder=folder, download_missing=download)
    if plot:
        found.save(plot)
    if as_json:
        shared.print_json(plain(found))
    else:
        console = shared.console()
        console.print(_numbers(found) if system else _systems(found))
        for sentence in (*(_about(system) if system else ()), *str(found).splitlines()):
            console.print(sentence, highlight=False)
    if found.outside:
        raise SystemExit(OUTSIDE)


def plain(found: "Verification") -> dict[str, Any]:
    """The result as JSON has it."""
    return {"numbers": found.numbers, "missing": found.missing, "rows": found.df.to_dict("records")}


def _systems(found: "Verification") -> Any:
    from rich.table import Table

    table = Table("system", "quantity", "numbers", "difference", "tolerance")
    for column in (0, 2, 3, 4):
        table.columns[column].no_wrap = True
    for name, rows in found.by_system.items():
        for row in nearest_to_tolerance(rows):
            count = sum(one.numbers for one in rows if one.quantity == row.quantity)
            table.add_row(
                name, f"{row.quantity} ({row.unit})", str(count), f"{row.difference:.2g}", f"{row.tolerance:g}"
            )
            name = ""
    return table


def nearest_to_tolerance(rows: "tuple[Comparison, ...]") -> "list[Comparison]":
    """Of each quantity the row whose difference is the largest part of its tolerance."""
    return [
        max((row for row in rows if row.quantity == quantity), key=lambda row: row.difference / row.tolerance)
        for quantity in dict.fromkeys(row.quantity for row in rows)
    ]


def _numbers(found: "Verification") -> Any:
    from rich.table import Table

    table = Table("quantity", "of", "reference", "here", "difference", "tolerance")
    for row in found.rows:
        table.add_row(
            f"{row.quantity} ({row.unit})", row.object, number(row.published), number(row.ours),
            f"{row.difference:.2g}", f"{row.tolerance:g}",
        )  # fmt: skip
    return table


def _about(name: str) -> Iterator[str]:
    """What the numbers of a system are, and why some differ."""
    from stabctl.verification.systems import systems

    about = systems()[name]
    yield f"{about.title}. {about.source}."
    if about.conventions:
        yield f"Assumed: {about.conventions}."
    if about.reason:
        yield about.reason


def number(value: float | complex) -> str:
    """A number, or an eigenvalue as real part +- imaginary part."""
    if isinstance(value, complex):
        return f"{value.real:.6g} ± {value.imag:.6g}j" if value.imag else f"{value.real:.6g}"
    return f"{value:.7g}"
