"""Section 6.2, Case 2 (Figures 17 to 19): a fault at bus 83 of the reduced Western system, cleared by opening 83-33."""

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import numpy as np

import stabctl as st
from reproduction import paper
from reproduction.comparison import Comparison
from reproduction.study import Study, draw, present
from stabctl.view.figures import trajectory

FAULT = st.Contingency("83", clear=f"{paper.CASE_2_CYCLES}cyc", trip="83-33")
SHOWN = 1, 8, 13, 14, 16, 27, 34  # machines
ONE_MACHINE = (
    "The simulation ends when machine 14 loses synchronism, with machine 13 still in synchronism. In the paper both "
    "lose it."
)
BUSES = "The published data of this system have 122 buses."


def study(reports: Path) -> Study:
    """Six cycles without storage, and with devices of 5 % of the MVA of each machine."""
    base = st.load("wnaps").initialize()
    without = base.simulate(FAULT)
    stored = base.simulate(FAULT, storage="5%mva", control=st.BangBang())
    text = (
        f"Six cycles without storage: {without.outcome} With 5 % of the MVA of each machine at its high-voltage bus: "
        f"{stored.outcome}"
    )
    pictures = (
        draw(
            trajectory.compare({"without storage": without, "with 5 % storage": stored}, machines=SHOWN),
            reports / "wnaps.png",
            "Speeds of the machines",
            alt="Speed against time. Left: machine 14 accelerates away from the others. Right: all stay together.",
            of="17, 18",
        ),
        draw(
            trajectory.storage(stored, (13, 14)),
            reports / "wnaps_storage.png",
            "Power of the storage devices",
            alt="Device 13 absorbs once, briefly. Device 14 absorbs, injects, and absorbs again.",
            of="19",
        ),
    )
    comparisons = tuple(compare(without, stored))
    return Study("The reduced Western system", "6.2", (text, paper.ERRATA["6.2"]), comparisons, pictures=pictures)


def compare(without: st.Trajectory, stored: st.Trajectory) -> Iterator[Comparison]:
    """The size of the system, the outcomes, and what the devices do."""
    case = stored.point.case
    tables = case.machines, case.buses, case.branches, case.links, case.loads
    for (what, printed), table in zip(paper.CASE_2_SIZES.items(), tables, strict=True):
        yield printed.compare(len(table), BUSES if what == "buses" else "")
    yield paper.CASE_2_LOST.compare(str(without.outcome.machine), ONE_MACHINE)
    yield paper.CASE_2_HELD.compare("stable" if stored.outcome.stable else "unstable")
    powers = dict(zip((s.machine for s in case.storage), stored.storage.T, strict=True))
    yield paper.CASE_2_ACT.compare(" and ".join(str(machine) for machine, power in powers.items() if power.any()))
    for machine, printed in paper.CASE_2_ACTIONS.items():
        yield printed.compare(actions(powers[machine]))


def actions(power: np.ndarray) -> str:
    """What a device does, in order of time, without idling."""
    signs = [sign for sign, _ in groupby(np.sign(power)) if sign]
    return ", ".join("absorbs" if sign > 0 else "injects" for sign, _ in groupby(signs)) or "idles"


if __name__ == "__main__":
    present(study)
