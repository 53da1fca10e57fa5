"""stabctl clearing-time: how long a fault may last."""

from typing import TYPE_CHECKING, Annotated

import typer

from . import shared

if TYPE_CHECKING:
    from stabctl.clearing import ClearingTime

Resolution = Annotated[str, typer.Option("--resolution", help="Grid of clearing times; 1cyc is the paper's.")]


def clearing_time(
    case: shared.CaseName,
    fault: shared.Fault,
    trip: shared.Trip = None,
    resolution: Resolution = "0.125cyc",
    limit: shared.Limit = "60cyc",
    observe: shared.Observe = 5.0,
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
    classical: shared.Classical = False,
    as_json: shared.Json = False,
) -> None:
    """Find the critical clearing time of a fault."""
    from stabctl.clearing import clearing_time
    from stabctl.simulation.contingency import Contingency

    loaded = shared.load(case, classical)
    point = shared.start(loaded, storage, storage_at, characteristic=characteristic, lag=lag)
    law = shared.law(point.case, control, deadband, min_voltage)
    signals = shared.pmu(pmu_rate, pmu_noise_mrad, latency_ms, loss)
    steering = shared.steering(law, estimator, signals, seed, "batched")
    with shared.progress("searching", None) as tell:
        found = clearing_time(
            point,
            Contingency(fault, trip=trip or (), impedance=shared.impedance(fault_impedance)),
            control=steering,
            resolution=resolution,
            limit=limit,
            observe=observe,
            step=step,
            criterion=shared.criterion(max_angle),
            progress=lambda _run: tell(None),
        )
    _show(found, as_json)


def _show(found: "ClearingTime", as_json: bool) -> None:
    if as_json:
        runs = [
            {
                "cycles": r.cycles,
                "stable": r.stable,
                "outcome": r.outcome.value,
                "machine": r.machine,
                "time_s": r.time_s,
            }
            for r in found.runs
        ]
        shared.print_json(
            {
                "cycles": found.cycles,
                "seconds": found.seconds,
                "status": found.status,
                "machine": found.machine,
                "monotone": found.monotone,
                "observed_s": found.search.observed_s,
                "resolution_cycles": found.search.resolution_cycles,
                "runs": runs,
                "wall_s": found.wall_s,
            }
        )
        return
    from rich.table import Table

    table = Table("cleared after, cycles", "outcome", "loses synchronism first", "ended after, s")
    for r in found.runs:
        end = r.outcome.value.replace("_", " ")
        table.add_row(f"{r.cycles:g}", end, "" if r.machine is None else f"machine {r.machine}", f"{r.time_s:.2f}")
    shared.console().print(table)
    shared.console().print(str(found))
