"""Speed of the core on this machine: medians of several runs, compared with a bound measured in the same run."""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable

import numpy as np
from machine import stated, timed
from rich.console import Console
from rich.table import Table

from stabctl import io
from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.model import fleet, powerflow
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run

COMMAND = (
    "-m",
    "stabctl",
    "simulate",
    "two_area",
    "--fault",
    "7-8@0.4",
    "--clear",
    "21cyc",
    "--storage",
    "50MW",
    "--json",
)


def median(call: Callable[[], float], repeat: int = 9) -> float:
    """Median of what the call returns (s)."""
    return statistics.median(call() for _ in range(repeat))


def dense_products() -> float:
    """Seconds of 9600 products of a dense 122 x 122 complex matrix with a vector."""
    random = np.random.default_rng(0)
    A, v = random.random((122, 122)) + 1j * random.random((122, 122)), np.ones(122, complex)
    return timed(lambda: [A @ v for _ in range(9600)])


def whole_process(environment: dict[str, str]) -> float:
    """Seconds of the command line from start to end."""
    return timed(lambda: subprocess.run([sys.executable, *COMMAND], check=True, capture_output=True, env=environment))


def table_4() -> None:
    """The paper's Table 4 to an eighth of a cycle."""
    case = io.load("wnaps_paper")
    flow = powerflow.solve(case)
    for percent in (0, 5, 15, 20, 25, 30):
        devices = fleet.everywhere(case, f"{percent}%dispatch", flow, characteristic="conductance", lag=0.05)
        point = operating_point.solve(case.with_storage(devices), flow)
        clearing_time(point, Contingency("83", trip="83-33"), control=BangBang())


def main() -> None:
    """Measure and print."""
    case = io.load("wnaps")
    point = operating_point.solve(case)
    events = Contingency("83", 4 / 60, ["83-33"])
    run(point, events)
    ten_seconds = median(lambda: run(point, events).wall_s, 15)
    bound = median(dense_products)
    rows = [
        ("10 s of wnaps, four-cycle fault, 1/120 s, in the stepper", ten_seconds, "0.045"),
        ("  bound: 9600 dense 122 x 122 complex products", bound, ""),
        ("Table 4 to 1/8 cycle, six clearing times", median(lambda: timed(table_4), 3), "1.5"),
        ("case wnaps from its files", median(lambda: timed(lambda: io.load("wnaps"))), ""),
        ("power flow of wnaps", median(lambda: timed(lambda: powerflow.solve(case))), ""),
        ("initialization of wnaps", median(lambda: timed(lambda: operating_point.solve(case, point.flow))), ""),
        ("stabctl simulate two_area, whole process, warm", median(lambda: whole_process(dict(os.environ)), 5), "1.5"),
    ]
    with tempfile.TemporaryDirectory() as folder:
        cold = whole_process(os.environ | {"XDG_CACHE_HOME": folder})
    rows.append(("the same with cold compilation of everything", cold, "30"))
    table = Table("what", "seconds", "target, s", title=stated())
    for what, seconds, wanted in rows:
        table.add_row(what, f"{seconds:.4f}" if seconds < 1 else f"{seconds:.2f}", wanted)
    console = Console(highlight=False)
    console.print(table)
    console.print(f"stepper over bound: {ten_seconds / bound:.2f} (target: at most 1.1)")


if __name__ == "__main__":
    main()
