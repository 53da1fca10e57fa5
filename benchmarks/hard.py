"""Systems with motors, constant-power loads and injections: 10 s with a fault, and how their voltages are found."""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import sys
from pathlib import Path

import numpy as np
from machine import cpu, stated
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from hard import hard

from stabctl import io
from stabctl.simulation._buffers import NOTE
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation


def main() -> None:
    """Print the table."""
    columns = "system", "steps", "ms", "stages by Newton's method", "iterations per stage"
    table = Table(*columns, title="10 s, processor time, least of seven")
    for name, case in (*hard(), ("ieee39", io.load("ieee39")), ("wnaps", io.load("wnaps"))):
        point, least = case.initialize(), np.inf
        fault = Contingency(str(case.branches[len(case.branches) // 3].from_bus), 3 / 60, at=0.1)
        for _ in range(7):
            simulation = Simulation(setup(point), fault, record=False)
            least = min(least, cpu(lambda simulation=simulation: simulation.advance(10.0)))
        made = simulation.finish()
        stages, draws = 4 * made.steps, simulation._run.notes[NOTE.draws]
        table.add_row(
            name, str(made.steps), f"{1e3 * least:.3g}", f"{made.newton_stages} of {stages}", f"{draws / stages:.2f}"
        )
    console = Console()
    console.print(stated())
    console.print(table)


if __name__ == "__main__":
    main()
