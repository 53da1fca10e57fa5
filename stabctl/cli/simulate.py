"""stabctl simulate: a fault, its clearing, and whether the system stays stable."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from . import groups, options, shared
from .parameters import Option

if TYPE_CHECKING:
    from stabctl.judgment import Judged
    from stabctl.simulation.trajectory import Trajectory

FaultOrNone = Annotated[str | None, Option("--fault", help=options.FAULT)]
Clear = Annotated[
    str | None, Option("--clear", metavar="TIME", parser=options.time, help="Duration of the fault, s or 6cyc.")
]
Until = Annotated[
    str, Option("--until", metavar="TIME", parser=options.time, help="End of the simulation, s or 500ms.")
]
Every = Annotated[
    str,
    Option("--every", metavar="TIME", parser=options.time, help="Shortest time between two rows of the output: 50ms."),
]
Out = Annotated[Path | None, Option("--out", help="Write the trajectory to FILE.nc or FILE.csv.")]
Plot = Annotated[Path | None, Option("--plot", help="Plot speeds, angles, voltages, storage to FILE.png or .svg.")]
Channels = Annotated[
    str,
    Option(
        "--channels", help="What --plot draws and FILE.csv holds, instead of the usual: voltage:16,speed:2,storage."
    ),
]
AngleReference = Annotated[
    str | None,
    Option("--angle-reference", metavar="MACHINE", help="Machine that the angles in FILE.csv are relative to."),
]


def simulate(
    *,
    fault: FaultOrNone = None,
    clear: Clear = None,
    trip: options.Trip = None,
    at: options.At = options.BEGINS,
    until: Until = "10s",
    opened: options.Open = None,
    tripped: options.TripMachine = None,
    stepped: options.LoadStep = None,
    step: options.Step = None,
    control: options.Control = None,
    controller: options.Controllers = None,
    storage: groups.StorageOptions,
    law: groups.LawOptions,
    fault_impedance: options.FaultImpedance = "0,0",
    stability: groups.StabilityOptions,
    estimator: options.Estimator = "ideal",
    pmu: groups.PmuOptions,
    out: Out = None,
    every: Every = "0s",
    angle_reference: AngleReference = None,
    plot: Plot = None,
    channels: Channels = "",
    report: options.Report = None,
    by: options.Criteria = None,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Simulate a fault and its clearing, or other events, and report whether the system remains stable."""
    from stabctl._util.errors import StudyError
    from stabctl._util.units import seconds
    from stabctl.simulation.contingency import Contingency
    from stabctl.simulation.simulate import simulate

    if fault and clear is None:
        raise StudyError("--fault needs --clear; give a clearing time such as 6cyc.")
    if clear is not None and not (fault or trip):
        raise StudyError("--clear needs --fault or --trip; give a location such as 83 or 7-8@0.4.")
    if at != options.BEGINS and not (fault or trip):
        raise StudyError("--at needs --fault or --trip; other events have their own times.")
    shared.file(out, ".csv", ".nc")
    shared.file(plot, ".png", ".svg")
    shared.folder(report)
    rules = shared.criteria(by)
    through = shared.impedance(fault_impedance)
    if through and not fault:
        raise StudyError("--fault-impedance needs --fault; give a location such as 83 or 7-8@0.4.")
    if channels and not (plot or (out and out.suffix.lower() == ".csv")):
        raise StudyError("--channels applies to a figure and to a .csv file; give --plot FILE.png or --out FILE.csv.")
    if angle_reference is not None and (out is None or out.suffix.lower() != ".csv"):
        raise StudyError("--angle-reference applies to the angles in a .csv file; give --out FILE.csv.")
    loaded = case.load()
    if angle_reference is not None:
        loaded.machine(angle_reference)
    events = shared.events(loaded, opened, tripped, stepped)
    contingency = Contingency(fault, clear, trip or (), at=at, impedance=through, events=events)
    point = storage.initialize(loaded)
    steering = pmu.steering(*law.chosen(bool(point.case.storage), control, shared.controllers(controller)), estimator)
    with shared.progress("simulating", seconds(until, loaded.frequency_hz)) as tell:
        result = simulate(
            point,
            contingency,
            until,
            control=steering,
            step=step,
            criterion=stability.criterion(loaded),
            every=every if out or plot or report or rules else until,  # without a file the extremes are enough
            progress=tell,
        )
    if out:
        result.save(out, channels=channels, angle_reference=angle_reference)
    if plot:
        from stabctl.view.figures import style, trajectory

        style.save(trajectory.overview(result, channels), plot)
    page = result.report(report) if report else None
    said = contingency.described(loaded) if isinstance(clear, float) else ""
    judged = result.judge(rules) if rules else None
    _show(result, as_json, [p for p in (out, plot, page) if p], said, judged=judged)


def _show(result: "Trajectory", as_json: bool, written: list[Path], said: str, *, judged: "Judged | None") -> None:
    from stabctl.model import conventions

    end = result.outcome
    case = result.point.case
    record: dict[str, Any] = {
        "case": case.name,
        "conventions": conventions.of(case),
        "outcome": end.kind.value,
        "message": end.message,
        "machine": end.machine,
        "time_s": end.time_s,
        "max_angle_from_coi_deg": result.max_angle_from_coi_deg,
        "steps": result.steps,
        "wall_s": result.wall_s,
        "newton_stages": result.newton_stages,
    }
    if judged:
        record["violations"] = [one._asdict() for one in judged.violations]
        record["undecided"] = list(judged.undecided)
    if as_json:
        shared.print_json(record | {"bus": end.bus, "stable": end.stable, "stalled": list(end.stalled)})
        return
    from rich.table import Table

    from stabctl.simulation import steps

    table = Table("", case.name, show_header=True)
    if said:
        table.add_row("contingency", said)
    table.add_row("outcome", end.kind.value.replace("_", " "))
    table.add_row("", end.message)
    table.add_row("largest change of angle from the COI", f"{result.max_angle_from_coi_deg:.1f} degrees")
    table.add_row("simulated", f"{result.steps} steps in {result.wall_s:.3f} s")
    if result.idle:
        table.add_row("storage", "without orders: no law and no controller gives it any")
    if result.step < steps.STEP / 4:
        table.add_row("short time step", f"{1e3 * result.step:.3g} ms{steps.forced_by(result.point)}")
    for k, line in enumerate(str(judged).splitlines() if judged else ()):
        table.add_row("" if k else "criteria", line)
    for path in written:
        table.add_row("written", str(path))
    shared.console().print(table)
