"""`stabctl sweep`: many runs from one study file, into one results file."""

import csv
import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from . import options, shared

app = typer.Typer(no_args_is_help=True, help="Many runs from one study file: on all cores, or on a Dask cluster.")

Study = Annotated[Path, typer.Argument(metavar="STUDY", help="A study file, TOML.")]
Out = Annotated[Path, typer.Option("--out", help="Results file (SQLite); what is in it already is not done again.")]
Workers = Annotated[int | None, typer.Option("--workers", help="Processes on this machine (default: one a core).")]
Dask = Annotated[str | None, typer.Option("--dask", help="Scheduler of a Dask cluster: tcp://host:8786.")]
Retry = Annotated[bool, typer.Option("--retry", help="Do the jobs again that ended in an error.")]
Results = Annotated[Path, typer.Argument(metavar="RESULTS", help="A results file.")]
Csv = Annotated[Path | None, typer.Option("--csv", help="Write every column of every row to FILE.csv.")]


@app.command("run")
def run_command(study: Study, out: Out, workers: Workers = None, dask: Dask = None, retry: Retry = False) -> int:
    """Do the jobs of a study; exit code 1 where one ended in an error, 130 at Ctrl-C."""
    from stabctl.errors import StudyError
    from stabctl.sweep.run import run

    if workers is not None and dask is not None:
        raise StudyError("--workers and --dask exclude each other; give one of them.")
    gc.enable()  # unlike other commands, a sweep may be long
    with _progress() as tell:
        summary = run(study, out, workers, dask, retry, tell)
    for sentence in summary.warnings:
        print(f"stabctl: warning: {sentence}", file=sys.stderr)
    print(f"stabctl: {summary}", file=sys.stderr)
    return 130 if summary.interrupted else int(summary.errors > 0)


@contextmanager
def _progress() -> Iterator[Callable[[int, int], None]]:
    """A bar with rate and time left on a terminal's stderr; yields what is told the jobs done and of how many."""
    if not sys.stderr.isatty():
        yield lambda _done, _total: None
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
            if not bar.tasks:  # what was there before does not count for the rate
                bar.add_task("jobs", total=total, completed=done, rate="")
            speed = bar.tasks[0].speed
            bar.update(bar.task_ids[0], completed=done, rate=f"{speed:.3g} jobs/s" if speed else "")

        yield tell


@app.command("show")
def show_command(results: Results, table: Csv = None, as_json: options.Json = False) -> None:
    """Print a results file: what varies in it, and what came of it."""
    from stabctl.sweep.overview import in_order
    from stabctl.sweep.store import COLUMNS, rows

    shared.file(table, ".csv")
    found = in_order(rows(results))
    if table:
        with table.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(found)
    if as_json:
        ok = sum(row["status"] == "ok" for row in found)
        shared.print_json({"rows": found, "ok": ok, "errors": len(found) - ok})
    else:
        _show(found, table)


def _show(rows: list[dict[str, Any]], written: Path | None) -> None:
    from rich.table import Table

    from stabctl.sweep.overview import cell, overview

    found, console = overview(rows), shared.console()
    console.print(", ".join(f"{column} {value}" for column, value in found.common.items()))
    table = Table(*found.columns)
    for cells in found.cells:
        table.add_row(*map(cell, found.columns, cells))
    console.print(table)
    for what, sentence in found.errors:
        print(f"{what}: {sentence}")
    print(found)
    if written:
        print(f"written {written}")
