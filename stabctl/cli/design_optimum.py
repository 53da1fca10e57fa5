"""stabctl design optimum: the open-loop optimal storage schedule for the longest survivable fault."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from . import groups, options, shared
from .parameters import Option

if TYPE_CHECKING:
    from stabctl.design.optimum import Optimum

Window = Annotated[
    str, Option("--window", metavar="TIME", parser=options.time, help="Length of the schedule after clearing, s.")
]
Rate = Annotated[int, Option("--rate", min=1, max=1000, help="Orders per second and device.")]
Energy = Annotated[
    str | None, Option("--energy", help="Largest energy absorbed or injected by a device: 50kWh, or MWh.")
]
Iterations = Annotated[int, Option("--iterations", min=1, help="Maximum number of convex programs.")]
Plot = Annotated[Path | None, Option("--plot", help="Write a figure of the run (png, svg or pdf).")]
Out = Annotated[Path | None, Option("--out", help="Write the schedule to FILE.csv.")]


def optimum(
    *,
    fault: options.Fault,
    trip: options.TripAtClearing = None,
    window: Window = "3s",
    rate: Rate = 60,
    energy: Energy = None,
    iterations: Iterations = 60,
    resolution: options.Resolution = "0.125cyc",
    limit: options.Limit = "60cyc",
    observe: options.Observe = "5s",
    longest: options.Longest = "20s",
    step: options.Step = None,
    plot: Plot = None,
    report: options.Report = None,
    out: Out = None,
    fault_impedance: options.FaultImpedance = "0,0",
    storage: groups.StorageOptions,
    law: groups.LawOptions,
    stability: groups.StabilityOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Find the schedule of storage orders with the longest critical clearing time: a local optimum."""
    from stabctl.design.optimum import optimum
    from stabctl.simulation.contingency import Contingency

    shared.file(out, ".csv")
    shared.file(plot, ".png", ".svg", ".pdf")
    shared.folder(report)
    loaded = case.load()
    through = shared.impedance(fault_impedance)
    with shared.progress("optimizing", None) as tell:
        found = optimum(
            storage.initialize(loaded),
            Contingency(fault, trip=trip or (), impedance=through),
            law=law.law(),
            window=window,
            rate=rate,
            energy=energy,
            resolution=resolution,
            limit=limit,
            observe=observe,
            longest=longest,
            step=step,
            criterion=stability.criterion(loaded),
            iterations=iterations,
            progress=lambda _made: tell(None),
        )
    written = [found.save(path) for path in (out, plot) if path] + ([found.report(report)] if report else [])
    _show(found, written, as_json)


def _show(found: "Optimum", written: list[Path], as_json: bool) -> None:
    if as_json:
        shared.print_json(
            {
                "case": found.case,
                "cycles": found.cycles,
                "seconds": found.seconds,
                "law_cycles": found.start.cycles,
                "local_optimum": True,
                "ended": found.ended,
                "stable": found.proof.stable,
                "observed_s": found.proof.observed_s,
                "energy_kwh": found.energy_kwh.tolist(),
                "devices": found.run.devices(),
                "binding": found.binding,
                "iterations": [one._asdict() for one in found.iterations],
                "simulations": found.simulations,
                "time_s": found.time.tolist(),
                "orders": found.schedule.orders.tolist(),
                "files": [str(path) for path in written],
                "wall_s": found.wall_s,
            }
        )
        return
    from rich.table import Table

    table = Table("convex program", "clearing time, cycles", "excursion, rad", "solver", "simulations so far")
    for one in found.iterations:
        table.add_row(str(one.number), f"{one.cycles:g}", f"{one.excursion:.3f}", one.status, str(one.simulations))
    shared.console().print(table)
    shared.console().print(str(found))
    shared.written(written)
