"""What memory access adds to a step: systems one after the other, whose data are no longer in the caches at their turn.

A system of wnaps 10 times is simulated on by one step. Warm, it has just made another step; cold, 81 systems of the
same size, each with data of its own, have made one in between. The operations are the same. In a step the data are read
in each of four stages, of which only the first finds them outside the caches. The same buses in one network follow.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import statistics
import time

import numpy as np
from machine import stated
from rich.console import Console
from rich.table import Table

from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.model.replicate import replicate
from stabctl.simulation import stepper
from stabctl.simulation._judgment import DONE
from stabctl.simulation._substitution import Factors
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

COPIES, SYSTEMS = 10, 82
STEP = 1 / 120  # s
ROUNDS = 7


class System:
    """A simulation just after a fault, with data of its own."""

    def __init__(self, point: operating_point.OperatingPoint) -> None:
        run = Simulation(setup(point), Contingency("83", 4 / 60, ["83-33"], at=0.0), record=False)
        run.advance(0.1)
        program, net = run._on.program, run._on.network.net
        program = program._replace(w=program.w.copy(), k=program.k.copy())
        net = net._replace(factors=Factors(*(part.copy() for part in net.factors)), island=net.island.copy())
        self.parts = program, run._on.places, net, run._run, run.setup.rules

    def seconds(self, steps: int = 1) -> float:
        """Time (s) of a step, the mean of several made at once."""
        plan = stepper.Plan(np.full(steps, STEP), np.empty(0, np.int64), False)
        begin = time.perf_counter()
        verdict, _ = stepper.advance(*self.parts, plan, stepper.START, stepper.NO_ROWS)
        assert verdict == DONE
        return (time.perf_counter() - begin) / steps


def main() -> None:
    """Measure and print."""
    small = operating_point.solve(replicate(io.load("wnaps"), COPIES, spread=0.05))
    systems = [System(small) for _ in range(SYSTEMS)]
    warm, cold = [], []
    for _ in range(ROUNDS):
        warm.append(statistics.median(systems[0].seconds() for _ in range(SYSTEMS)))
        cold.append(statistics.median(system.seconds() for system in systems))
    many = min(systems[0].seconds(30) for _ in range(ROUNDS))
    del systems
    whole = System(operating_point.solve(replicate(io.load("wnaps"), COPIES * SYSTEMS, spread=0.05)))
    large = min(whole.seconds(5) for _ in range(ROUNDS))
    buses = len(small.V)
    added = statistics.median(c - w for c, w in zip(cold, warm, strict=True))
    table = Table("a step of", "µs per bus", title=stated())
    for name, seconds, count in (
        (f"{buses} buses, warm, 30 steps at once", many, buses),
        (f"{buses} buses, warm, alone", statistics.median(warm), buses),
        (f"{buses} buses, cold, alone", statistics.median(cold), buses),
        (f"{buses * SYSTEMS} buses in one network", large, buses * SYSTEMS),
    ):
        table.add_row(name, f"{1e6 * seconds / count:.3f}")
    console = Console(highlight=False, width=120)
    console.print(table)
    console.print(
        f"A cold start of a step adds {1e6 * added / buses:.3f} µs per bus, of four stages {4e6 * added / buses:.3f};"
    )
    console.print(
        f"the large network takes {1e6 * (large / buses / SYSTEMS - many / buses):.3f} more than the small one."
    )


if __name__ == "__main__":
    main()
