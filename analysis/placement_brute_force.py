"""Is there a smaller fleet? Every pair and triple of sites on a grid of shares, against what `place` finds."""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from reproduction.console import present
from reproduction.study import Study, Table
from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.model import fleet
from stabctl.model.case import Case
from stabctl.placement.contingencies import packaged, read
from stabctl.placement.place import place
from stabctl.placement.trials import Trials
from stabctl.simulation.contingency import Contingency

FULL = True
CASE, CAP, PARTS = "ieee39", "30%mva", 12  # shares of the total in twelfths
LESS = 0.99, 0.97  # of the megawatts found
ASKED = {"six": 6, "nine": 9}
HEADS = "contingencies", "found, MW", "sites", "share, %", "MW", "fleets tried", "runs", "survive all"
TEXT = (
    "The fleets that survive need not form a convex set, so the bound of the program is an estimate. Here all fleets "
    "at two and three of the ten machines with shares of the total in twelfths and within the caps are put to the "
    "contingencies, until one is not survived. Does any need less than the fleet that was found?",
)


def study(reports: Path) -> Study:
    """Fleets of a little less than what `place` finds on the classical 39-bus system."""
    case = io.load(CASE).classical()
    listed = read(packaged(CASE, classical=True), case)
    rows = []
    for name, count in ASKED.items():
        found = place(case, listed[:count], cap=CAP)
        for share in LESS:
            total = share * found.total_mw
            tried, survivors, runs = search(case, listed[:count], total)
            cells = f"{found.total_mw:.1f}", str(len(found.sites)), f"{100 * share:g}", f"{total:.1f}"
            rows.append((name, *cells, str(tried), str(runs), str(len(survivors))))
    return Study("A smaller fleet?", text=TEXT, tables=(Table("Pairs and triples", HEADS, tuple(rows)),))


def search(case: Case, contingencies: Sequence[Contingency], total: float) -> tuple[int, tuple[np.ndarray, ...], int]:
    """Fleets of `total` MW tried, those (candidates, MW) that survive everything, and runs."""
    devices = fleet.everywhere(case, CAP)
    cap = np.array([d.rating for d in devices])
    trials = Trials(operating_point.solve(case.with_storage(devices)), contingencies, cap)
    fleets = [mw for mw in grid(len(cap), total) if (mw <= cap).all()]
    losses = np.zeros(len(contingencies))
    kept = trials.each(partial(survives_all, trials, fleets, losses), range(len(fleets)))
    return len(fleets), tuple(mw for mw, survived in zip(fleets, kept, strict=True) if survived), trials.simulations


def grid(count: int, total: float) -> Iterator[np.ndarray]:
    """All fleets (candidates, MW) at two and three of the candidates with shares in twelfths of the total."""
    for size in (2, 3):
        for places in combinations(range(count), size):
            for ends in combinations(range(1, PARTS), size - 1):
                mw = np.zeros(count)
                mw[list(places)] = total / PARTS * np.diff((0, *ends, PARTS))
                yield mw


def survives_all(trials: Trials, fleets: Sequence[np.ndarray], losses: np.ndarray, i: int) -> bool:
    """Does fleet i survive everything? Asked first is what was lost most often."""
    for k in np.argsort(-losses):
        if not trials.survives(fleets[i], int(k)):
            losses[k] += 1
            return False
    return True


if __name__ == "__main__":
    present(study)
