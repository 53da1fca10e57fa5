"""stabctl linearize, modes, weak-grid: linear models, eigenvalues, strength of the grid."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from . import groups, options, shared
from .parameters import Option

if TYPE_CHECKING:
    from rich.table import Table

    from stabctl.smallsignal import Areas, Modes
    from stabctl.smallsignal.sensitivity import Sensitivity

SHOWN = 20  # parameters

Inputs = Annotated[str, Option("--inputs", help="storage:33,vref:14,load_p:8; pref alone means all governors.")]
Outputs = Annotated[str, Option("--outputs", help="speed,angle:14,coi_speed,voltage:33,frequency:33,flow:7-8.")]
Out = Annotated[Path, Option("--out", help="File to write, FILE.npz or FILE.mat.")]


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


Band = Annotated[tuple[float, float], Option("--band", metavar="LOW HIGH", help="Frequency range of the table, Hz.")]
Count = Annotated[int | None, Option("--areas", help="Number of coherent areas (default: the best fit).")]
Sparse = Annotated[
    bool | None,
    Option(
        "--sparse/--all",
        help="Only modes of the band with damping ratio -0.5 to 0.3, or all (default: all, up to 2000 states).",
    ),
]
Parameters = Annotated[
    bool, Option("--sensitivity", help="How controls and all parameters of devices change the least damped swing.")
]
Opened = Annotated[list[str] | None, Option("--open", help="Circuit out of service: 7-8#2. Repeatable.")]


def modes(
    *,
    band: Band = (0.1, 2.5),
    report: options.Report = None,
    area_count: Count = None,
    open_circuits: Opened = None,
    sparse: Sparse = None,
    sensitivity: Parameters = False,
    controller: options.Controllers = None,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Compute the modes at the operating point of a case: frequency, damping, mode shapes and coherent areas."""
    from stabctl._util import units
    from stabctl._util.errors import StudyError
    from stabctl.model import conventions
    from stabctl.smallsignal import analyze, areas, descriptor, linearize, opened
    from stabctl.smallsignal.analysis import LARGE
    from stabctl.smallsignal.closed_loop import closed_loop

    shared.folder(report)
    units.band(band)
    loaded = opened(case.load(), open_circuits or ())
    point = storage.initialize(loaded)
    own = shared.controllers(controller)
    if own and sensitivity:
        raise StudyError("--sensitivity is that of a system without controllers; leave out --controller.")
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
    effects, controls = (found.sensitivity(), found.contributions()) if sensitivity else (None, None)
    if as_json:
        more = _effects(effects) if effects else {}
        more |= {"contributions": [row._asdict() for row in controls.rows]} if controls else {}
        shared.print_json({"case": point.case.name, "conventions": conventions.of(point.case)} | _record(found) | more)
    else:
        _show(found, band, groups)
        if effects:
            _show_effects(effects)
            shared.console().print(str(controls))
    if report:
        from stabctl.view.pages import modes_page

        shared.written([modes_page.write(report, found, groups, band)], as_json)


def _show(found: "Modes", band: tuple[float, float], groups: "Areas | None") -> None:
    from stabctl._util.wording import listed

    out = shared.console()
    swings_first = sorted(
        found.within(*band), key=lambda k: not found.electromechanical[k] and found.damping_ratio[k] + 1
    )
    out.print(_table(found, swings_first))
    zeros = [found.label(k) for k in range(len(found)) if found.eigenvalues[k] == 0]
    if zeros:
        one = len(zeros) == 1
        head = "Zero eigenvalue, not an instability" if one else f"{len(zeros)} zero eigenvalues, no instabilities"
        out.print(f"{head}: {listed(zeros, 4)}.")
    out.print(str(found))
    if groups:
        out.print(f"{groups}.")


def _effects(found: "Sensitivity") -> dict[str, Any]:
    """Return every row, and the parameters left out with the reason."""
    left = [one._asdict() for one in found.left_out]
    return {"sensitivity": {"mode": str(found.mode), "rows": [r._asdict() for r in found.rows], "left_out": left}}


