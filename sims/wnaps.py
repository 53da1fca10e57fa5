"""The paper's Case 2 (Figures 17 to 19): fault at bus 83 of the reduced Western system, line 83-33 opened."""

from itertools import groupby
from pathlib import Path

import numpy as np

from reproduction import paper
from reproduction.console import present
from reproduction.study import Study, draw
from stabctl import io
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.model import fleet
from stabctl.plotting import trajectory
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run

FAULT, TRIP = "83", ("83-33",)
SHOWN = (1, 8, 13, 14, 16, 27, 34)
SPEEDS = "Left machine 14 runs away from the others; right, with storage, all swing and stay together."
POWERS = "Device 13 absorbs once, briefly; device 14 absorbs, injects, and absorbs again."
LOST = "Machine 14 goes first and ends the run, with machine 13 still in step; the paper has both lose synchronism."
BUSES = "The published data of this system have 122 buses."


def study(reports: Path) -> Study:
    """Six cycles without devices and with devices of 5 % of the machines' ratings."""
    case = io.load("wnaps")
    events = Contingency(FAULT, paper.CASE_2_CYCLES / case.frequency_hz, TRIP)
    bare = run(operating_point.solve(case), events)
    held = run(operating_point.solve(case.with_storage(fleet.everywhere(case, "5%mva"))), events, control=BangBang())
    powers = dict(zip((s.machine for s in held.point.case.storage), held.storage.T, strict=True))
    acting = " and ".join(str(machine) for machine, p in powers.items() if np.abs(p).max() > 0)
    counted = {
        "machines": case.machines,
        "buses": case.buses,
        "branches": case.branches,
        "HVDC links": case.links,
        "loads": case.loads,
    }
    rows = (
        *(printed.compare(len(counted[k]), BUSES if k == "buses" else "") for k, printed in paper.CASE_2_SIZES.items()),
        paper.CASE_2_LOST.compare(str(bare.outcome.machine), LOST),
        paper.CASE_2_HELD.compare("stable" if held.outcome.stable else "unstable"),
        paper.CASE_2_ACT.compare(acting),
        *(printed.compare(actions(powers[machine])) for machine, printed in paper.CASE_2_ACTIONS.items()),
    )
    runs = {"without storage": bare, "with 5 % ESDs": held}
    figures = (
        draw(
            trajectory.compare(runs, machines=SHOWN),
            reports / "wnaps.png",
            "Speeds of machines",
            alt=SPEEDS,
            of="17, 18",
        ),
        draw(
            trajectory.storage(held, (13, 14)), reports / "wnaps_storage.png", "Power of devices", alt=POWERS, of="19"
        ),
    )
    text = (
        f"Six cycles without storage: {bare.outcome} With 5 % of each machine's MVA at its high-voltage bus: "
        f"{held.outcome}",
        paper.ERRATA["6.2"],
    )
    return Study("The reduced Western system", "6.2", text, rows, pictures=figures)


def actions(power: np.ndarray) -> str:
    """What a device does in the order of time, idling left out."""
    signs = [sign for sign, _ in groupby(np.sign(power)) if sign]
    return ", ".join("absorbs" if sign > 0 else "injects" for sign, _ in groupby(signs)) or "idles"


if __name__ == "__main__":
    present(study)
