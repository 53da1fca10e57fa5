"""stabctl powerflow and scr: the power flow of a case, short-circuit power and ratios."""

import cmath
import math
from typing import TYPE_CHECKING, Annotated, Any

from .groups import CaseOptions
from .options import Json, Report
from .parameters import Option
from .shared import console, folder, print_json, written

if TYPE_CHECKING:
    from rich.console import Console

MOST = 1000  # rows of a table on the screen
Branches = Annotated[bool, Option("--branches", help="Also print the branch flows.")]
Trip = Annotated[str | None, Option("--trip", help="Circuits out of service, such as 7-8 or '7-8#2, 8-9'.")]


def powerflow(*, branches: Branches = False, report: Report = None, case: CaseOptions, as_json: Json = False) -> None:
    """Solve the power flow."""
    from stabctl.model import naming, powerflow

    folder(report)
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
            "circuit": name,
            "p_from_mw": a.real,
            "q_from_mvar": a.imag,
            "p_to_mw": b.real,
            "q_to_mvar": b.imag,
        }
        for name, k, (a, b) in zip(naming.keys(c, "branches"), c.branches, ends, strict=True)
    ]
    page = flow.report(report) if report else None
    if as_json:
        print_json({"case": c.name, "converged": True, "iterations": flow.iterations, "buses": rows, "branches": lines})
        return
    from rich.table import Table

    out = console()
    table = Table("bus", "voltage, pu", "angle, deg", "P generated, MW", "Q generated, Mvar")
    for column in table.columns:
        column.justify = "right"
    for r, b in zip(rows[: _most(out)], c.buses, strict=False):
        power = (f"{r['p_gen_mw']:.2f}", f"{r['q_gen_mvar']:.2f}") if made[r["bus"]] else ("", "")
        table.add_row(naming.told(b), f"{r['v_pu']:.5f}", f"{r['angle_deg']:.3f}", *power)
    out.print(table)
    _rest(out, len(rows), "buses")
    if branches:
        _print_branches(out, lines)
    out.print(str(flow))
    written([page])


def _print_branches(out: "Console", lines: list[dict[str, Any]]) -> None:
    from rich.table import Table

    powers = (f"{power} at {end} end, {unit}" for end in ("from", "to") for power, unit in (("P", "MW"), ("Q", "Mvar")))
    table = Table("from", "to", "circuit", *powers, "losses, MW")
    for column in table.columns:
        column.justify = "right"
    for line in lines[: _most(out)]:
        ends, values = [*line.values()][:3], [*line.values()][3:]
        table.add_row(*map(str, ends), *(f"{x:.2f}" for x in (*values, line["p_from_mw"] + line["p_to_mw"])))
    out.print(table)
    _rest(out, len(lines), "branches")
    lost = sum(line["p_from_mw"] + line["p_to_mw"] for line in lines)
    out.print(f"branch losses: {lost:.1f} MW")


def _most(out: "Console") -> int | None:
    """How many rows a table shows; all of them where it is not read on a terminal."""
    return MOST if out.is_terminal else None


def _rest(out: "Console", count: int, what: str) -> None:
    """How many rows a table does not show."""
    if out.is_terminal and count > MOST:
        out.print(f"and {count - MOST} more {what}; in a pipe, and with --json, all of them are printed.")


def scr(*, trip: Trip = None, report: Report = None, case: CaseOptions, as_json: Json = False) -> None:
    """Compute the short-circuit power of every bus, and the short-circuit ratios of converters."""
    from stabctl.model.short_circuit import installed, short_circuit, short_circuit_ratio

    folder(report)
    loaded = case.load()
    power = short_circuit(loaded, trip=trip)
    ratio = short_circuit_ratio(loaded, trip=trip) if installed(loaded) else None
    buses = [{"bus": b.bus, "short_circuit_mva": float(S)} for b, S in zip(loaded.buses, power.mva, strict=True)]
    rows = ratio.df.to_dict("records") if ratio else []
    page = power.report(report) if report else None
    if as_json:
        print_json({"case": loaded.name, "wscr": ratio.weighted if ratio else None, "converters": rows, "buses": buses})
        return
    from rich.table import Table

    out = console()
    table = Table("bus", "short-circuit power, MVA")
    for column in table.columns:
        column.justify = "right"
    for b in buses:
        table.add_row(str(b["bus"]), f"{b['short_circuit_mva']:.1f}")
    out.print(table)
    if rows:
        table = Table("converter", "bus", "rating, MVA", "short-circuit power, MVA", "SCR", "ESCR")
        for column in table.columns[1:]:
            column.justify = "right"
        for r in rows:
            numbers = (f"{r['rated_mva']:.1f}", f"{r['short_circuit_mva']:.1f}", f"{r['scr']:.2f}", f"{r['escr']:.2f}")
            table.add_row(r["converter"], str(r["bus"]), *numbers)
        out.print(table)
    out.print(str(power))
    if ratio:
        out.print(str(ratio))
    written([page])
