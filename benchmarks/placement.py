"""Speed of siting, and of the screen of all line faults compared with bisection pair by pair in the same run.

Run: python benchmarks/placement.py. The aims are 15 s for nine contingencies of ieee39, 60 s for them at three
load levels, and 30 s for the screen of wnaps, on two cores.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import time

import numpy as np
from rich.console import Console
from rich.table import Table

from stabctl import io
from stabctl.clearing import clearing_time, screen
from stabctl.dynamics import operating_point
from stabctl.io.contingencies.toml import read
from stabctl.placement.contingencies import packaged
from stabctl.placement.place import place


def screens(names: tuple[str, ...] = ("ieee39", "wnaps"), every: int = 4) -> Table:
    """The screen of each case, and clearing times of every n-th of its pairs by bisection, scaled to all of them."""
    table = Table("case", "pairs", "runs a pair", "screen, s", "bisection: runs a pair", "s", "differing answers")
    for name in names:
        point = operating_point.solve(io.load(name))
        found = screen(point)
        sample, began = found.pairs[::every], time.perf_counter()
        single = [clearing_time(point, p.contingency) for p in sample]
        wall = (time.perf_counter() - began) * len(found.pairs) / len(sample)
        runs = sum(len(c.runs) for c in single) / len(single)
        differing = sum(p.cycles != c.cycles or p.status != c.status for p, c in zip(sample, single, strict=True))
        pairs, shown = len(found.pairs), (found.simulations / len(found.pairs), found.wall_s)
        table.add_row(name, str(pairs), *(f"{x:.1f}" for x in (*shown, runs, wall)), str(differing))
    return table


def sitings() -> Table:
    """The cheapest fleets that survive the packaged contingencies of ieee39, evidence included."""
    table = Table("case", "contingencies", "MW", "of uniform, %", "simulations", "s", "ms a simulation")
    case = io.load("ieee39")
    levels = {f"{level:g}": case.with_load_level(level) for level in (0.9, 0.95, 1.0)}
    studies = {"ieee39, classical": case.classical(), "ieee39": case, "ieee39, three load levels": levels}
    for name, base in studies.items():
        found = place(base, read(packaged("ieee39", "classical" in name) or "", case))
        share = f"{100 * found.total_mw / (found.uniform_mw or np.nan):.0f}"
        cells = str(len(found.contingencies)), f"{found.total_mw:.1f}", share
        speed = f"{found.wall_s:.1f}", f"{1e3 * found.wall_s / found.simulations:.1f}"
        table.add_row(name, *cells, str(found.simulations), *speed)
    return table


def main() -> None:
    """Measure and print."""
    console = Console(highlight=False)
    console.print(sitings())
    console.print(screens())


if __name__ == "__main__":
    main()
