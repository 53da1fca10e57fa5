"""stabctl import: a PSS/E or MATPOWER system, with a report on what is represented."""

from pathlib import Path
from typing import Annotated

import typer

from . import options, shared

Raw = Annotated[str, typer.Argument(metavar="X.raw", help="PSS/E RAW file, version 30 to 35, or MATPOWER file x.m.")]
DyrFile = Annotated[
    Path | None,
    typer.Argument(metavar="X.dyr", help="DYR file (default: the one with the same name in the same folder)."),
]
Out = Annotated[Path | None, typer.Option("--out", help="Write the case to a folder, which every command accepts.")]
Check = Annotated[
    bool, typer.Option("--check/--no-check", help="Compare with the stored voltages, start, and simulate 2 s.")
]
INCOMPLETE = 1  # exit code


def importing(
    raw: Raw,
    dyr_file: DyrFile = None,
    *,
    out: Out = None,
    check: Check = True,
    dyr: options.Dyr = None,
    loads: options.Loads = None,
    missing: options.Missing = "refuse",
    missing_controls: options.MissingControls = "refuse",
    as_json: options.Json = False,
) -> None:
    """Import a PSS/E or MATPOWER system and report what is represented; the exit code is 0 only if everything is."""
    from stabctl._util.errors import StudyError
    from stabctl.io.import_report import import_report

    if dyr_file is not None and dyr is not None:
        raise StudyError("The DYR file is given twice, with and without --dyr; give it once.")
    shared.folder(out)
    report = import_report(raw, dyr_file or dyr, check=check, loads=loads)
    if as_json:
        shared.print_json(report.plain())
        shared.warn(report.failures, verbose=True)
    else:
        print(report)
    if out is not None:
        from stabctl import io

        dyr_path = report.files[1] if len(report.files) > 1 else None
        case = io.load(raw, dyr=dyr_path, loads=loads, missing=missing, missing_controls=missing_controls)
        io.write(case, out)
        if not as_json:
            print(f"\nwritten: {out}")
    if not report.complete:
        raise typer.Exit(INCOMPLETE)
