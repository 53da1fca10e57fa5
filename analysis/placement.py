"""Where storage belongs in the 39-bus system, with classical and with full-order machines."""

from pathlib import Path
from typing import NamedTuple

import stabctl as st
from reproduction.study import Study, Table, draw, present
from stabctl.io.contingencies.toml import read
from stabctl.placement.contingencies import packaged
from stabctl.placement.siting import Siting

KALMAN = {"kalman": st.EstimatorControl()}
HEADS = (
    "contingencies",
    "uniform (MW)",
    "linear (MW)",
    "optimized (MW)",
    "cuts allow (MW)",
    "of uniform (%)",
    "sites",
    "runs",
    "time (s)",
)
TEXT = (
    "Each contingency must be stable at the clearing time with which a uniform fleet of 5 % of every machine's MVA is "
    "just stable. How many megawatts are enough in the right places? Every fleet was simulated with every "
    "contingency; what the cuts allow is no lower bound."
)


class Task(NamedTuple):
    """A system and what its fleet must survive."""

    page: str
    what: str
    case: str = "ieee39"
    classical: bool = True
    contingencies: int = 9
    sites: int | None = None
    estimated: bool = False  # simulated with a Kalman filter too


def study(reports: Path) -> Study:
    """Nine contingencies, with classical and with full-order machines."""
    classical = Task("ieee39_classical", "classical, nine")
    full_order = Task("ieee39", "full order, nine", classical=False, estimated=True)
    return sitings("Placement of storage", TEXT, (classical, full_order), reports)


def sitings(title: str, text: str, tasks: tuple[Task, ...], reports: Path) -> Study:
    """The optimized fleets compared with the uniform fleet and the linear allocation, and a page for each."""
    rows, pages, remarks, pictures = [], {}, [], []
    for task in tasks:
        case = st.load(task.case)
        case = case.classical() if task.classical else case
        contingencies = read(packaged(task.case, task.classical), case)[: task.contingencies]
        found = st.place(case, contingencies, sites=task.sites, validate=KALMAN if task.estimated else None)
        rows.append(row(task.what, found))
        pages[f"storage for {task.case}, {task.what}"] = found.report(reports, task.page).name
        remarks += [f"{task.what}: {sentence}" for sentence in found.reservations()]
        picture = draw(
            found.plot(),
            reports / f"placement_{task.page}_sizes.png",
            f"Storage ratings, {task.case}, {task.what}",
            alt="Bars of the optimized fleet beside those of the uniform fleet.",
        )
        pictures.append(picture)
    table = Table("Fleets", HEADS, tuple(rows))
    return Study(title, text=(text, *remarks), tables=(table,), pictures=tuple(pictures), pages=pages)


def row(name: str, siting: Siting) -> tuple[str, ...]:
    """One fleet in the table."""
    mw = siting.uniform_mw, siting.linear_mw, siting.total_mw, siting.cuts_mw, siting.percent_of_uniform
    numbers = ("none" if value is None else f"{value:.1f}" for value in mw)
    return name, *numbers, str(len(siting.sites)), str(siting.simulations), f"{siting.wall_s:.1f}"


if __name__ == "__main__":
    present(study)
