"""stabctl screen: the line faults with the shortest critical clearing times."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import groups, options, shared
from .grouped import grouped

if TYPE_CHECKING:
    from stabctl.clearing import Screen

Below = Annotated[
    str | None,
    typer.Option(
        "--below", metavar="TIME", parser=options.time, help="List only pairs with shorter clearing times, s or 8cyc."
    ),
]
Report = Annotated[Path | None, typer.Option("--report", help="Write a page with figures to this folder.")]
Out = Annotated[Path | None, typer.Option("--out", help="Write the pairs to FILE.csv.")]


@grouped
def screen(
    *,
    below: Below = None,
    resolution: options.Resolution = "0.125cyc",
    limit: options.Limit = "60cyc",
    observe: options.Observe = "5s",
    longest: options.Longest = "20s",
    scan: options.Scan = "auto",
    step: options.Step = None,
    control: options.Control = None,
    controller: options.Controllers = None,
    storage: groups.StorageOptions,
    law: groups.LawOptions,
    stability: groups.StabilityOptions,
    estimator: options.Estimator = "ideal",
    pmu: groups.PmuOptions,
    workers: options.Workers = None,
    store: options.Store = None,
    scheduler: options.Scheduler = None,
    out: Out = None,
    report: Report = None,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Find the critical clearing times of faults at both ends of every line, cleared by opening it; shortest first."""
    from stabctl.clearing import screen

    shared.file(out, ".csv")
    shared.folder(report)
    loaded = case.load()
    point = storage.initialize(loaded)
    chosen, own = law.chosen(point.case, control, shared.controllers(controller))
    steering = pmu.steering(chosen, own, estimator)
    with shared.progress("screening", 1.0) as tell:
        found = screen(
            point,
            below,
            control=steering,
            resolution=resolution,
            limit=limit,
            observe=observe,
            longest=longest,
            scan=scan,
            step=step,
            criterion=stability.criterion(loaded),
            workers=workers,
            store=store,
            scheduler=scheduler,
            progress=lambda done, total: tell(done / total),
        )
    _show(found, as_json)
    if out:
        found.save(out)
        if not as_json:
            shared.console().print(f"written: {out}")
    if report:
        path = found.report(report, base=point)
        if not as_json:
            shared.console().print(f"written: {path}")


def _show(found: "Screen", as_json: bool) -> None:
    if as_json:
        from stabctl.clearing.screen_result import COLUMNS

        shared.print_json(
            {
                "case": found.case,
                "pairs": [dict(zip(COLUMNS, row, strict=True)) for row in found.rows()],
                "bridges": found.lines.bridges,
                "twins": found.lines.twins,
                "screened": found.screened,
                "simulations": found.simulations,
                "wall_s": found.wall_s,
                "observed_s": found.search.observed_s,
                "longest_observed_s": found.observed_s,
                "resolution_cycles": found.search.resolution_cycles,
                "limit_cycles": found.search.limit_cycles,
            }
        )
        return
    from rich.table import Table

    from stabctl.model import labels

    table = Table("fault at bus", "trip", "critical clearing time, cycles", "loses synchronism first")
    for p in found.pairs:
        longest = f"{found.search.limit_cycles:g} or more"
        shown = {"unstable_at_zero": "unstable at any", "stable_at_limit": longest}
        first = "" if p.machine is None else labels.unit(p.machine)
        cycles = shown.get(p.status) or f"{p.cycles:g}"
        table.add_row(p.fault, " ".join(p.trip), cycles, first)
    if found.pairs:
        shared.console().print(table)
    for sentence in found.remarks():
        shared.console().print(sentence)
