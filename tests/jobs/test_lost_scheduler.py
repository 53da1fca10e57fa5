"""A screen on a cluster of separate processes: workers and the scheduler are lost on the way, the rows are the same."""

import socket
import subprocess
import sys

import pytest

from stabctl.clearing import screen
from stabctl.clearing.index import INDEX
from stabctl.clearing.screen import PLACE
from stabctl.jobs.store import rows

BELOW = "6cyc"


class Processes:
    """A Dask scheduler and workers on the loopback interface, each a process of its own."""

    def __init__(self, folder):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.folder, self.started, self.scheduler, self.workers = folder, [], None, []
        self.address = f"tcp://127.0.0.1:{self.port}"

    def start_scheduler(self):
        self.scheduler = self._start("dask_scheduler", "--host", "127.0.0.1", "--port", str(self.port))

    def start_worker(self):
        words = "--nthreads", "1", "--nworkers", "1", "--host", "127.0.0.1", "--no-nanny", "--death-timeout", "60"
        self.workers.append(self._start("dask_worker", self.address, *words))

    def _start(self, program, *words):
        command = [sys.executable, "-m", f"distributed.cli.{program}", *words, "--no-dashboard"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self.started.append(subprocess.Popen(command, cwd=self.folder, **quiet))
        return self.started[-1]

    def end(self):
        for process in self.started:
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path):
    distributed = pytest.importorskip("distributed", reason="Dask is not installed: pip install 'stabctl[cluster]'")
    found = Processes(tmp_path)
    found.start_scheduler()
    for _ in range(2):
        found.start_worker()
    with distributed.Client(found.address, timeout=60, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
    yield found
    found.end()


@pytest.mark.slow
def test_a_lost_worker_and_a_lost_scheduler_change_no_row(points, cluster, tmp_path):
    point = points("wnaps")
    alone = screen(point, below=BELOW)
    done = []

    def disturb(now, _total):
        done.append(now)
        if len(done) == 5:
            cluster.workers[0].kill()
        if len(done) == 15:
            cluster.scheduler.kill()
            cluster.scheduler.wait()
            cluster.start_scheduler()
            cluster.start_worker()

    found = screen(point, below=BELOW, store=tmp_path / "store", scheduler=cluster.address, progress=disturb)
    assert cluster.workers[0].poll() is not None
    assert found.rows() == alone.rows()
    assert found.simulations == alone.simulations
    kept = rows(tmp_path / "store" / "screen.db", PLACE)
    assert len(kept) == len(done) > 30
    assert len({row["worker"] for row in kept}) >= 2
    again = screen(point, below=BELOW, store=tmp_path / "store")  # from the store, without a cluster
    assert again.rows() == alone.rows()


@pytest.mark.slow
def test_a_cluster_ranks_the_places_too(points, cluster, tmp_path):
    point, told = points("ieee39"), []
    how = {"below": BELOW, "ranking": told.append}
    found = screen(point, **how, scheduler=cluster.address, store=tmp_path / "store")
    here = screen(point, **how)
    assert found.rows() == here.rows() == screen(point, below=BELOW).rows()
    assert told[0] == told[1]
    assert len(rows(tmp_path / "store" / "severity.db", INDEX)) == 27
