"""Speed of what placement rests on: the screen of all line faults, against bisection pair by pair in the same run.

Run: python benchmarks/placement.py. The aim is 30 s for the screen of wnaps on two cores.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import time

from rich.console import Console
from rich.table import Table

from stabctl import equilibrium, read
from stabctl.clearing import clearing_time
from stabctl.screen import screen


def screens(names: tuple[str, ...] = ("ieee39", "wnaps"), every: int = 4) -> Table:
    """The screen of each case, and clearing times of every n-th of its pairs by bisection, scaled to all of them."""
    table = Table("case", "pairs", "runs a pair", "screen, s", "bisection: runs a pair", "s", "differing answers")
    for name in names:
        point = equilibrium.solve(read.load(name))
        found = screen(point)
        sample, began = found.pairs[::every], time.perf_counter()
        single = [clearing_time(point, p.fault, [p.trip]) for p in sample]
        wall = (time.perf_counter() - began) * len(found.pairs) / len(sample)
        runs = sum(len(c.runs) for c in single) / len(single)
        differing = sum(p[2:5] != (c.cycles, c.status, c.machine) for p, c in zip(sample, single, strict=True))
        pairs, shown = len(found.pairs), (found.simulations / len(found.pairs), found.wall_s)
        table.add_row(name, str(pairs), *(f"{x:.1f}" for x in (*shown, runs, wall)), str(differing))
    return table


def main() -> None:
    """Measure and print."""
    Console(highlight=False).print(screens())


if __name__ == "__main__":
    main()
