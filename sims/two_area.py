"""The paper's Case 1 (Figures 14, 15): a 21-cycle fault on a circuit 7-8 of the two-area system, with and without."""

from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from stabctl import equilibrium, fleet, read
from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang
from stabctl.report import clearing, trajectories
from stabctl.simulate.events import contingency
from stabctl.simulate.simulation import run

REPORTS = Path("reports")
CYCLES, PLACE = 21, 0.4
PLACES = (0.0, 0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.42, 0.45, 0.5)


def main() -> None:
    """Simulate, print the verdicts, draw."""
    REPORTS.mkdir(exist_ok=True)
    console = Console(highlight=False)
    case = read.load("two_area")
    points = {
        "without storage": (equilibrium.solve(case), None),
        "with 50 MW storage": (equilibrium.solve(case.with_storage(fleet.everywhere(case, "50MW"))), BangBang()),
    }
    fault = f"7-8@{PLACE}"
    events = contingency(fault, CYCLES / case.frequency_hz)
    runs = {name: run(point, events, control=law) for name, (point, law) in points.items()}

    table = Table(f"fault {fault}, {CYCLES} cycles", *runs)
    table.add_row("outcome", *(r.outcome.kind.value.replace("_", " ") for r in runs.values()))
    table.add_row("", *(r.outcome.message for r in runs.values()))
    table.add_row("largest change of angle", *(f"{r.max_angle_from_coi_deg:.0f} degrees" for r in runs.values()))
    found = [clearing_time(point, fault, control=law) for point, law in points.values()]
    table.add_row("critical clearing time", *(f"{f.cycles:g} cycles" for f in found))
    at_bus = [clearing_time(point, "7", ["7-8"], law) for point, law in points.values()]
    table.add_row("the same, fault at bus 7", *(f"{f.cycles:g} cycles" for f in at_bus))
    console.print(table)

    with_storage = runs["with 50 MW storage"]
    first = [with_storage.storage[np.flatnonzero(np.abs(p) > 1)[0], j] for j, p in enumerate(with_storage.storage.T)]
    action = {True: "absorbs", False: "injects"}
    names = zip(with_storage.devices(), first, strict=True)
    console.print("First action of the devices:", ", ".join(f"{name} {action[bool(p > 0)]}" for name, p in names))

    curves = {
        name: [clearing_time(point, f"7-8@{place}", control=law).cycles for place in PLACES]
        for name, (point, law) in points.items()
    }
    lost, held = (np.interp(CYCLES, curve, PLACES) for curve in curves.values())
    console.print(
        f"{CYCLES} cycles are lost without and survived with storage for faults from {held:.2f} to {lost:.2f} along 7-8"
    )
    figures = {
        "two_area.png": trajectories.speeds(runs),
        "two_area_storage.png": trajectories.storage(with_storage),
        "two_area_place.png": clearing.against_place(PLACES, curves, CYCLES, (held, lost), "7-8"),
    }
    for name, figure in figures.items():
        figure.savefig(REPORTS / name, dpi=130)
        console.print(f"wrote {REPORTS / name}")


if __name__ == "__main__":
    main()
