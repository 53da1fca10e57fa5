"""Is there a smaller fleet? All pairs and triples of sites on a grid of shares, compared with the optimized fleet."""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

import stabctl as st
from reproduction.study import Study, Table, present
from stabctl.io.contingencies.toml import read
from stabctl.model import fleet
from stabctl.placement.contingencies import packaged
from stabctl.placement.trials import Trials

FULL = True
CASE, CAP, PARTS = "ieee39", "30%mva", 12  # shares of the total in twelfths
LESS = 0.99, 0.97  # of the optimized total
COUNTS = {"six": 6, "nine": 9}  # contingencies
HEADS = "contingencies", "optimized (MW)", "sites", "share (%)", "tried (MW)", "fleets tried", "runs", "stable"
TEXT = (
    "The set of fleets that survive all contingencies need not be convex, so what the cuts of the siting program "
    "allow is no lower bound. Here every fleet at two or three of the ten machines, with shares of the total in "
    "twelfths and within the caps, is simulated until a contingency is unstable. Is any smaller than that found?"
)


def study(reports: Path) -> Study:
    """Fleets slightly smaller than the optimized fleet, in the classical 39-bus system."""
    case = st.load(CASE).classical()
    contingencies = read(packaged(CASE, classical=True), case)
    rows = []
    for name, count in COUNTS.items():
        found = st.place(case, contingencies[:count], cap=CAP)
        for share in LESS:
            total = share * found.total_mw
            tried, stable, runs = search(case, contingencies[:count], total)
            cells = f"{found.total_mw:.1f}", str(len(found.sites)), f"{100 * share:g}", f"{total:.1f}"
            rows.append((name, *cells, str(tried), str(runs), str(len(stable))))
    return Study("A smaller fleet?", text=(TEXT,), tables=(Table("Pairs and triples", HEADS, tuple(rows)),))


def search(
    case: st.Case, contingencies: Sequence[st.Contingency], total: float
) -> tuple[int, tuple[np.ndarray, ...], int]:
    """Number of fleets of `total` MW tried, the stable ones (candidates, MW), and the number of simulations."""
    devices = fleet.everywhere(case, CAP)
    cap = np.array([d.rating for d in devices])
    trials = Trials(case.initialize(devices), contingencies, cap)
    fleets = [mw for mw in grid(len(cap), total) if (mw <= cap).all()]
    unstable = np.zeros(len(contingencies))
    kept = trials.each(partial(survives_all, trials, fleets, unstable), range(len(fleets)))
    return len(fleets), tuple(mw for mw, survives in zip(fleets, kept, strict=True) if survives), trials.simulations


def grid(count: int, total: float) -> Iterator[np.ndarray]:
    """All fleets (candidates, MW) at two and three of the candidates, with shares in twelfths of the total."""
    for size in (2, 3):
        for places in combinations(range(count), size):
            for ends in combinations(range(1, PARTS), size - 1):
                mw = np.zeros(count)
                mw[list(places)] = total / PARTS * np.diff((0, *ends, PARTS))
                yield mw


def survives_all(trials: Trials, fleets: Sequence[np.ndarray], unstable: np.ndarray, i: int) -> bool:
    """Whether fleet i survives all contingencies. The one that was unstable most often is simulated first."""
    for k in np.argsort(-unstable):
        if not trials.survives(fleets[i], int(k)):
            unstable[k] += 1
            return False
    return True


if __name__ == "__main__":
    present(study)
