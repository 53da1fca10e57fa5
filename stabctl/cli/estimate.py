"""stabctl estimate: rotor speeds estimated from PMU reports, with the storage control in the loop."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from . import groups, options, shared
from .parameters import Option

if TYPE_CHECKING:
    from stabctl.estimation.estimates import Estimates

Clear = Annotated[str, Option("--clear", metavar="TIME", parser=options.time, help="Duration of the fault, s or 6cyc.")]
EngineOption = Annotated[
    Literal["batched", "filterpy"],
    Option(
        "--engine", help="All Kalman filters together (compiled), or one filterpy filter per machine (the reference)."
    ),
]
Plot = Annotated[Path | None, Option("--plot", help="Plot true and estimated speeds to FILE.png or .svg.")]


def estimate(
    *,
    fault: options.Fault,
    clear: Clear,
    trip: options.Trip = None,
    at: options.At = options.BEGINS,
    observe: options.Observe = "5s",
    step: options.Step = None,
    controller: options.Controllers = None,
    storage: groups.StorageOptions,
    law: groups.LawOptions,
    fault_impedance: options.FaultImpedance = "0,0",
    stability: groups.StabilityOptions,
    estimator: options.Estimator = "kalman",
    engine: EngineOption = "batched",
    pmu: groups.PmuOptions,
    plot: Plot = None,
    report: options.Report = None,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Estimate rotor speeds from PMU reports during a fault, and compare them with the true speeds."""
    from stabctl._util.errors import StudyError
    from stabctl._util.units import seconds
    from stabctl.estimation.estimate import estimate as simulate
    from stabctl.estimation.estimator_control import EstimatorControl
    from stabctl.simulation.contingency import Contingency

    if estimator == "ideal" and pmu != groups.PmuOptions():
        raise StudyError(
            "The ideal estimator has no PMUs; leave out --pmu-rate, --pmu-noise-mrad, --latency-ms, --loss and --seed."
        )
    if engine != "batched" and estimator not in ("kinematic", "kalman"):
        raise StudyError(f"--engine is that of Kalman filters; leave it out with --estimator {estimator}.")
    shared.file(plot, ".png", ".svg")
    shared.folder(report)
    loaded = case.load()
    observed = seconds(observe, loaded.frequency_hz)
    if not observed > 0.05:
        raise StudyError(f"--observe {observed:g} s is not allowed; it must be more than 0.05 s.")
    begins, lasts = (seconds(time, loaded.frequency_hz) for time in (at, clear))
    contingency = Contingency(fault, clear, trip or (), at=at, impedance=shared.impedance(fault_impedance))
    point = storage.initialize(loaded)
    given = shared.controllers(controller)
    stored = bool(point.case.storage)
    chosen, own = law.chosen(stored, None, given) if stored or given else (law.law(), [])
    behind: list[Any] = [*([chosen] if chosen else []), *own]
    found = simulate(
        point,
        contingency,
        begins + lasts + observed,
        control=EstimatorControl(behind, estimator, pmu.pmu(), engine=engine),
        seeds=pmu.seed,
        step=step,
        criterion=stability.criterion(loaded),
        record=report is not None,
    )
    if plot:
        found.save(plot)
    said = contingency.described(loaded) if isinstance(clear, float) else ""
    page = found.report(report) if report else None
    _show(found, as_json, [path for path in (plot, page) if path], said)


def _show(found: "Estimates", as_json: bool, written: list[Path], said: str) -> None:
    end, accuracy = found.runs[0].outcome, found.accuracy
    if as_json:
        name = found.point.case.name
        outcome = {"outcome": end.kind.value, "message": end.message}
        shared.print_json({"case": name, "judged_from_s": found.judged_from_s, **accuracy._asdict(), **outcome})
        return
    from rich.table import Table

    from stabctl.estimation.estimates import SETTLED

    table = Table("", str(found))
    if said:
        table.add_row("contingency", said)
    table.add_row("outcome", end.message)
    table.add_row("judged from", f"{found.judged_from_s:.3f} s on, {1e3 * SETTLED:.0f} ms after the last event")
    table.add_row("error, rms", f"{accuracy.rmse_mhz:.1f} mHz")
    table.add_row("error, 99th percentile", f"{accuracy.p99_mhz:.1f} mHz")
    table.add_row("delay", accuracy.delay)
    table.add_row("wrong commands", f"{100 * accuracy.wrong_command_share:.2f} %")
    table.add_row("opposite commands", f"{100 * accuracy.opposite_command_share:.2f} %")
    table.add_row("computing time", f"{accuracy.cpu_ms_per_frame:.2f} ms per frame")
    for path in written:
        table.add_row("written", str(path))
    shared.console().print(table)
