"""stabctl screen: the line faults with the shortest critical clearing times."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import options, shared

if TYPE_CHECKING:
    from stabctl.clearing import Screen

Below = Annotated[str | None, typer.Option("--below", help="List only pairs with shorter clearing times: 8cyc.")]
Out = Annotated[Path | None, typer.Option("--out", help="Write the pairs to FILE.csv.")]


def screen(
    case: options.CaseName,
    below: Below = None,
    settings: options.Set = None,
    device: options.Device = None,
    resolution: options.Resolution = "0.125cyc",
    limit: options.Limit = "60cyc",
    observe: options.Observe = "5s",
    step: options.Step = None,
    control: options.Control = None,
    storage: options.Size = None,
    storage_at: options.SizeAt = None,
    characteristic: options.Characteristic = "power",
    lag: options.Lag = "0s",
    deadband: options.Deadband = 0.1,
    min_voltage: options.MinVoltage = 0.8,
    max_angle: options.Angle = 3.5,
    min_frequency: options.MinFrequency = None,
    max_frequency: options.MaxFrequency = None,
    frequency_delay: options.FrequencyDelay = "1s",
    workers: options.Workers = None,
    out: Out = None,
    classical: options.Classical = False,
    verbose: options.Verbose = False,
    as_json: options.Json = False,
) -> None:
    """Find the critical clearing times of faults at both ends of every line, cleared by opening it; shortest first."""
    from stabctl.clearing import screen

    shared.file(out, ".csv")
    loaded = shared.load(case, classical, settings, verbose)
    point = shared.start(loaded, storage, storage_at, characteristic=characteristic, lag=lag)
    with shared.progress("screening", 1.0) as tell:
        found = screen(
            point,
            below,
            control=shared.law(point.case, control, deadband, min_voltage),
            resolution=resolution,
            limit=limit,
            observe=observe,
            step=step,
            criterion=shared.criterion(loaded, max_angle, min_frequency, max_frequency, frequency_delay),
            workers=workers,
            progress=lambda done, total: tell(done / total),
        )
    _show(found, as_json)
    if out:
        found.save(out)
        if not as_json:
            shared.console().print(f"written: {out}")


def _show(found: "Screen", as_json: bool) -> None:
    if as_json:
        from stabctl.clearing.screen import COLUMNS

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
                "resolution_cycles": found.search.resolution_cycles,
                "limit_cycles": found.search.limit_cycles,
            }
        )
        return
    from rich.table import Table

    table = Table("fault at bus", "trip", "critical clearing time, cycles", "loses synchronism first")
    for p in found.pairs:
        longest = f"{found.search.limit_cycles:g} or more"
        shown = {"unstable_at_zero": "unstable at any", "stable_at_limit": longest}
        first = "" if p.machine is None else f"machine {p.machine}"
        cycles = shown.get(p.status) or f"{p.cycles:g}"
        table.add_row(p.fault, " ".join(p.trip), cycles, first)
    if found.pairs:
        shared.console().print(table)
    for sentence in found.remarks():
        shared.console().print(sentence)
