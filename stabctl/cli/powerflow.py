"""stabctl powerflow: the load flow of a case."""

import cmath
import math

from .shared import CaseName, Classical, Json, console, load, print_json


def powerflow(case: CaseName, classical: Classical = False, as_json: Json = False) -> None:
    """Solve the load flow."""
    from stabctl import powerflow

    flow = powerflow.solve(load(case, classical))
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
    if as_json:
        print_json({"converged": True, "iterations": flow.iterations, "buses": rows})
        return
    from rich.table import Table

    table = Table("bus", "voltage, pu", "angle, deg", "P made, MW", "Q made, Mvar")
    for column in table.columns:
        column.justify = "right"
    for r in rows:
        power = (f"{r['p_gen_mw']:.2f}", f"{r['q_gen_mvar']:.2f}") if made[r["bus"]] else ("", "")
        table.add_row(str(r["bus"]), f"{r['v_pu']:.5f}", f"{r['angle_deg']:.3f}", *power)
    console().print(table)
    console().print(str(flow))
