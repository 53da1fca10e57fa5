"""stabctl tables: the columns of a case's tables."""

from pathlib import Path
from typing import Annotated

import typer

from .options import Device, Json
from .shared import console, print_json

Name = Annotated[
    str | None,
    typer.Argument(metavar="[TABLE|CASE]", help="Only this table, such as buses or genrou, or those of a case."),
]


def tables(name: Name = None, device: Device = None, as_json: Json = False) -> None:
    """List the columns of a case's tables with their meaning, allowed values and default."""
    from stabctl import io
    from stabctl.errors import StudyError
    from stabctl.model import catalog
    from stabctl.model.tables import TABLES
    from stabctl.schema import fields

    known = {table: list(fields(record).values()) for table, record in TABLES.items()}
    known |= {model: list(catalog.columns(model).values()) for model in catalog.models()}
    if name is None or name in known:
        shown = known if name is None else {name: known[name]}
    elif name in io.packaged() or Path(name).is_dir() or Path(name).suffix.lower() in (".m", ".raw"):
        case = io.load(name)
        shown = {table: rows for table, rows in known.items() if table in case.devices or getattr(case, table, None)}
    else:
        raise StudyError(f"There is no table or case {name!r}; the tables are {', '.join(known)}.")
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
        print_json({"tables": rows})
        return
    from rich.table import Table

    for table, columns in shown.items():
        out = Table("column", "meaning", "allowed", "default", title=f"{table}.csv", title_justify="left")
        out.columns[0].no_wrap = True
        for f in columns:
            out.add_row(f.column, f.meaning, f.expected(), "required" if f.required else str(f.default))
        console().print(out)
