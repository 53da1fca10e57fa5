"""Where storage belongs on the 39-bus system: six and nine contingencies, any number of sites and at most three."""

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

CASE, SEED = "ieee39", 1
ASKED = {  # page -> what it is, classical, contingencies, most sites
    "ieee39_classical": ("classical, nine", True, 9, None),
    "ieee39_classical_six": ("classical, six", True, 6, None),
    "ieee39_classical_three_sites": ("classical, nine, at most 3 sites", True, 9, 3),
    "ieee39": ("full order, nine", False, 9, None),
}
TEXT = (
    "Contingencies across the 39-bus system, each to be survived at the clearing time that a uniform fleet of 5 % of "
    "every machine's MVA just survives. What do fewer megawatts in the right places do? The fleets were simulated "
    "against every contingency; the bound is an estimate.",
)


def study(reports: Path) -> Study:
    """Fleets found beside the uniform fleet and that of the linear stage; a page each."""
    rows, pages, said = [], {}, []
    others = {"kalman": Driven(BangBang(), "kalman", Pmu(), SEED, "batched")}
    for page, (what, classical, count, sites) in ASKED.items():
        case = read.load(CASE)
        case = case.classical() if classical else case
        found = place(case, load(packaged(CASE, classical), case)[:count], sites=sites, others=others)
        rows.append(row(what, found))
        pages[f"storage for {CASE}, {what}"] = siting_page.write(found, reports, page).name
        said += [f"{what}: {one}" for one in found.reservations()]
    return Study(
        "Placement of storage", text=(*TEXT, *said), tables=(Table("Fleets", HEADS, tuple(rows)),), pages=pages
    )


if __name__ == "__main__":
    present(study)
