"""stabctl powerflow: the power flow of a case."""

import cmath
import math
from typing import Annotated, Any

import typer

from .grouped import grouped
from .groups import CaseOptions
from .options import Json
from .shared import console, print_json

MOST = 1000  # rows of a table on the screen

Branches = Annotated[bool, typer.Option("--branches", help="Also print the branch flows.")]


@grouped
def powerflow(
    *,
    branches: Branches = False,
    case: CaseOptions,
    as_json: Json = False,
) -> None:
    """Solve the power flow."""
    from stabctl.model import powerflow

    flow = powerflow.solve(case.load())
    c = flow.case
    made = dict.fromkeys((b.bus for b in c.buses), 0j)
    for m, S in zip(c.machines, flow.S, strict=True):
        made[m.bus] += complex(S) * c.base_mva
    rows = [
        {
            "bus": b.bus,
            "v_pu": abs(V),
            "angle_deg": math.degrees(cmath.phase(V)),
            "p_gen_mw": made[b.bus].real,
            "q_gen_mvar": made[b.bus].imag,
        }
        for b, V in zip(c.buses, flow.V.tolist(), strict=True)
    ]
    ends = [[complex(S) * c.base_mva for S in both] for both in flow.branch_power]
    lines = [
        {
            "from_bus": k.from_bus,
            "to_bus": k.to_bus,
            "p_from_mw": a.real,
            "q_from_mvar": a.imag,
            "p_to_mw": b.real,
            "q_to_mvar": b.imag,
        }
        for k, (a, b) in zip(c.branches, ends, strict=True)
    ]
    if as_json:
        print_json({"case": c.name, "converged": True, "iterations": flow.iterations, "buses": rows, "branches": lines})
        return
    from rich.table import Table

    table = Table("bus", "voltage, pu", "angle, deg", "P generated, MW", "Q generated, Mvar")
    for column in table.columns:
        column.justify = "right"
    for r in rows[:MOST]:
        power = (f"{r['p_gen_mw']:.2f}", f"{r['q_gen_mvar']:.2f}") if made[r["bus"]] else ("", "")
        table.add_row(str(r["bus"]), f"{r['v_pu']:.5f}", f"{r['angle_deg']:.3f}", *power)
    console().print(table)
    _rest(len(rows), "buses")
    if branches:
        _print_branches(lines)
    console().print(str(flow))


def _rest(count: int, what: str) -> None:
    """How many rows a table does not show."""
    if count > MOST:
        console().print(f"and {count - MOST} more {what}; --json prints all of them.")


def _print_branches(lines: list[dict[str, Any]]) -> None:
    from rich.table import Table

    heads = (
        "from",
        "to",
        "P at from end, MW",
        "Q at from end, Mvar",
        "P at to end, MW",
        "Q at to end, Mvar",
        "losses, MW",
    )
    table = Table(*heads)
    for column in table.columns:
        column.justify = "right"
    for line in lines[:MOST]:
        a, b, *powers = line.values()
        table.add_row(str(a), str(b), *(f"{p:.2f}" for p in powers), f"{line['p_from_mw'] + line['p_to_mw']:.2f}")
    console().print(table)
    _rest(len(lines), "branches")
    lost = sum(line["p_from_mw"] + line["p_to_mw"] for line in lines)
    console().print(f"branch losses: {lost:.1f} MW")
