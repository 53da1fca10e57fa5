"""stabctl clearing-time: how long a fault may last."""

from typing import TYPE_CHECKING, Annotated

import typer

from . import options, shared

if TYPE_CHECKING:
    from stabctl.clearing import ClearingTime

AFTER = "times count from the fault. Repeatable."
Open = Annotated[list[str] | None, typer.Option("--open", help=f"Another line trip, 7-8@0.5s; {AFTER}")]
TripMachine = Annotated[list[str] | None, typer.Option("--trip-machine", help=f"Machine trip, 14@0.1s; {AFTER}")]
LoadStep = Annotated[list[str] | None, typer.Option("--load-step", help=f"Change of load, 7:+50MW@0.1s; {AFTER}")]


def clearing_time(
    case: options.CaseName,
    fault: options.Fault,
    trip: options.Trip = None,
    opened: Open = None,
    tripped: TripMachine = None,
    stepped: LoadStep = None,
    settings: options.Set = None,
    device: options.Device = None,
    resolution: options.Resolution = "0.125cyc",
    limit: options.Limit = "60cyc",
    observe: options.Observe = "5s",
    scan: options.Scan = "4cyc",
    step: options.Step = None,
    control: options.Control = None,
    storage: options.Size = None,
    storage_at: options.SizeAt = None,
    characteristic: options.Characteristic = "power",
    lag: options.Lag = "0s",
    deadband: options.Deadband = 0.1,
    min_voltage: options.MinVoltage = 0.8,
    fault_impedance: options.FaultImpedance = "0,0",
    max_angle: options.Angle = 3.5,
    min_frequency: options.MinFrequency = None,
    max_frequency: options.MaxFrequency = None,
    frequency_delay: options.FrequencyDelay = "1s",
    estimator: options.Estimator = "ideal",
    pmu_rate: options.PmuRate = 60,
    pmu_noise_mrad: options.PmuNoise = 2.0,
    latency_ms: options.Latency = 50.0,
    loss: options.Loss = 0.02,
    seed: options.Seed = 1,
    classical: options.Classical = False,
    verbose: options.Verbose = False,
    as_json: options.Json = False,
) -> None:
    """Find the critical clearing time of a fault."""
    from stabctl.clearing import clearing_time
    from stabctl.simulation.contingency import Contingency

    loaded = shared.load(case, classical, settings, verbose)
    events = shared.events(loaded, opened, tripped, stepped)
    through = shared.impedance(fault_impedance)
    point = shared.start(loaded, storage, storage_at, characteristic=characteristic, lag=lag)
    law = shared.law(point.case, control, deadband, min_voltage)
    pmu = shared.pmu(pmu_rate, pmu_noise_mrad, latency_ms, loss)
    with shared.progress("searching", None) as tell:
        found = clearing_time(
            point,
            Contingency(fault, trip=trip or (), at=0.0, impedance=through, events=events),
            control=shared.steering(law, estimator, pmu, seed, "batched"),
            resolution=resolution,
            limit=limit,
            observe=observe,
            scan=scan,
            step=step,
            criterion=shared.criterion(loaded, max_angle, min_frequency, max_frequency, frequency_delay),
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
                "lowest_unstable_cycles": found.lowest_unstable,
                "stable_above_cycles": found.stable_above,
                "observed_s": found.search.observed_s,
                "resolution_cycles": found.search.resolution_cycles,
                "runs": runs,
                "wall_s": found.wall_s,
            }
        )
        return
    from rich.table import Table

    table = Table("clearing time, cycles", "outcome", "loses synchronism first", "end, s after the fault")
    for r in found.runs:
        end = r.outcome.value.replace("_", " ")
        table.add_row(f"{r.cycles:g}", end, "" if r.machine is None else f"machine {r.machine}", f"{r.time_s:.2f}")
    shared.console().print(table)
    shared.console().print(str(found))
