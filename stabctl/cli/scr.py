"""stabctl scr: short-circuit power and short-circuit ratios."""

from typing import Annotated

import typer

from .grouped import grouped
from .groups import CaseOptions
from .options import Json
from .shared import console, print_json

Trip = Annotated[str | None, typer.Option("--trip", help="Circuits out of service, such as 7-8 or '7-8#2, 8-9'.")]


@grouped
def scr(
    *,
    trip: Trip = None,
    case: CaseOptions,
    as_json: Json = False,
) -> None:
    """Compute the short-circuit power of every bus, and the short-circuit ratios of converters."""
    from stabctl.model.short_circuit import short_circuit
    from stabctl.model.short_circuit_ratio import installed, short_circuit_ratio

    loaded = case.load()
    power = short_circuit(loaded, trip=trip)
    ratio = short_circuit_ratio(loaded, trip=trip) if installed(loaded) else None
    buses = [{"bus": b.bus, "short_circuit_mva": float(S)} for b, S in zip(loaded.buses, power.mva, strict=True)]
    rows = ratio.df.to_dict("records") if ratio else []
    if as_json:
        print_json({"case": loaded.name, "wscr": ratio.weighted if ratio else None, "converters": rows, "buses": buses})
        return
    from rich.table import Table

    table = Table("bus", "short-circuit power, MVA")
    for column in table.columns:
        column.justify = "right"
    for b in buses:
        table.add_row(str(b["bus"]), f"{b['short_circuit_mva']:.1f}")
    console().print(table)
    if rows:
        table = Table("converter", "bus", "rating, MVA", "short-circuit power, MVA", "SCR", "ESCR")
        for column in table.columns[1:]:
            column.justify = "right"
        for r in rows:
            numbers = (f"{r['rated_mva']:.1f}", f"{r['short_circuit_mva']:.1f}", f"{r['scr']:.2f}", f"{r['escr']:.2f}")
            table.add_row(r["converter"], str(r["bus"]), *numbers)
        console().print(table)
    console().print(str(power))
    if ratio:
        console().print(str(ratio))
