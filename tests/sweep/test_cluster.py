"""The same tasks on a Dask scheduler with two workers, all really started on this machine."""

import subprocess
import sys
import time
from concurrent.futures import CancelledError, Future

import pytest

from stabctl._util.errors import StudyError
from stabctl.jobs import cluster
from stabctl.sweep import study_file
from stabctl.sweep.results import rows
from stabctl.sweep.sweep import run_sweep, tasks

from .conftest import TINY


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """Address of a Dask scheduler without workers, and what starts one."""
    pytest.importorskip("distributed", reason="Dask is not installed: pip install 'stabctl[cluster]'")
    folder, started = tmp_path_factory.mktemp("dask"), []
    where = folder / "scheduler.json"

    def start(program, *words):
        command = [
            sys.executable,
            "-m",
            f"distributed.cli.{program}",
            "--scheduler-file",
            where,
            *words,
            "--no-dashboard",
        ]
        started.append(subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        return started[-1]

    start("dask_scheduler", "--host", "127.0.0.1", "--port", "0")
    while not where.exists():
        time.sleep(0.05)
    from distributed import Client

    with Client(scheduler_file=str(where), timeout=30, set_as_default=False) as client:
        yield client, start
    for process in started:
        process.kill()
        process.wait()


@pytest.mark.slow
def test_rows_are_those_of_this_machine(scheduler, write, facts, undisturbed, tmp_path):
    client, start = scheduler
    address = client.scheduler.address
    with pytest.raises(StudyError, match="has no workers"):
        run_sweep(write(TINY), tmp_path / "results.db", scheduler=address)
    words = ("--nthreads", "1", "--nworkers", "1", "--host", "127.0.0.1", "--no-nanny")
    workers = [start("dask_worker", *words) for _ in range(2)]
    client.wait_for_workers(2, timeout=60)
    summary = run_sweep(write(TINY), tmp_path / "results.db", scheduler=address)
    assert (summary.done, summary.errors) == (12, 0)
    assert facts(tmp_path / "results.db") == facts(undisturbed)
    assert len({row["worker"] for row in rows(tmp_path / "results.db")}) == 2

    def kill(done, _total):
        if done == 3:
            workers[0].kill()

    assert run_sweep(write(TINY), tmp_path / "again.db", scheduler=address, progress=kill).done == 12
    assert facts(tmp_path / "again.db") == facts(undisturbed)


@pytest.mark.parametrize(
    ("raised", "says"),
    [
        (CancelledError(), None),
        (ModuleNotFoundError("No module named 'stabctl'"), "No module named 'stabctl'"),
    ],
)
def test_what_befalls_the_cluster_is_a_sentence(write, raised, says):
    (task, *_), future = tasks(study_file.read(write(TINY)), "study.toml"), Future()
    future.set_exception(raised)
    one = object.__new__(cluster.Cluster)
    one.address, one._killed = "tcp://h:1", KeyError
    if says is None:
        assert one._row(future, task) is None
    else:
        with pytest.raises(StudyError, match=says):
            one._row(future, task)
    one._killed = type(raised)  # as if it were what Dask raises for a deadly job
    row = one._row(future, task)
    assert (row.key, row.about.status) == (task.key, "error")


def test_no_scheduler_answers(write, tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="Dask is not installed: pip install 'stabctl[cluster]'")
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    for address, says in (
        ("tcp://127.0.0.1:9", "No Dask scheduler answers at tcp://127.0.0.1:9"),
        ("nonsense://x:1", "not the address"),
        ("", "not the address"),
    ):
        with pytest.raises(StudyError, match=says):
            run_sweep(write(TINY), tmp_path / "results.db", scheduler=address)


def test_without_dask(write, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(StudyError, match=r"pip install 'stabctl\[cluster\]'"):
        run_sweep(write(TINY), tmp_path / "results.db", scheduler="tcp://127.0.0.1:9")
