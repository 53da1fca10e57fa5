"""stabctl weak-grid: stability of a converter against short-circuit ratio and gain of its phase-locked loop."""

from pathlib import Path
from typing import Annotated

import typer

from . import shared
from .grouped import grouped
from .groups import CaseOptions
from .options import Json

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
    case: CaseOptions,
    as_json: Json = False,
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
        from stabctl.plotting import style

        style.save(found.plot().figure, plot)
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
    from stabctl.errors import StudyError

    try:
        return tuple(float(part) for part in text.split(",")) if text else ()
    except ValueError:
        raise StudyError(
            f"{option} {text!r} is not allowed; write numbers separated by commas, such as 1.5,2,3."
        ) from None
