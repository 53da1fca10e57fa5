"""The paper's Case 1 (Figures 14, 15): a 21-cycle fault on a circuit 7-8 of the two-area system, with and without."""

from pathlib import Path

import numpy as np

from reproduction import paper
from reproduction.console import present
from reproduction.study import Study, Table, draw
from stabctl import io
from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.model import fleet
from stabctl.plotting import clearing_time as drawing
from stabctl.plotting import trajectory
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run

LINE, PLACE = "7-8", 0.4
PLACES = (0.0, 0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.42, 0.45, 0.5)
SIZE = "Of the machines' 900 MVA 50 MW are 5.6 %."
HEADS = "", "outcome", "largest change of angle", "critical clearing, cycles", "the same, fault at bus 7"
ACTION = {True: "absorbs", False: "injects"}


def study(reports: Path) -> Study:
    """The two runs, what the devices do first, and the clearing time against the place of the fault."""
    case, cycles = io.load("two_area"), paper.CASE_1_CYCLES
    devices = fleet.everywhere(case, "50MW")
    points = {
        "without storage": (operating_point.solve(case), None),
        "with 50 MW storage": (operating_point.solve(case.with_storage(devices)), BangBang()),
    }
    fault = f"{LINE}@{PLACE}"
    runs = {
        name: run(p, Contingency(fault, cycles / case.frequency_hz), control=law) for name, (p, law) in points.items()
    }
    at_bus = [clearing_time(p, Contingency("7", trip=LINE), control=law).cycles for p, law in points.values()]
    curves = {
        name: [clearing_time(p, f"{LINE}@{x}", control=law).cycles for x in PLACES] for name, (p, law) in points.items()
    }
    lost, held = (float(np.interp(cycles, curve, PLACES)) for curve in curves.values())
    verdicts = tuple(
        (
            name,
            r.outcome.message,
            f"{r.max_angle_from_coi_deg:.0f} degrees",
            f"{curve[PLACES.index(PLACE)]:g}",
            f"{bus:g}",
        )
        for (name, r), curve, bus in zip(runs.items(), curves.values(), at_bus, strict=True)
    )
    bare, kept = runs.values()
    first = [p[np.flatnonzero(np.abs(p) > 1)[0]] > 0 for p in kept.storage.T]
    rows = (
        paper.CASE_1_SIZE.compare(100 * devices[0].rating / case.machines[0].base, SIZE),
        paper.CASE_1_OUTCOMES["without"].compare("stable" if bare.outcome.stable else "unstable"),
        paper.CASE_1_OUTCOMES["with"].compare("stable" if kept.outcome.stable else "unstable"),
        *(p.compare(ACTION[bool(f)]) for p, f in zip(paper.CASE_1_FIRST.values(), first, strict=True)),
    )
    text = (
        f"The paper does not say where along the circuit the fault is; ours is {PLACE:g} of the way from bus 7. There "
        f"{cycles} cycles are lost without and survived with storage, as for all places from {held:.2f} to {lost:.2f}; "
        f"at bus 7 itself {at_bus[0]:g} and {at_bus[1]:g} cycles are the longest that are survived."
    )
    speeds = "Speeds in time; left the two areas part at 3 s, right all four machines settle together."
    powers = "Devices 1 and 2 first absorb and then inject full power, 3 and 4 the other way round; then all rest."
    along = "Both clearing times grow with the distance from bus 7, storage adding a third."
    swept = drawing.compare(PLACES, curves, xlabel=f"location of the fault on {LINE} (fraction from bus 7)")
    swept.axhline(cycles, color="0.35", linestyle="--", linewidth=1)
    label = f"{cycles} cycles: unstable without,\nstable with storage ({held:.2f} to {lost:.2f})"
    swept.axvspan(held, lost, color="#e69f00", alpha=0.25, label=label)
    swept.legend(frameon=False)
    figures = (
        draw(trajectory.compare(runs), reports / "two_area.png", "Speeds of the machines", alt=speeds, of="14"),
        draw(trajectory.storage(kept), reports / "two_area_storage.png", "Power of the devices", alt=powers, of="15"),
        draw(swept, reports / "two_area_place.png", "Clearing time against fault location", alt=along),
    )
    tables = (Table(f"Fault on {fault}, {cycles} cycles", HEADS, verdicts),)
    return Study("Four machines", "6.1", (text,), rows, tables, figures)


if __name__ == "__main__":
    present(study)
