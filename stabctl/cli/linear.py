"""stabctl linearize, modes, weak-grid: linear models, eigenvalues, strength of the grid."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import groups, options, shared
from .shared import grouped

if TYPE_CHECKING:
    from stabctl.smallsignal import Areas, Modes


Inputs = Annotated[str, typer.Option("--inputs", help="storage:33,vref:14,load_p:8; pref alone means all governors.")]
Outputs = Annotated[str, typer.Option("--outputs", help="speed,angle:14,coi_speed,voltage:33,frequency:33,flow:7-8.")]
Out = Annotated[Path, typer.Option("--out", help="File to write, FILE.npz or FILE.mat.")]


@grouped
def linearize(
    *,
    out: Out,
    inputs: Inputs = "storage",
    outputs: Outputs = "speed",
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Linearize a case at its operating point and export the model."""
    from stabctl.smallsignal import linearize

    shared.file(out, ".npz", ".mat")
    point = storage.initialize(case.load())
    model = linearize(point, inputs, outputs)
    path = model.save(out)
    if as_json:
        labels = {k: list(getattr(model, k)) for k in ("states", "inputs", "outputs")}
        shared.print_json({"case": point.case.name, "file": str(path), **labels})
        return
    shared.console().print(f"{model}; written to {path}")


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
    from stabctl._util import units
    from stabctl._util.errors import StudyError
    from stabctl.smallsignal import analyze, areas, descriptor, linearize, opened
    from stabctl.smallsignal.analysis import LARGE
    from stabctl.smallsignal.closed_loop import closed_loop
    from stabctl.view.pages import modes_page

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
        shared.print_json({"case": point.case.name} | modes_page.record(found))
    else:
        _show(found, band, groups)
    if report:
        path = modes_page.write(report, found, groups, band)
        if not as_json:
            shared.console().print(f"written: {path}")


def _show(found: "Modes", band: tuple[float, float], groups: "Areas | None") -> None:
    from stabctl.view.pages import modes_page

    out = shared.console()
    out.print(modes_page.table(found, found.within(*band)))
    for k in range(len(found)):
        if found.eigenvalues[k] == 0:
            out.print(f"Zero eigenvalue: {found.label(k)}; not an instability.")
    out.print(str(found))
    if groups:
        out.print(f"{groups}.")


Converter = Annotated[str, typer.Option("--converter", help="Number or name of the unit with the converter.")]
Ratios = Annotated[
    str | None, typer.Option("--scr", help="Short-circuit ratios of the map: 1.5,2,3 (default: 1.05 to 6).")
]
Gains = Annotated[
    str | None,
    typer.Option("--gain", help="Gains of the phase-locked loop, relative to the case: 0.5,1,2 (default: 0.25 to 8)."),
]
Ratio = Annotated[float, typer.Option("--x-over-r", help="Reactance over resistance of the grid.")]
Plot = Annotated[Path | None, typer.Option("--plot", help="Plot the map to FILE.png or .svg.")]


@grouped
def weak_grid(
    *,
    converter: Converter,
    scr: Ratios = None,
    gain: Gains = None,
    x_over_r: Ratio = 10.0,
    plot: Plot = None,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Map the stability of a converter over short-circuit ratio and gain of its phase-locked loop."""
    from stabctl.smallsignal import weak_grid

    shared.file(plot, ".png", ".svg")
    found = weak_grid.weak_grid(
        case.load(),
        converter,
        scr=_numbers(scr, "--scr") or weak_grid.RATIOS,
        gain=_numbers(gain, "--gain") or weak_grid.GAINS,
        x_over_r=x_over_r,
    )
    if plot:
        from stabctl.view.figures import style

        style.save(found.plot(), plot)
    rows = found.df.astype(object).where(found.df.notna(), None).to_dict("records")
    boundary = [None if s != s else s for s in found.boundary.tolist()]  # NaN
    if as_json:
        shared.print_json(
            {"converter": found.name, "pll_gain": found.gain.tolist(), "boundary": boundary, "points": rows}
        )
        return
    from rich.table import Table

    table = Table("gain, rad/s per pu", "stable above SCR")
    for column in table.columns:
        column.justify = "right"
    for k, critical in zip(found.gain.tolist(), boundary, strict=True):
        table.add_row(f"{k:.4g}", "none" if critical is None else "all" if critical == 0 else f"{critical:.3f}")
    shared.console().print(table)
    shared.console().print(str(found))


def _numbers(text: str | None, option: str) -> tuple[float, ...]:
    """Numbers separated by commas."""
    from stabctl._util.errors import StudyError

    try:
        return tuple(float(part) for part in text.split(",")) if text else ()
    except ValueError:
        raise StudyError(
            f"{option} {text!r} is not allowed; write numbers separated by commas, such as 1.5,2,3."
        ) from None
