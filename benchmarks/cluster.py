"""Cost of jobs on a small cluster of separate processes, and what a million simulations would take.

Run: python benchmarks/cluster.py. It starts a Dask scheduler and two workers on the loopback interface.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import pickle
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

from distributed import Client, LocalCluster
from machine import stated
from rich.console import Console
from rich.table import Table

from stabctl import io
from stabctl.clearing import Search, screen
from stabctl.clearing.screen import PLACE, Shared, tasks
from stabctl.dynamics import operating_point
from stabctl.io.contingencies.toml import read
from stabctl.jobs import Kind, store
from stabctl.jobs.cluster import Cluster
from stabctl.jobs.task import Base
from stabctl.placement._simulated import FLEET
from stabctl.placement.contingencies import packaged
from stabctl.placement.place import place
from stabctl.simulation.contingency import Contingency

MILLION = 1_000_000


class Cost(NamedTuple):
    """What a study took."""

    simulations: int
    jobs: int
    workers_s: float  # processor time of the workers
    scheduler_s: float  # processor time of the scheduler and of the study
    stored: int  # bytes
    shared: int  # bytes that every worker gets once
    row: float  # bytes, mean


def measured(client: Client, kind: Kind, base: Base, study: Callable[..., Any]) -> Cost:
    """The cost of a study on a cluster whose scheduler is in this process."""
    with tempfile.TemporaryDirectory() as folder:
        here, there = time.process_time(), sum(client.run(time.process_time).values())
        found = study(store=folder, scheduler=client.scheduler.address)
        there, here = sum(client.run(time.process_time).values()) - there, time.process_time() - here
        path = Path(folder) / f"{kind.table}.db"
        rows = store.rows(path, kind)
        size = sum(len(pickle.dumps(row)) for row in rows) / len(rows)
        return Cost(found.simulations, len(rows), there, here, path.stat().st_size, len(pickle.dumps(base)), size)


def costs(client: Client) -> dict[str, Cost]:
    """Study -> its cost."""
    found = {}
    for name, below in (("ieee39", None), ("wnaps", "6cyc")):
        point = operating_point.solve(io.load(name))
        screen(point, "1cyc", scheduler=client.scheduler.address)  # loads the machine code
        study = lambda point=point, below=below, **how: screen(point, below, **how)  # noqa: E731
        found[f"screen {name}"] = measured(client, PLACE, Base(point), study)
    case = io.load("ieee39").classical()
    wanted = read(packaged("ieee39", True) or "", case)[:2]
    base = Base(operating_point.solve(case))
    place(case, wanted[:1], candidates=[29], observe="1s", scheduler=client.scheduler.address)
    found["place ieee39, classical"] = measured(client, FLEET, base, lambda **how: place(case, wanted, **how))
    return found


def overhead(client: Client, count: int = 1000) -> float:
    """Processor time (ms) of the scheduler and of the study for a job, from many very short ones."""
    point = operating_point.solve(io.load("two_area").classical())
    shared = Shared(Base(point), Search(limit_cycles=0.125, observed_s=0.1), None)
    (one,) = tasks({"7": [Contingency("7", trip="7-8")]}, shared, True)
    with closing(Cluster(client.scheduler.address)) as cluster:
        began = time.process_time()
        done = sum(row.about.status == "ok" for row in cluster.rows(one._replace(key=str(k)) for k in range(count)))
        return 1e3 * (time.process_time() - began) / done


def table(found: dict[str, Cost]) -> Table:
    """What was measured, and in proportion for a million simulations."""
    first = "study", "simulations", "jobs", "ms a simulation, workers", "ms a job, scheduler and study"
    shown = Table(*first, "kB a job stored", "kB sent to a worker once", "1e6: core hours", "GB stored", "GB of rows")
    for study, c in found.items():
        scale = MILLION / c.simulations
        shown.add_row(
            study, str(c.simulations), str(c.jobs), f"{1e3 * c.workers_s / c.simulations:.1f}",
            f"{1e3 * c.scheduler_s / c.jobs:.1f}", f"{c.stored / c.jobs / 1e3:.1f}", f"{c.shared / 1e3:.0f}",
            f"{scale * (c.workers_s + c.scheduler_s) / 3600:.1f}", f"{scale * c.stored / 1e9:.2f}",
            f"{scale * c.jobs * c.row / 1e9:.2f}",
        )  # fmt: skip
    return shown


def main() -> None:
    """Measure and print."""
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        found, short = costs(client), overhead(client)
    console = Console(highlight=False, width=200)
    console.print(stated())
    console.print(table(found))
    console.print(f"A very short job: {short:.2g} ms of the scheduler and the study.")


if __name__ == "__main__":
    main()
