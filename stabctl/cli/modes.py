"""stabctl modes: eigenvalues, damping, who swings against whom."""

from pathlib import Path
from typing import Annotated

import typer

from . import shared

Band = Annotated[
    tuple[float, float], typer.Option("--band", metavar="LOW HIGH", help="Frequencies of the printed table, Hz.")
]
Report = Annotated[Path | None, typer.Option("--report", help="Write one HTML page into this folder.")]
Count = Annotated[int | None, typer.Option("--areas", help="Number of coherent areas (default: what agrees best).")]
Sparse = Annotated[
    bool | None,
    typer.Option(
        "--sparse/--all",
        help="Only modes of the band with damping ratio -0.1 to 0.3, or all (default: all, up to 2000 states).",
    ),
]
Opened = Annotated[list[str] | None, typer.Option("--open", help="Circuit out of service: 7-8#2. Repeatable.")]


def modes(
    case: shared.CaseName,
    band: Band = (0.1, 2.5),
    report: Report = None,
    area_count: Count = None,
    open_circuits: Opened = None,
    sparse: Sparse = None,
    classical: shared.Classical = False,
    as_json: shared.Json = False,
) -> None:
    """Eigenvalues of a case at its operating point: frequency, damping, mode shapes, coherent areas."""
    from stabctl.linear import descriptor, linearise
    from stabctl.modes import analyse, areas, opened
    from stabctl.modes.analysis import LARGE
    from stabctl.report import modes_page, modes_table

    loaded = opened(shared.load(case, classical), open_circuits or ())
    point = shared.start(loaded)
    model = linearise(point) if sparse is False else descriptor(point)
    few = sparse or (sparse is None and len(model.states) > LARGE)
    found = analyse(model, band if few else None)
    chosen = found.within(*band)
    groups = areas(found, area_count) if found.swings() or area_count else None
    path = modes_page.write(report, found, groups, band) if report else None
    if as_json:
        shared.print_json(modes_table.record(found))
        return
    out = shared.console()
    out.print(modes_table.table(found, chosen))
    for k in range(len(found)):
        if found.eigenvalues[k] == 0:
            out.print(f"zero: {found.label(k)}; not an instability.")
    out.print(str(found))
    if groups:
        out.print(f"{groups}.")
    if path:
        out.print(f"written: {path}")
