"""Where storage belongs on the reduced Western system: eight contingencies, each survived 20 % longer."""

from pathlib import Path

from stabctl import read
from stabctl.controllers import BangBang
from stabctl.estimate.loop import Driven
from stabctl.estimate.pmu import Pmu
from stabctl.placement.contingency import load, packaged
from stabctl.placement.place import place
from stabctl.report import siting_page
from stabctl.report.siting_table import HEADS, row
from stabctl.report.study import Study, Table
from stabctl.report.study_console import present

FULL = True
CASE, SEED = "wnaps", 1
TEXT = (
    "Eight contingencies that storage can cure, from the screen of all line faults, each to be survived at a clearing "
    "time 20 % above that without storage.",
)


def study(reports: Path) -> Study:
    """The fleet found beside the uniform fleet, and its page."""
    case = read.load(CASE)
    others = {"kalman": Driven(BangBang(), "kalman", Pmu(), SEED, "batched")}
    found = place(case, load(packaged(CASE), case), others=others)
    table = Table("Fleets", HEADS, (row("eight", found),))
    pages = {f"storage for {CASE}": siting_page.write(found, reports).name}
    return Study("Placement of storage, Western system", "", (*TEXT, *found.reservations()), (), (table,), pages=pages)


if __name__ == "__main__":
    present(study)
