"""stabctl cases: the packaged cases."""

from .options import Json
from .shared import console, print_json


def cases(as_json: Json = False) -> None:
    """List the packaged cases."""
    from stabctl import io

    found = [io.load(name) for name in io.packaged()]
    if as_json:
        rows = [
            {
                "name": c.name,
                "title": c.title,
                "machines": len(c.machines),
                "buses": len(c.buses),
                "branches": len(c.branches),
                "loads": len(c.loads),
                "links": len(c.links),
                "source": c.source,
            }
            for c in found
        ]
        print_json({"cases": rows})
        return
    from rich.table import Table

    table = Table("case", "machines", "buses", "branches", "loads", "HVDC", "description")
    table.columns[0].no_wrap = True
    for c in found:
        sizes = (len(part) for part in (c.machines, c.buses, c.branches, c.loads, c.links))
        table.add_row(c.name, *map(str, sizes), c.title)
    console().print(table)
