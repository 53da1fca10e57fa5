"""stabctl study: is a system secure, what limits it, and by how much."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from . import groups, options, shared
from .clearing import Contingencies, Subsystems, screened
from .live import source
from .parameters import Argument, Option
from .study_file import given

if TYPE_CHECKING:
    from stabctl.assessment import Study

INSECURE = 1  # exit code
SEARCH = groups.SearchOptions(limit=None)  # 60 cycles, or the clearing time if that is longer
Files = Annotated[
    list[Path],
    Argument("[X.dyr] [STUDY.toml]", "The DYR file of x.raw; options of this command, such as clear.", None, given),
]
Clear = Annotated[
    str,
    Option("--clear", metavar="TIME", parser=options.time, help="Clearing time that protection guarantees, s or 6cyc."),
]
Worst = Annotated[int, Option("--worst", min=0, help="Number of contingencies simulated, the worst first.")]
Faults = Annotated[
    str | None,
    Option("--faults", help="lines, buses, lines,buses (the default), or categories of NERC TPL-001 such as P1,P7."),
]
Monitored = Annotated[
    Path | None,
    Option("--monitored", metavar="FILE.mon", help="Voltage ranges of buses, of PSS/E, in normal operation."),
]
Remedies = Annotated[
    str,
    Option(
        "--remedies",
        help="What might help, if the system is not secure: stabilizers,storage,redispatch, all, or none.",
    ),
]
Prices = Annotated[Path | None, Option("--prices", help="FILE.toml with [prices], for the costs of --remedies.")]
Out = Annotated[Path | None, Option("--out", help="Write all tables to FILE.xlsx, or the contingencies to FILE.csv.")]


def study(
    *,
    clear: Clear = "6cyc",
    damping: options.Ratio = 0.05,
    faults: Faults = None,
    contingencies: Contingencies = None,
    subsystems: Subsystems = None,
    monitored: Monitored = None,
    worst: Worst = 10,
    by: options.Criteria = None,
    remedies: Remedies = "all",
    prices: Prices = None,
    search: groups.SearchOptions = SEARCH,
    control: options.Control = None,
    controller: options.Controllers = None,
    storage: groups.StorageOptions,
    law: groups.LawOptions,
    stability: groups.StabilityOptions,
    workers: options.Workers = None,
    store: options.Store = None,
    scheduler: options.Scheduler = None,
    out: Out = None,
    report: options.Report = None,
    case: groups.CaseOptions,
    files: Files,
    as_json: options.Json = False,
) -> int:
    """Study the stability of a system. The exit code is 1 if it is not secure."""
    from stabctl._util.errors import StudyError
    from stabctl.assessment import study

    if subsystems is not None and contingencies is None and monitored is None:
        raise StudyError("--subsystems applies only to --contingencies FILE.con and --monitored; leave it out.")
    is_con = contingencies is not None and (monitored is None or contingencies.suffix.lower() == ".con")
    of_con = subsystems if is_con else None
    chosen = screened(faults, contingencies, of_con, "lines, buses", case.verbose)
    shared.file(out, ".xlsx", ".csv")
    shared.folder(report)
    loaded, given = case.load(), source(case)
    point = storage.initialize(loaded)
    chosen_law, own = law.chosen(bool(point.case.storage), control, shared.controllers(controller))
    steering: Any = [*([chosen_law] if chosen_law else []), *own] or None
    pages: list[Path] = []

    def partly(found: "Study") -> None:
        devices = ".with_storage(...)" * (storage != groups.StorageOptions())
        made = f"{given.before}base = {given.python}{devices}.initialize()"
        pages.append(replace(found, how=found.how._replace(source=made)).report(report))

    with shared.progress("study", 1.0) as tell:
        found = study(
            point,
            clear,
            damping=damping,
            faults=chosen(loaded),
            monitored=monitored,
            subsystems=subsystems if monitored is not None else None,
            worst=worst,
            criteria=by,
            remedies=remedies,
            prices=prices,
            control=steering,
            criterion=stability.criterion(loaded),
            workers=workers,
            store=store,
            scheduler=scheduler,
            progress=tell,
            each=partly if report else None,
            **{name: value for name, value in search._asdict().items() if value is not None},
        )
    written = [found.save(out) if out else None, *pages[-1:]]
    _show(found, as_json)
    shared.written(written, as_json)
    return 0 if found.secure else INSECURE


def _show(found: "Study", as_json: bool) -> None:
    if as_json:
        from stabctl.model import conventions

        tables = {name: frame.astype(object).where(frame.notna(), None) for name, frame in found.tables().items()}
        record = {name: frame.to_dict("records") for name, frame in tables.items()}
        case = found.point.case
        head = {"case": case.name, "conventions": conventions.of(case), "secure": found.secure, "wall_s": found.wall_s}
        wanted = {"required_cycles": found.wanted.cycles, "required_damping": found.wanted.damping}
        left_out = list(found.screen.left_out) if found.screen else []
        shared.print_json(head | wanted | {"remarks": found.remarks(), "left_out": left_out} | record)
        return
    from rich.table import Table

    table = Table("fault at", "trip", "critical, cycles", "margin, cycles", "limited by", "contingency")
    table.columns[2].justify = table.columns[3].justify = "right"
    named = any(m.found.contingency.name for m in found.margins)
    if not named:
        table.columns.pop()
    for m in found.margins[: len(found.worst)]:
        p = m.found
        cells = p.fault, ", ".join(p.trip), p.cell, m.shown, p.limit
        table.add_row(*cells, *[p.contingency.name or ""] * named)
    if found.worst:
        shared.console().print(table)
    for sentence in found.remarks():
        shared.console().print(sentence)
