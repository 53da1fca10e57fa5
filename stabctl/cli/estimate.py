"""stabctl estimate: rotor speeds estimated from PMU reports, with the storage control in the loop."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import options, shared

if TYPE_CHECKING:
    from stabctl.estimation.estimates import Accuracy, Estimates

Clear = Annotated[str, typer.Option("--clear", help="Clearing time: 6cyc, 0.1s, 100ms.")]
At = Annotated[float, typer.Option("--at", help="Time of the fault, s.")]
Plot = Annotated[Path | None, typer.Option("--plot", help="Draw true and estimated speeds to FILE.png or .svg.")]


def estimate(
    case: options.CaseName,
    fault: options.Fault,
    clear: Clear,
    trip: options.Trip = None,
    at: At = 1.0,
    observe: options.Observe = "5s",
    step: options.Step = None,
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
    estimator: options.Estimator = "kalman",
    pmu_rate: options.PmuRate = 60,
    pmu_noise_mrad: options.PmuNoise = 2.0,
    latency_ms: options.Latency = 50.0,
    loss: options.Loss = 0.02,
    seed: options.Seed = 1,
    plot: Plot = None,
    settings: options.Set = None,
    device: options.Device = None,
    classical: options.Classical = False,
    verbose: options.Verbose = False,
    as_json: options.Json = False,
) -> None:
    """Estimate rotor speeds from PMU reports during a fault, and compare them with the true speeds."""
    from stabctl.controllers import BangBang
    from stabctl.errors import StudyError
    from stabctl.estimation.estimate import estimate as simulate
    from stabctl.estimation.estimator_control import EstimatorControl
    from stabctl.simulation.contingency import Contingency
    from stabctl.units import seconds

    shared.file(plot, ".png", ".svg")
    loaded = shared.load(case, classical, settings, verbose)
    observed = seconds(observe, loaded.frequency_hz)
    if not observed > 0.05:
        raise StudyError(f"--observe {observed:g} s is not allowed; it must be more than 0.05 s.")
    off = seconds(clear, loaded.frequency_hz)
    contingency = Contingency(fault, clear, trip or (), at=at, impedance=shared.impedance(fault_impedance))
    point = shared.start(loaded, storage, storage_at, characteristic=characteristic, lag=lag)
    law = shared.law(point.case, None, deadband, min_voltage) or BangBang(deadband, min_voltage)
    pmu = shared.pmu(pmu_rate, pmu_noise_mrad, latency_ms, loss)
    found = simulate(
        point,
        contingency,
        at + off + observed,
        control=EstimatorControl(law, estimator, pmu),
        seeds=seed,
        step=step,
        criterion=shared.criterion(loaded, max_angle, min_frequency, max_frequency, frequency_delay),
        record=False,
    )
    if plot:
        from stabctl.plotting import estimates, style

        style.save(estimates.plot(found), plot)
    _show(found, found.accuracy, as_json, plot)


def _show(found: "Estimates", accuracy: "Accuracy", as_json: bool, plot: Path | None) -> None:
    end = found.runs[0].outcome
    if as_json:
        shared.print_json(accuracy._asdict() | {"outcome": end.kind.value, "message": end.message})
        return
    from rich.table import Table

    table = Table("", str(found))
    table.add_row("outcome", end.message)
    table.add_row("error, rms", f"{accuracy.rmse_mhz:.1f} mHz")
    table.add_row("error, 99th percentile", f"{accuracy.p99_mhz:.1f} mHz")
    table.add_row("delay", f"{accuracy.delay_ms:.1f} ms")
    table.add_row("wrong commands", f"{100 * accuracy.wrong_command_share:.2f} %")
    table.add_row("opposite commands", f"{100 * accuracy.opposite_command_share:.2f} %")
    table.add_row("computing time", f"{accuracy.cpu_ms_per_frame:.2f} ms per frame")
    if plot:
        table.add_row("written", str(plot))
    shared.console().print(table)
