"""stabctl design law: the control law of storage devices."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from . import groups, options, shared
from .parameters import Option

if TYPE_CHECKING:
    from stabctl.design import LawDesign, LawLimits
    from stabctl.dynamics.operating_point import OperatingPoint
    from stabctl.simulation.contingency import Contingency

OneFault = Annotated[str | None, Option("--fault", help=f"{options.FAULT} Instead of a list.")]
File = Annotated[Path | None, Option("--contingencies", help="FILE.toml with [[contingency]] fault, trip, clear.")]
Screened = Annotated[int | None, Option("--from-screen", min=1, help="Number of most critical faults of a screen.")]
Energy = Annotated[
    float | None,
    Option("--max-energy", metavar="ENERGY", parser=options.in_unit("kWh"), help="Energy of all devices, kWh."),
]
Switchings = Annotated[int, Option("--switchings", min=0, help="Sign changes of an order within a swing.")]
Coi = Annotated[
    float | None,
    Option("--max-coi", metavar="FREQUENCY", parser=options.in_unit("Hz"), help="Deviation of the COI speed, Hz."),
]
Voltage = Annotated[float, Option("--final-voltage", min=0.0, help="Lowest voltage of a bus at the end, pu.")]
MinVoltage = Annotated[
    float, Option("--min-voltage", min=0.0, help="Voltage down to which devices are able to act, pu.")
]
Deadband = Annotated[
    float, Option("--min-deadband", metavar="FREQUENCY", parser=options.in_unit("Hz"), help="Smallest deadband, Hz.")
]
Return = Annotated[
    float,
    Option(
        "--return-within",
        metavar="TIME",
        parser=options.in_unit("s"),
        help="Time in which the energy returns to its initial value, s; 0: no return.",
    ),
]
Rate = Annotated[int | None, Option("--rate", min=1, help="Frames per second (default: every step).")]
Delay = Annotated[
    float, Option("--delay", metavar="TIME", parser=options.in_unit("s"), help="Time from measurement to output, s.")
]
Training = Annotated[float, Option("--training", help="Share of the contingencies used for tuning.")]
Seed = Annotated[int, Option("--seed", min=0, help="Seed of this selection.")]
Out = Annotated[Path | None, Option("--out", help="Write the law to FILE.toml, for --controller.")]


SEARCH = groups.SearchOptions(observe="10s")


class LimitOptions(NamedTuple):
    """Limits of the law."""

    max_energy: Energy = None
    switchings: Switchings = 2
    max_coi: Coi = None
    final_voltage: Voltage = 0.0
    min_voltage: MinVoltage = 0.5
    min_deadband: Deadband = 0.02
    return_within: Return = 120.0

    def limits(self) -> "LawLimits":
        """The record of the limits."""
        from stabctl.design import LawLimits

        return LawLimits(*self)


def law(
    *,
    fault: OneFault = None,
    trip: options.TripAtClearing = None,
    contingencies: File = None,
    from_screen: Screened = None,
    storage: groups.StorageOptions,
    limits: LimitOptions,
    rate: Rate = None,
    delay: Delay = 0.0,
    training: Training = 0.5,
    seed: Seed = 1,
    search: groups.SearchOptions = SEARCH,
    stability: groups.StabilityOptions,
    workers: options.Workers = None,
    store: options.Store = None,
    scheduler: options.Scheduler = None,
    report: options.Report = None,
    out: Out = None,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Design the control law of storage devices for the longest clearing times."""
    from stabctl.design import law

    shared.file(out, ".toml")
    shared.folder(report)
    point = storage.initialize(case.load())
    faults = _faults(point, fault, trip, contingencies, from_screen)
    with shared.progress("measuring", None) as tell:
        found = law(
            point,
            faults,
            limits=limits.limits(),
            rate=rate,
            delay=delay,
            training=training,
            seed=seed,
            **search._asdict(),
            criterion=stability.criterion(point.case),
            workers=workers,
            store=store,
            scheduler=scheduler,
            progress=lambda count: tell(None, f"clearing time {count}"),
        )
    if as_json:
        shared.print_json(_record(found))
    else:
        _show(found)
    written = [found.save(out)] if out else []
    written += [found.report(report)] if report else []
    shared.written(written, as_json)


def _faults(
    point: "OperatingPoint", fault: str | None, trip: list[str] | None, file: Path | None, count: int | None
) -> "tuple[Contingency, ...]":
    """The contingencies of --fault, of the file, or of a screen."""
    from stabctl._util.errors import StudyError
    from stabctl._util.wording import listed
    from stabctl.design.law import spread
    from stabctl.io.contingencies import read_contingencies
    from stabctl.simulation.contingency import Contingency

    if (fault is not None) + (file is not None) + (count is not None) != 1:
        raise StudyError(
            "Give the contingencies with one of the options --contingencies FILE.toml, --from-screen 20 and --fault."
        )
    if fault is not None:
        return (Contingency(fault, trip=trip or ()),)
    if trip:
        raise StudyError("--trip applies only to --fault; leave it out with --contingencies or --from-screen.")
    if file is not None:
        every = read_contingencies(file, point.case)
        shared.warn(every.left_out, verbose=True)
        if others := [c.label for c in every if c.fault is None]:
            shared.warn([f"A law is designed for faults; left out without one: {listed(others)}."], verbose=True)
        return tuple(c for c in every if c.fault is not None)
    from stabctl.clearing import screen

    with shared.progress("screening", 1.0) as tell:
        found = screen(point, progress=lambda done, of: tell(done / of))
    return spread(found, count or 0)


def _show(found: "LawDesign") -> None:
    from rich.table import Table

    from stabctl.view.figures.storage_control import named

    heads = ("fault", "none", "paper's law", "designed", "gain", "kWh", "switchings", "COI, Hz", "machines")
    table = Table(*heads, title="Critical clearing times, cycles", title_justify="left")
    for c in found.contingencies:
        use, group = c.designed.duty, "+".join(map(str, c.group.machines)) if c.group else ""
        cycles = (f"{m.reach:g}" for m in (c.none, c.reference, c.designed))
        asked = f"{c.designed.energy_kwh:.1f}", str(use.switchings), f"{use.coi_hz:.3f}"
        table.add_row(named(c), *cycles, f"{c.gain:+g}", *asked, group)
    shared.console().print(table)
    shared.console().print(str(found))


def _record(found: "LawDesign") -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "case": found.case,
        "law": asdict(found.law),  # type: ignore[call-overload]
        "gain": found.gain._asdict(),
        "kept": found.kept,
        "no_limit_cycle": found.no_limit_cycle,
        "contingencies": found.df.to_dict("records"),
        "limits": asdict(found.limits),
        "tried": found.tried,
        "simulations": found.simulations,
        "wall_s": found.wall_s,
    }
