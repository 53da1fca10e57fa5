"""stabctl cases, tables, models, import, check: cases, columns, parameters, what a file holds, unusual data."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from . import options, shared
from .groups import CaseOptions
from .parameters import Argument, Option

if TYPE_CHECKING:
    from stabctl.devices.describe import Description

TableName = Annotated[
    str | None,
    Argument(metavar="[TABLE|CASE]", help="Only this table, such as buses or genrou, or those of a case."),
]
ModelName = Annotated[str | None, Argument(metavar="[NAME]", help="Only this model, in full, such as genrou.")]
Raw = Annotated[str, Argument(metavar="X.raw", help="PSS/E RAW file, version 30 to 35; MATPOWER or PST file x.m.")]
DyrFile = Annotated[
    Path | None,
    Argument(metavar="X.dyr", help="DYR file (default: the one with the same name in the same folder)."),
]
Csv = Annotated[bool, Option("--csv", help="Print the header of the table's CSV file and nothing else.")]
Out = Annotated[Path | None, Option("--out", help="Write the case to a folder, which every command accepts.")]
Check = Annotated[bool, Option("--check/--no-check", help="Compare with the stored voltages, start, and simulate 2 s.")]
INCOMPLETE = 1  # exit code


def cases(as_json: options.Json = False) -> None:
    """List the packaged cases."""
    from stabctl import io

    found = [io.load(name) for name in io.packaged()]
    sizes = [
        {part: len(getattr(c, part)) for part in ("machines", "buses", "branches", "loads", "links")} for c in found
    ]
    if as_json:
        both = zip(found, sizes, strict=True)
        shared.print_json({"cases": [{"name": c.name, "title": c.title, **n, "source": c.source} for c, n in both]})
        return
    from rich.table import Table

    table = Table("case", "machines", "buses", "branches", "loads", "HVDC", "description")
    table.columns[0].no_wrap = True
    for c, size in zip(found, sizes, strict=True):
        table.add_row(c.name, *map(str, size.values()), c.title)
    shared.console().print(table)


def tables(
    name: TableName = None, device: options.Device = None, csv: Csv = False, as_json: options.Json = False
) -> None:
    """List the columns of a case's tables with their meaning, allowed values and default."""
    from stabctl import io
    from stabctl._util.errors import StudyError
    from stabctl._util.schema import fields
    from stabctl._util.wording import near
    from stabctl.model.tables import TABLES, device_columns, models

    known = {table: list(fields(record).values()) for table, record in TABLES.items()}
    known |= {model: list(device_columns(model).values()) for model in models()}
    if name is None or name in known:
        shown = known if name is None else {name: known[name]}
    elif name in io.packaged() or Path(name).is_dir() or Path(name).suffix.lower() in (".m", ".raw"):
        case = io.load(name)
        shown = {table: rows for table, rows in known.items() if table in case.devices or getattr(case, table, None)}
    else:
        raise StudyError(f"There is no table or case {name!r}; {near(name, known, 'the tables are')}")
    if csv:
        if name not in known:
            raise StudyError("--csv prints the header of one table; name it, such as stabctl tables genrou --csv.")
        print(",".join(f.column for f in known[name]))
        return
    if as_json:
        rows = {
            table: [
                {
                    "column": f.column,
                    "meaning": f.meaning,
                    "allowed": f.expected(),
                    "default": None if f.required else f.default,
                }
                for f in columns
            ]
            for table, columns in shown.items()
        }
        shared.print_json({"tables": rows})
        return
    from rich.table import Table

    for table, columns in shown.items():
        out = Table("column", "meaning", "allowed", "default", title=f"{table}.csv", title_justify="left")
        out.columns[0].no_wrap = True
        for f in columns:
            out.add_row(f.column, f.meaning, f.expected(), "required" if f.required else str(f.default))
        shared.console().print(out)


