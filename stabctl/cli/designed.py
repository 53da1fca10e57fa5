"""Common parts of the commands of `stabctl design`: options, and the output of a design."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from . import options, shared

if TYPE_CHECKING:
    from stabctl.design import Design, Outages

SHOWN = 8  # modes in the table without and with the controllers: those with the least damping
Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        help="Write the controller to FILE.toml, or several to FILE-1.toml and so on, to be given with --controller.",
    ),
]
Report = Annotated[Path | None, typer.Option("--report", help="Write an HTML page on the design to this folder.")]
Faults = Annotated[
    list[str] | None,
    typer.Option("--fault", help="Fault for the clearing times in the report: 7-8@0.4. Repeatable."),
]
Delay = Annotated[
    str,
    typer.Option("--delay", metavar="TIME", parser=options.in_unit("s"), help="Time from measurement to output, s."),
]


class Files(NamedTuple):
    """What is written: the controllers, and the page with its faults."""

    out: Out = None
    report: Report = None
    fault: Faults = None

    def check(self) -> None:
        """Raise `StudyError` if the files cannot be written, before anything is computed."""
        from stabctl.errors import StudyError

        shared.file(self.out, ".toml")
        shared.folder(self.report)
        if self.fault and not self.report:
            raise StudyError("--fault is used only for the report; give --report FOLDER, too.")

    def write(self, found: "Design") -> tuple[Path, ...]:
        """Write them, and return their paths."""
        written = found.save(self.out) if self.out else ()
        return (*written, found.report(self.report, self.fault or ())) if self.report else written


def show(found: "Design", files: Files, as_json: bool, points: "Outages | None" = None) -> None:
    """Write the files, and print the modes before and after."""
    written = files.write(found)
    if as_json:
        from stabctl.design.result import least

        worst = min(found.before, key=lambda m: least(m)[0])
        shared.print_json(
            {
                "worst_damping_before": found.worst_before,
                "worst_damping_after": found.worst_after,
                "worst_damping_replaced": found.worst_replaced,
                "mode_hz": float(worst.frequency_hz[least(worst)[1]]),
                "reached": found.reached,
                "remarks": list(found.remarks),
                "controllers": [c.name for c in found.controllers],
                "largest_gains": found.largest_gains,
                "files": [str(path) for path in written],
                "operating_points": len(found.before),
                "left_out": dict(points.left_out) if points else {},
                **_margins(found),
            }
        )
        return
    from rich.table import Table

    from stabctl._util.wording import counted

    out_console, left = shared.console(), 0
    if len(found.before) > 1:
        table = Table("operating point", "without", "with", "Hz", "mode")
        for point, before, after, hz, mode in found.worst.to_numpy().tolist():
            table.add_row(point, f"{before:.4f}", f"{after:.4f}", f"{hz:.4f}", mode)
    else:
        table = Table("controllers", "Hz", "damping ratio", "mode")
        modes = found.df
        few = modes.groupby("controllers")["damping_ratio"].rank(method="first") <= SHOWN
        left = int((~few).sum())
        for what, _, hz, ratio, mode in modes[few].to_numpy().tolist():
            table.add_row(what, f"{hz:.4f}", f"{ratio:.4f}", mode)
    out_console.print(table)
    if left:
        out_console.print(f"{counted(left, 'mode')} with more damping left out; --report shows all.")
    if points:
        out_console.print(str(points))
    out_console.print(str(found))
    for path in written:
        out_console.print(f"written: {path}")


def _margins(found: "Design") -> dict[str, Any]:
    """Margins of a regulator, and those with all states."""
    from stabctl.design import Regulator

    if not isinstance(found, Regulator) or found.full is None or found.own is None:
        return {}
    return {"margins": asdict(found.own), "margins_all_states": asdict(found.full)}
