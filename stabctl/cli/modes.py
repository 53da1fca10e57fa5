"""stabctl modes: eigenvalues, damping, mode shapes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import groups, options, shared
from .grouped import grouped

if TYPE_CHECKING:
    from stabctl.smallsignal import Areas, Modes

Band = Annotated[
    tuple[float, float], typer.Option("--band", metavar="LOW HIGH", help="Frequency range of the table, Hz.")
]
Report = Annotated[Path | None, typer.Option("--report", help="Write an HTML page to this folder.")]
Count = Annotated[int | None, typer.Option("--areas", help="Number of coherent areas (default: the best fit).")]
Sparse = Annotated[
    bool | None,
    typer.Option(
        "--sparse/--all",
        help="Only modes of the band with damping ratio -0.1 to 0.3, or all (default: all, up to 2000 states).",
    ),
]
Opened = Annotated[list[str] | None, typer.Option("--open", help="Circuit out of service: 7-8#2. Repeatable.")]


@grouped
def modes(
    *,
    band: Band = (0.1, 2.5),
    report: Report = None,
    area_count: Count = None,
    open_circuits: Opened = None,
    sparse: Sparse = None,
    controller: options.Controllers = None,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Compute the modes at the operating point of a case: frequency, damping, mode shapes and coherent areas."""
    from stabctl import units
    from stabctl.errors import StudyError
    from stabctl.report import modes_page, modes_table
    from stabctl.smallsignal import analyze, areas, descriptor, linearize, opened
    from stabctl.smallsignal.analysis import LARGE
    from stabctl.smallsignal.closed_loop import closed_loop

    shared.folder(report)
    units.band(band)
    loaded = opened(case.load(), open_circuits or ())
    point = storage.initialize(loaded)
    own = shared.controllers(controller)
    if own and sparse:
        raise StudyError("--controller needs all modes; leave out --sparse.")
    if own:
        found = closed_loop(point, *own).modes()
    else:
        model = linearize(point) if sparse is False else descriptor(point)
        few = sparse or (sparse is None and len(model.states) > LARGE)
        with shared.progress("modes", 1.0) as said:
            found = analyze(model, band if few else None, said=said)
    groups = areas(found, area_count) if found.swings() or area_count else None
    if as_json:
        shared.print_json({"case": point.case.name} | modes_table.record(found))
    else:
        _show(found, band, groups)
    if report:
        path = modes_page.write(report, found, groups, band)
        if not as_json:
            shared.console().print(f"written: {path}")


def _show(found: "Modes", band: tuple[float, float], groups: "Areas | None") -> None:
    from stabctl.report import modes_table

    out = shared.console()
    out.print(modes_table.table(found, found.within(*band)))
    for k in range(len(found)):
        if found.eigenvalues[k] == 0:
            out.print(f"Zero eigenvalue: {found.label(k)}; not an instability.")
    out.print(str(found))
    if groups:
        out.print(f"{groups}.")
