"""Cost per bus against size: wnaps 1 to 820 times, tied by a line each; a table, and reports/growth.png.

The power flow begins 1 % and 0.5 degrees off the solution, at random. Modes end at 100 copies.
"""

import os
import resource

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from machine import cpu, stated
from rich.console import Console
from rich.table import Table

from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.model import powerflow
from stabctl.model.case import Case
from stabctl.model.replicate import replicate
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation
from stabctl.smallsignal import analyze, descriptor
from stabctl.view.figures import style

COPIES = (1, 3, 10, 30, 100, 300, 820)
LARGE = 100  # copies, beyond which no modes are calculated
RUNS = 3
BAND, DAMPING = (0.35, 0.45), (0.0, 0.1)  # between areas
WORKS = (
    "power flow",
    "initialization",
    "one simulated second",
    "linearization, sparse",
    "modes from 0.35 to 0.45 Hz, certified",
)


def second(point: operating_point.OperatingPoint) -> float:
    """Processor time (s) of one simulated second that begins with a four-cycle fault, two network changes included."""
    point.stages.clear()
    simulation = Simulation(setup(point), Contingency("83", 4 / 60, ["83-33"], at=0.0), record=False)
    return cpu(lambda: simulation.advance(1.0))


def off_solution(case: Case) -> Case:
    """The same case, whose bus table is not the solution."""
    rng = np.random.default_rng(7)
    size, angle = 1 + 0.01 * rng.uniform(-1, 1, len(case.buses)), 0.5 * rng.uniform(-1, 1, len(case.buses))
    return replace(
        case,
        buses=tuple(
            b._replace(v=b.v * float(f) if b.kind == "pq" else b.v, angle=b.angle + (b.kind != "swing") * float(d))
            for b, f, d in zip(case.buses, size, angle, strict=True)
        ),
    )


def works(copies: int) -> tuple[int, int, list[Callable[[], float]]]:
    """Number of buses and states, and the tasks, each of which returns its processor time in seconds."""
    case = replicate(io.load("wnaps"), copies, spread=0.05)
    flow, disturbed = powerflow.solve(case), off_solution(case)
    point = operating_point.solve(case, flow)
    form = descriptor(point)
    calls = [
        lambda: cpu(lambda: powerflow.solve(disturbed)),
        lambda: cpu(lambda: operating_point.solve(case, flow)),
        lambda: second(point),
        lambda: cpu(lambda: descriptor(point)),
        lambda: cpu(lambda: analyze(form, BAND, DAMPING)) if copies <= LARGE else np.nan,
    ]
    return len(case.buses), len(form.rows), calls


def draw(buses: list[int], per_bus: np.ndarray, path: Path) -> None:
    """Processor milliseconds per bus against buses, a line for each work."""
    fig, axes = style.subplots(7.5, 4.2)
    ax = axes[0, 0]
    for name, line, mark in zip(WORKS, per_bus.T, "os^Dv", strict=True):
        ax.loglog(buses, line, marker=mark, label=name)
    ax.set_xticks(buses, [str(n) for n in buses])
    steps = (a * 10.0**b for b in range(-3, 2) for a in (1, 2, 5))
    marks = [value for value in steps if np.nanmin(per_bus) / 1.5 < value < np.nanmax(per_bus) * 1.5]
    ax.set_yticks(marks, [f"{value:g}" for value in marks])
    ax.minorticks_off()
    ax.set(xlabel="buses (wnaps 1 to 820 times)", ylabel="processor time, ms per bus")
    style.legend_beside(ax, WORKS)
    path.parent.mkdir(exist_ok=True)
    style.save(fig, path)


def main() -> None:
    """Measure, print and draw."""
    systems = [works(copies) for copies in COPIES]
    buses = [n for n, _, _ in systems]
    rounds = [[[work() for work in calls] for _, _, calls in systems] for _ in range(RUNS)]  # sizes in turn
    per_bus = 1e3 * np.min(rounds, axis=0) / np.array(buses)[:, None]
    table = Table("buses", "states", *WORKS, title=f"processor ms per bus, best of {RUNS}; {stated()}")
    for (n, states, _), row in zip(systems, per_bus, strict=True):
        table.add_row(str(n), str(states), *(f"{ms:.3f}" for ms in row))
    console = Console(highlight=False, width=120)
    console.print(table)
    last = [np.flatnonzero(np.isfinite(column))[-1] for column in per_bus.T]
    slope = [1 + np.log(per_bus[k, i] / per_bus[2, i]) / np.log(buses[k] / buses[2]) for i, k in enumerate(last)]
    listed = "; ".join(f"{name} {power:.2f}" for name, power in zip(WORKS, slope, strict=True))
    console.print(f"cost ~ buses to the power, from {buses[2]} buses to the largest size measured: {listed}")
    console.print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB, all sizes together")
    path = Path("reports/growth.png")
    draw(buses, per_bus, path)
    console.print(f"written: {path}")


if __name__ == "__main__":
    main()
