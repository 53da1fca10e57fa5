"""`stabctl sweep`: many simulations from one study file, into one results file."""

import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from . import options, shared
from .parameters import Argument, Option

if TYPE_CHECKING:
    from stabctl.sweep.results import Results as SweepResults


Study = Annotated[Path, Argument(metavar="STUDY", help="A study file, TOML.")]
Out = Annotated[Path, Option("--out", help="Results file (SQLite); jobs that it already has are not run again.")]
Workers = Annotated[int | None, Option("--workers", help="Processes on this computer (default: one per core).")]
Retry = Annotated[bool, Option("--retry", help="Rerun jobs that ended in an error.")]
Results = Annotated[Path, Argument(metavar="RESULTS", help="A results file.")]
Csv = Annotated[Path | None, Option("--csv", help="Write every column of every row to FILE.csv.")]


def run(
    study: Study,
    out: Out,
    workers: Workers = None,
    scheduler: options.Scheduler = None,
    retry: Retry = False,
    controller: options.Controllers = None,
    device: options.Device = None,
    verbose: options.Verbose = False,
) -> int:
    """Run the jobs of a study. The exit code is 1 if a job ended in an error, 130 after Ctrl-C."""
    from stabctl._util.errors import StudyError
    from stabctl.sweep.sweep import run_sweep

    if workers is not None and scheduler is not None:
        raise StudyError("--workers and --scheduler cannot be used together; give one of them.")
    gc.enable()  # unlike other commands, a sweep may be long
    with _progress() as tell:
        sweep = run_sweep(
            study, out, workers=workers, scheduler=scheduler, retry=retry, controllers=controller or (), progress=tell
        )
    shared.warn(sweep.warnings, verbose)
    print(f"stabctl: {sweep}", file=sys.stderr)
    return 130 if sweep.interrupted else int(sweep.errors > 0)


@contextmanager
def _progress() -> Iterator[Callable[[int, int], None]]:
    """A progress bar with rate and time left on a terminal's stderr, lines elsewhere; yields what updates it."""
    if not sys.stderr.isatty():
        with shared.progress("jobs", 1.0) as tell_share:
            yield lambda done, total: tell_share(done / total if total else 1.0)
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    rate = TextColumn("{task.fields[rate]}")
    columns = (BarColumn(), MofNCompleteColumn(), rate, TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())
    with Progress(*columns, console=shared.console(stderr=True), transient=True) as bar:

        def tell(done: int, total: int) -> None:
            if not bar.tasks:  # jobs done earlier do not count for the rate
                bar.add_task("jobs", total=total, completed=done, rate="")
            speed = bar.tasks[0].speed
            bar.update(bar.task_ids[0], completed=done, rate=f"{speed:.3g} jobs/s" if speed else "")

        yield tell


def show(results: Results, table: Csv = None, report: options.Report = None, as_json: options.Json = False) -> None:
    """Print the results of a sweep as a table."""
    from stabctl.sweep import results as file

    shared.file(table, ".csv")
    shared.folder(report)
    found = file.read(results)
    if table:
        found.save(table)
    page = found.report(report) if report else None
    if as_json:
        errors = len(found.errors)
        shared.print_json({"rows": list(found.rows), "ok": len(found.rows) - errors, "errors": errors})
    else:
        _show(found)
        shared.written([table, page])


def _show(found: "SweepResults") -> None:
    from rich.table import Table

    from stabctl.sweep.results import cell

    console = shared.console()
    console.print(", ".join(f"{column} {value}" for column, value in found.common.items()))
    table = Table(*found.columns)
    for cells in found.cells:
        table.add_row(*map(cell, found.columns, cells))
    console.print(table)
    for what, sentence in found.errors:
        print(f"{what}: {sentence}")
    print(found)
