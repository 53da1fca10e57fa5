"""stabctl simulate: a fault, its clearing, and what becomes of the system."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import shared

if TYPE_CHECKING:
    from stabctl.simulation.trajectory import Trajectory

FaultOrNone = Annotated[
    str | None, typer.Option("--fault", help="83 (a bus), 7-8@0.4 (along it from the first bus named; 7-8: half-way).")
]
Clear = Annotated[str | None, typer.Option("--clear", help="Clearing time: 6cyc, 0.1s, 100ms.")]
At = Annotated[float, typer.Option("--at", help="Instant of the fault, s.")]
Until = Annotated[float, typer.Option("--until", help="End of the run, s.")]
Out = Annotated[Path | None, typer.Option("--out", help="Write the trajectory to FILE.nc or FILE.csv.")]
Plot = Annotated[
    Path | None, typer.Option("--plot", help="Draw speeds, angles, voltages, storage to FILE.png or .svg.")
]


def simulate(
    case: shared.CaseName,
    fault: FaultOrNone = None,
    clear: Clear = None,
    trip: shared.Trip = None,
    at: At = 1.0,
    until: Until = 10.0,
    step: shared.Step = None,
    control: shared.Control = None,
    storage: shared.Size = None,
    storage_at: shared.SizeAt = None,
    characteristic: shared.Characteristic = "power",
    lag: shared.Lag = 0.0,
    deadband: shared.Deadband = 0.1,
    min_voltage: shared.MinVoltage = 0.8,
    fault_impedance: shared.FaultImpedance = "0,0",
    max_angle: shared.Angle = 3.5,
    estimator: shared.Estimator = "ideal",
    pmu_rate: shared.PmuRate = 60,
    pmu_noise_mrad: shared.PmuNoise = 2.0,
    latency_ms: shared.Latency = 50.0,
    loss: shared.Loss = 0.02,
    seed: shared.Seed = 1,
    out: Out = None,
    plot: Plot = None,
    classical: shared.Classical = False,
    as_json: shared.Json = False,
) -> None:
    """Simulate a fault, cleared by opening its circuit and those of --trip, with or without storage."""
    from stabctl.errors import StudyError
    from stabctl.simulation.contingency import Contingency
    from stabctl.simulation.simulation import run

    if fault and not clear:
        raise StudyError("--fault needs --clear; give a clearing time such as 6cyc.")
    if clear and not (fault or trip):
        raise StudyError("--clear needs --fault or --trip; give a place such as 83 or 7-8@0.4.")
    shared.file(out, ".csv", ".nc")
    shared.file(plot, ".png", ".svg")
    through = shared.impedance(fault_impedance)
    loaded = shared.load(case, classical)
    events = ()
    if fault or trip:
        events = Contingency(fault, clear, trip or (), at=at, impedance=through)
    options = {"characteristic": characteristic, "lag": lag}
    point = shared.start(loaded, storage, storage_at, **options)
    law = shared.law(point.case, control, deadband, min_voltage)
    signals = shared.pmu(pmu_rate, pmu_noise_mrad, latency_ms, loss)
    steering = shared.steering(law, estimator, signals, seed)
    with shared.progress("simulating", until) as tell:
        keep = out is not None or plot is not None
        result = run(point, events, until, steering, step, shared.criterion(max_angle), keep, progress=tell)
    if out:
        result.save(out)
    if plot:
        from stabctl.plotting import style, trajectory

        style.save(trajectory.overview(result), plot)
    _show(result, as_json, [p for p in (out, plot) if p])


def _show(result: "Trajectory", as_json: bool, written: list[Path]) -> None:
    end = result.outcome
    record = {
        "outcome": end.kind.value,
        "message": end.message,
        "machine": end.machine,
        "time_s": end.time_s,
        "max_angle_from_coi_deg": result.max_angle_from_coi_deg,
        "steps": result.steps,
        "wall_s": result.wall_s,
    }
    if as_json:
        shared.print_json(record | {"bus": end.bus, "stable": end.stable})
        return
    from rich.table import Table

    table = Table("", result.point.case.name, show_header=True)
    table.add_row("outcome", end.kind.value.replace("_", " "))
    table.add_row("", end.message)
    table.add_row("largest change of angle from the COI", f"{result.max_angle_from_coi_deg:.1f} degrees")
    table.add_row("simulated", f"{result.steps} steps in {result.wall_s:.3f} s")
    for path in written:
        table.add_row("written", str(path))
    shared.console().print(table)