def _show_effects(found: "Sensitivity") -> None:
    """Print the parameters with the largest changes of the damping ratio."""
    from rich.table import Table

    table = Table("parameter", "value", "per", "real (1/s)", "Hz", "damping ratio")
    for column in table.columns[1:]:
        column.justify = "right"
    for row in found.rows[:SHOWN]:
        unit = "" if row.unit == "-" else f" {row.unit}"
        changes = (f"{change:+.2e}" for change in (row.real, row.frequency_hz, row.damping_ratio))
        table.add_row(row.path, f"{row.value:g}{unit}", f"{row.step:g}{unit}", *changes)
    shared.console().print(table)
    shared.console().print(str(found))


def _record(modes: "Modes") -> dict[str, Any]:
    """Return the eigenvalues with frequency, damping, label, ten largest participation factors and mode shape."""
    from stabctl.smallsignal import Selected

    rows = []
    for k in range(len(modes)):
        m = modes.mode(k)
        rows.append(
            {
                "real": m.eigenvalue.real,
                "imag": m.eigenvalue.imag,
                "frequency_hz": m.frequency_hz,
                "damping_ratio": m.damping_ratio,
                "electromechanical": m.electromechanical,
                "label": m.label,
                "participation": [{"state": p.state, "share": p.share} for p in m.participation],
                "shape": [{"machine": p.machine, "magnitude": p.magnitude, "angle_deg": p.angle_deg} for p in m.shape],
            }
        )
    record = {"states": len(modes.linear.states), "modes": rows}
    if isinstance(modes, Selected):
        record |= {"certified": modes.certified, "counted": modes.counted, "proof": modes.proof()}
    return record


def _table(modes: "Modes", chosen: Iterable[int]) -> "Table":
    """Return a table with a row for each of the chosen modes."""
    from rich.table import Table

    from stabctl._util.wording import number

    out = Table("Hz", "damping ratio", "real (1/s)", "imag (rad/s)", "swing", "mode")
    for column in out.columns[:5]:
        column.no_wrap = True
        column.justify = "right"
    for k in chosen:
        m = modes.mode(k)
        swing = "yes" if m.electromechanical else ""
        s = m.eigenvalue
        ratio, real = number(m.damping_ratio, 4), number(s.real, 4)
        out.add_row(f"{m.frequency_hz:.4f}", ratio, real, f"{s.imag:.4f}", swing, m.label)
    return out


Converter = Annotated[str, Option("--converter", help="Number or name of the unit with the converter.")]
Ratios = Annotated[str | None, Option("--scr", help="Short-circuit ratios of the map: 1.5,2,3 (default: 1.05 to 6).")]
Gains = Annotated[
    str | None,
    Option("--gain", help="Gains of the phase-locked loop, relative to the case: 0.5,1,2 (default: 0.25 to 8)."),
]
Ratio = Annotated[float, Option("--x-over-r", help="Reactance over resistance of the grid.")]
Plot = Annotated[Path | None, Option("--plot", help="Plot the map to FILE.png or .svg.")]


def weak_grid(
    *,
    converter: Converter,
    scr: Ratios = None,
    gain: Gains = None,
    x_over_r: Ratio = 10.0,
    plot: Plot = None,
    report: options.Report = None,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Map the stability of a converter over short-circuit ratio and gain of its phase-locked loop."""
    from stabctl.smallsignal import weak_grid

    shared.file(plot, ".png", ".svg")
    shared.folder(report)
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
    page = found.report(report) if report else None
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
    shared.written([page])


def _numbers(text: str | None, option: str) -> tuple[float, ...]:
    """Numbers separated by commas."""
    from stabctl._util.errors import StudyError

    try:
        return tuple(float(part) for part in text.split(",")) if text else ()
    except ValueError:
        raise StudyError(
            f"{option} {text!r} is not allowed; write numbers separated by commas, such as 1.5,2,3."
        ) from None
