"""stabctl estimate: rotor speeds estimated from PMU reports, with the storage control in the loop."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import shared

if TYPE_CHECKING:
    from stabctl.estimation.estimates import Accuracy, Estimates

Clear = Annotated[str, typer.Option("--clear", help="Clearing time: 6cyc, 0.1s, 100ms.")]
At = Annotated[float, typer.Option("--at", help="Time of the fault, s.")]
Plot = Annotated[Path | None, typer.Option("--plot", help="Draw true and estimated speeds to FILE.png or .svg.")]


def estimate(
    case: shared.CaseName,
    fault: shared.Fault,
    clear: Clear,
    trip: shared.Trip = None,
    at: At = 1.0,
    observe: shared.Observe = 5.0,
    step: shared.Step = None,
    storage: shared.Size = None,
    storage_at: shared.SizeAt = None,
    characteristic: shared.Characteristic = "power",
    lag: shared.Lag = 0.0,
    deadband: shared.Deadband = 0.1,
    min_voltage: shared.MinVoltage = 0.8,
    fault_impedance: shared.FaultImpedance = "0,0",
    max_angle: shared.Angle = 3.5,
    estimator: shared.Estimator = "kalman",
    pmu_rate: shared.PmuRate = 60,
    pmu_noise_mrad: shared.PmuNoise = 2.0,
    latency_ms: shared.Latency = 50.0,
    loss: shared.Loss = 0.02,
    seed: shared.Seed = 1,
    plot: Plot = None,
    classical: shared.Classical = False,
    as_json: shared.Json = False,
) -> None:
    """Estimate rotor speeds from PMU reports during a fault, and compare them with the true speeds."""
    from stabctl.controllers import BangBang
    from stabctl.errors import StudyError
    from stabctl.estimation.estimate import estimate as simulate
    from stabctl.estimation.estimator_control import EstimatorControl
    from stabctl.simulation.contingency import Contingency
    from stabctl.units import seconds

    if not 0.05 < observe < float("inf"):
        raise StudyError(f"--observe {observe:g} s is not allowed; it must be more than 0.05 s.")
    shared.file(plot, ".png", ".svg")
    loaded = shared.load(case, classical)
    off = seconds(clear, loaded.frequency_hz)
    contingency = Contingency(fault, clear, trip or (), at=at, impedance=shared.impedance(fault_impedance))
    point = shared.start(loaded, storage, storage_at, characteristic=characteristic, lag=lag)
    law = shared.law(point.case, None, deadband, min_voltage) or BangBang(deadband, min_voltage)
    pmu = shared.pmu(pmu_rate, pmu_noise_mrad, latency_ms, loss)
    found = simulate(
        point,
        contingency,
        at + off + observe,
        control=EstimatorControl(law, estimator, pmu),
        seeds=seed,
        step=step,
        criterion=shared.criterion(max_angle),
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