def models(name: ModelName = None, device: options.Device = None, as_json: options.Json = False) -> None:
    """List the device models by role, or the parameters, states, inputs, outputs and limits of one model."""
    from stabctl import devices
    from stabctl.devices.describe import describe

    if name is None:
        _listed([describe(one) for one in devices.every()], as_json)
        return
    found = describe(name)
    if as_json:
        parts = ("parameters", "states", "inputs", "outputs", "limits")
        rows = {part: [row._asdict() for row in getattr(found, part)] for part in parts}
        for row in (*rows["states"], *rows["inputs"], *rows["outputs"]):
            reads = row.pop("from_")
            row |= {"reads": reads} if reads else {}
        shared.print_json({"model": {**found._asdict(), **rows}})
        return
    _shown(found)


def importing(
    raw: Raw,
    dyr_file: DyrFile = None,
    *,
    out: Out = None,
    page: options.Report = None,
    check: Check = True,
    dyr: options.Dyr = None,
    loads: options.Loads = None,
    missing: options.Missing = "refuse",
    missing_controls: options.MissingControls = "refuse",
    frequency: options.Frequency = None,
    conventions: options.Conventions = None,
    as_json: options.Json = False,
) -> int:
    """Import a PSS/E, PST or MATPOWER system and report what is represented; exit code 0: all of it, and it starts."""
    from stabctl._util.errors import StudyError
    from stabctl.io.import_report import import_report

    if dyr_file is not None and dyr is not None:
        raise StudyError("The DYR file is given twice, with and without --dyr; give it once.")
    if out is None and (missing, missing_controls) != ("refuse", "refuse"):
        raise StudyError("--missing and --missing-controls change the case that is written; give --out too.")
    shared.folder(out)
    shared.folder(page)
    if out is not None and Path(raw).suffix.lower() == ".m" and (missing, missing_controls) != ("refuse", "refuse"):
        raise StudyError("--missing and --missing-controls belong to a PSS/E file ending in .raw; leave them out.")
    how: dict[str, Any] = {"loads": loads, "frequency": frequency, "conventions": conventions}
    report = import_report(raw, dyr_file or dyr, check=check, **how)
    if as_json:
        shared.print_json(report.plain())
        shared.warn(report.failures, verbose=True)
    else:
        print(report)
    written = [report.report(page)] if page is not None else []
    if out is not None:
        from stabctl import io

        dyr_path = report.files[1] if len(report.files) > 1 else None
        case = io.load(raw, dyr=dyr_path, missing=missing, missing_controls=missing_controls, **how)
        written.append(io.write(case, out))
    shared.written(written, as_json)
    return 0 if report.complete and report.starts else INCOMPLETE


def check(*, case: CaseOptions, as_json: options.Json = False) -> None:
    """List unusual data: values that may be in another unit or on another base."""
    found = case.check(case.read())
    if as_json:
        shared.print_json(found.plain())
    else:
        print(found)


def _listed(found: "list[Description]", as_json: bool) -> None:
    if as_json:
        shared.print_json(
            {"models": [{"name": m.name, "role": m.role, "title": m.title, "unverified": m.unverified} for m in found]}
        )
        return
    from rich.table import Table

    table = Table("role", "model", "description")
    table.columns[1].no_wrap = True
    last = ""
    for m in found:
        table.add_row(m.role if m.role != last else "", m.name, m.title + f" ({m.unverified})" * bool(m.unverified))
        last = m.role
    shared.console().print(table)


def _shown(found: "Description") -> None:
    from rich.table import Table

    console = shared.console()
    if found.unverified:
        print(f"This model is {found.unverified}.\n")
    print(f"{found.title}\n\n{found.text}\n\nRole: {found.role}, {found.role_meaning}.\n")
    if found.parameters:
        table = Table("parameter", "unit", "meaning", "allowed", "default", title="Parameters", title_justify="left")
        for p in found.parameters:
            default = "required" if p.default is None else str(p.default)
            table.add_row(p.name, p.unit, p.meaning, p.allowed, default if p.allowed else "from the case")
        console.print(table)
    for title, signals in (("States", found.states), ("Inputs", found.inputs), ("Outputs", found.outputs)):
        if signals:
            columns = ("name", "unit", "meaning", *(("reads",) if title == "Inputs" else ()))
            table = Table(*columns, title=title, title_justify="left")
            for s in signals:
                table.add_row(*s[: len(columns)])
            console.print(table)
    for limit in found.limits:
        print(f"The state {limit.state} has the non-windup limits {limit.low} and {limit.high}.")
