"""stabctl clearing-time and screen: how long a fault may last, and the most critical line faults."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from . import groups, options, shared
from .parameters import Option

if TYPE_CHECKING:
    from stabctl.clearing import ClearingTime, Screen
    from stabctl.model.case import Case
    from stabctl.simulation.contingency import Contingency


AFTER = "times count from the fault. Repeatable."
Open = Annotated[list[str] | None, Option("--open", help=f"Another line trip: 7-8@0.5s; {AFTER}")]
TripMachine = Annotated[list[str] | None, Option("--trip-machine", help=f"Machine trip: 14@0.1s; {AFTER}")]
LoadStep = Annotated[list[str] | None, Option("--load-step", help=f"Load step: 7:+50MW@0.1s; {AFTER}")]


def clearing_time(
    *,
    fault: options.Fault,
    trip: options.TripAtClearing = None,
    at: options.At = options.BEGINS,
    opened: Open = None,
    tripped: TripMachine = None,
    stepped: LoadStep = None,
    search: groups.SearchOptions,
    control: options.Control = None,
    controller: options.Controllers = None,
    storage: groups.StorageOptions,
    law: groups.LawOptions,
    fault_impedance: options.FaultImpedance = "0,0",
    stability: groups.StabilityOptions,
    estimator: options.Estimator = "ideal",
    pmu: groups.PmuOptions,
    by: options.Criteria = None,
    report: options.Report = None,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Find the critical clearing time of a fault."""
    from stabctl._util.errors import StudyError
    from stabctl._util.units import seconds
    from stabctl.clearing import clearing_time
    from stabctl.simulation.contingency import Contingency
    from stabctl.simulation.control import acting

    shared.folder(report)
    criteria = shared.criteria(by)
    loaded = case.load()
    begins = seconds(at, loaded.frequency_hz)
    events = [replace(one, at=one.at + begins) for one in shared.events(loaded, opened, tripped, stepped)]
    through = shared.impedance(fault_impedance)
    point = storage.initialize(loaded)
    steering = pmu.steering(*law.chosen(bool(point.case.storage), control, shared.controllers(controller)), estimator)
    if at != options.BEGINS and not acting(steering).timed:
        raise StudyError("--at needs a control with instants of its own, such as a gate with a start; leave it out.")
    with shared.progress("searching", None) as tell:
        found = clearing_time(
            point,
            Contingency(fault, trip=trip or (), at=at, impedance=through, events=events),
            control=steering,
            **search._asdict(),
            criterion=stability.criterion(loaded),
            criteria=criteria,
            progress=lambda _run: tell(None),
        )
    _show_clearing_time(found, as_json)
    shared.written([found.report(report)] if report else [], as_json)


def _show_clearing_time(found: "ClearingTime", as_json: bool) -> None:
    if as_json:
        runs = [
            {
                "cycles": r.cycles,
                "stable": r.stable,
                "outcome": r.outcome.value,
                "machine": r.machine,
                "time_s": r.time_s,
                "growing": None if r.swings is None else r.swings.growing,
                "decaying": None if r.swings is None else r.swings.decaying,
                "stalled": r.stalled,
                "violated": r.violated and r.violated._asdict(),
                "undecided": r.undecided,
                "cut_off": r.cut_off,
            }
            for r in found.runs
        ]
        shared.print_json(
            {
                "case": found.case,
                "cycles": found.cycles,
                "seconds": found.seconds,
                "status": found.status,
                "machine": found.machine,
                "limited_by": found.limited_by,
                "monotone": found.monotone,
                "lowest_unstable_cycles": found.lowest_unstable,
                "stable_above_cycles": found.stable_above,
                "observed_s": found.search.observed_s,
                "longest_observed_s": found.observed_s,
                "resolution_cycles": found.search.resolution_cycles,
                "runs": runs,
                "wall_s": found.wall_s,
            }
        )
        return
    from rich.table import Table

    table = Table("clearing time, cycles", "runs", "outcome", "loses synchronism first", "end, s after the fault")
    for row in found.grouped():
        table.add_row(*row)
    shared.console().print(table)
    shared.console().print(str(found))


