"""Where storage belongs on the 39-bus system, with classical and with full-order machines."""

from pathlib import Path
from typing import NamedTuple

from reproduction.console import present
from reproduction.study import Study, Table
from stabctl import io
from stabctl.controllers import BangBang
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.pmu import Pmu
from stabctl.placement.contingencies import packaged, read
from stabctl.placement.place import place
from stabctl.placement.siting import Siting
from stabctl.report import siting_page

SEED = 1
HEADS = "contingencies", "uniform, MW", "linear, MW", "found, MW", "bound, MW", "of uniform, %", "sites", "runs", "s"
TEXT = (
    "Contingencies across the 39-bus system, each to be survived at the clearing time that a uniform fleet of 5 % of "
    "every machine's MVA just survives. What do fewer megawatts in the right places do? The fleets were simulated "
    "against every contingency; the bound is an estimate.",
)


class Asked(NamedTuple):
    """One siting of the case."""

    page: str
    what: str
    case: str = "ieee39"
    classical: bool = True
    contingencies: int = 9
    sites: int | None = None
    estimated: bool = False  # put under a Kalman filter too


def study(reports: Path) -> Study:
    """Nine contingencies with classical and with full-order machines."""
    nine = Asked("ieee39_classical", "classical, nine")
    full = Asked("ieee39", "full order, nine", classical=False, estimated=True)
    return sitings("Placement of storage", TEXT, (nine, full), reports)


def sitings(title: str, text: tuple[str, ...], asked: tuple[Asked, ...], reports: Path) -> Study:
    """Fleets found beside the uniform fleet and that of the linear stage; a page each."""
    rows, pages, said = [], {}, []
    kalman = {"kalman": EstimatorControl(BangBang(), "kalman", Pmu(), seed=SEED, engine="batched")}
    for one in asked:
        case = io.load(one.case)
        case = case.classical() if one.classical else case
        listed = read(packaged(one.case, one.classical), case)[: one.contingencies]
        found = place(case, listed, sites=one.sites, validate=kalman if one.estimated else None)
        rows.append(row(one.what, found))
        pages[f"storage for {one.case}, {one.what}"] = siting_page.write(found, reports, one.page).name
        said += [f"{one.what}: {sentence}" for sentence in found.reservations()]
    return Study(title, text=(*text, *said), tables=(Table("Fleets", HEADS, tuple(rows)),), pages=pages)


def row(name: str, siting: Siting) -> tuple[str, ...]:
    """Megawatts of the uniform fleet, the linear stage, the fleet found and the bound; share, sites, runs, seconds."""
    found = (siting.uniform_mw, siting.linear_mw, siting.total_mw, siting.lower_bound_mw, siting.percent_of_uniform)
    numbers = ("none" if value is None else f"{value:.1f}" for value in found)
    return name, *numbers, str(len(siting.sites)), str(siting.simulations), f"{siting.wall_s:.1f}"


if __name__ == "__main__":
    present(study)