Below = Annotated[
    str | None,
    Option(
        "--below", metavar="TIME", parser=options.time, help="List only pairs with shorter clearing times, s or 8cyc."
    ),
]
Out = Annotated[Path | None, Option("--out", help="Write the pairs to FILE.csv.")]
Faults = Annotated[
    str | None,
    Option(
        "--faults",
        help="lines (both ends of each, cleared by opening it: the default), buses, categories of NERC TPL-001 such as "
        "P1, or several: lines,P7.",
    ),
]
Contingencies = Annotated[
    Path | None, Option("--contingencies", metavar="FILE", help="Contingencies of a .toml or PSS/E .con file, instead.")
]
Subsystems = Annotated[
    Path | None, Option("--subsystems", metavar="FILE.sub", help="Subsystems of PSS/E that the other file names.")
]


def screened(
    faults: str | None, file: Path | None, subsystems: Path | None, usual: str, verbose: bool
) -> "Callable[[Case], Any]":
    """What --faults, --contingencies or neither mean for a case; raises `StudyError` at once if both are given."""
    from stabctl._util.errors import StudyError
    from stabctl.io.contingencies import read_contingencies

    if file is None:
        return lambda _: faults or usual
    if faults is not None:
        raise StudyError("--faults and --contingencies cannot be used together; give one of them.")

    def read(case: "Case") -> "tuple[Contingency, ...]":
        found = read_contingencies(file, case, subsystems)
        shared.warn(found.left_out, verbose)
        return found

    return read


def screen(
    *,
    below: Below = None,
    faults: Faults = None,
    contingencies: Contingencies = None,
    subsystems: Subsystems = None,
    search: groups.SearchOptions,
    control: options.Control = None,
    controller: options.Controllers = None,
    storage: groups.StorageOptions,
    law: groups.LawOptions,
    stability: groups.StabilityOptions,
    estimator: options.Estimator = "ideal",
    pmu: groups.PmuOptions,
    workers: options.Workers = None,
    store: options.Store = None,
    scheduler: options.Scheduler = None,
    by: options.Criteria = None,
    out: Out = None,
    report: options.Report = None,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Find the critical clearing times of faults at both ends of every line, cleared by opening it; shortest first."""
    from stabctl._util.errors import StudyError
    from stabctl.clearing import screen

    if subsystems is not None and contingencies is None:
        raise StudyError("--subsystems applies only to --contingencies FILE.con; leave it out.")
    chosen = screened(faults, contingencies, subsystems, "lines", case.verbose)
    shared.file(out, ".csv")
    shared.folder(report)
    criteria = shared.criteria(by)
    loaded = case.load()
    point = storage.initialize(loaded)
    steering = pmu.steering(*law.chosen(bool(point.case.storage), control, shared.controllers(controller)), estimator)
    with shared.progress("screening", 1.0) as tell:
        found = screen(
            point,
            below,
            faults=chosen(loaded),
            control=steering,
            **search._asdict(),
            criterion=stability.criterion(loaded),
            criteria=criteria,
            workers=workers,
            store=store,
            scheduler=scheduler,
            progress=lambda done, total: tell(done / total),
        )
    _show_screen(found, as_json)
    if out:
        found.save(out)
    shared.written([out, found.report(report, base=point) if report else None], as_json)


def _show_screen(found: "Screen", as_json: bool) -> None:
    if as_json:
        shared.print_json(
            {
                "case": found.case,
                "pairs": [dict(zip(found.columns, row, strict=True)) for row in found.rows()],
                "bridges": list(map(str, found.lines.bridges)),
                "twins": list(map(str, found.lines.twins)),
                "left_out": list(found.left_out),
                "screened": found.screened,
                "simulations": found.simulations,
                "wall_s": found.wall_s,
                "observed_s": found.search.observed_s,
                "longest_observed_s": found.observed_s,
                "resolution_cycles": found.search.resolution_cycles,
                "limit_cycles": found.search.limit_cycles,
            }
        )
        return
    from rich.table import Table

    table = Table("fault at", "trip", "critical clearing time, cycles", "limited by")
    named = any(p.contingency.name for p in found.pairs)
    if named:
        table.add_column("contingency")
    for p in found.pairs:
        table.add_row(p.fault, ", ".join(p.trip), p.cell, p.limit, *[p.contingency.name or ""] * named)
    if found.pairs:
        shared.console().print(table)
    for sentence in found.remarks():
        shared.console().print(sentence)
