"""Killed in every way, a sweep loses what it was at, never what it had; the rows are those of an undisturbed one."""

import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import closing

import pytest

from stabctl.sweep import pool, study_file
from stabctl.sweep.results import rows
from stabctl.sweep.sweep import run_sweep, tasks

from .conftest import TINY, alive

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads processes from /proc")


def workers(path):
    return {int(row["worker"].rpartition(":")[2]) for row in rows(path)}


def test_a_killed_worker_is_replaced_and_its_job_done_again(write, facts, undisturbed, tmp_path):
    out, killed = tmp_path / "results.db", []

    def kill(done, _total):
        if done in (2, 5):
            killed.append(max(filter(alive, workers(out))))
            os.kill(killed[-1], signal.SIGKILL)

    summary = run_sweep(write(TINY), out, workers=2, progress=kill)
    assert (summary.done, summary.errors) == (12, 0)
    assert len(set(killed)) == 2
    assert len(workers(out)) >= 3  # those that were killed, and others
    assert facts(out) == facts(undisturbed)


@pytest.mark.slow
def test_a_script_without_a_main_guard_runs_once(write, facts, undisturbed, tmp_path):
    script, out = tmp_path / "script.py", tmp_path / "results.db"
    call = f"run_sweep({str(write(TINY))!r}, {str(out)!r}, workers=2)"
    script.write_text(f"print('begun')\nfrom stabctl import run_sweep\nprint({call}.errors)\n")
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "begun\n0\n", "")
    assert facts(out) == facts(undisturbed)


@pytest.mark.slow
@pytest.mark.skipif(pool.METHOD != "forkserver", reason="has no fork server")
def test_a_killed_fork_server_is_replaced(write, facts, undisturbed, tmp_path):
    from multiprocessing import forkserver

    out, killed = tmp_path / "results.db", []

    def kill(done, _total):
        if done in (0, 3):
            killed.append(forkserver._forkserver._forkserver_pid)
            if killed[-1]:
                os.kill(killed[-1], signal.SIGKILL)
        if done == 4:  # a worker too, so that another one is needed
            os.kill(max(filter(alive, workers(out))), signal.SIGKILL)

    summary = run_sweep(write(TINY), out, workers=2, progress=kill)
    assert (summary.done, summary.errors) == (12, 0)
    assert killed[-1]
    assert facts(out) == facts(undisturbed)


class Deadly:
    """What kills the worker that unpacks it."""

    def __reduce__(self):
        return os._exit, (7,)


def test_a_job_that_kills_its_worker_again_and_again_is_an_error_row(write):
    good, bad, *more = tasks(study_file.read(write(TINY)), "study.toml")
    found = {row.key: row.about for row in pool.rows([good, bad._replace(shared=Deadly()), *more[:2]], workers=2)}
    assert [found[t.key].status for t in (good, bad, *more[:2])] == ["ok", "error", "ok", "ok"]
    assert "died 3 times" in found[bad.key].message
    assert "code 7" in found[bad.key].message


def test_closing_the_iterator_ends_the_workers(write):
    with closing(pool.rows(tasks(study_file.read(write(TINY)), "study.toml"), workers=2)) as found:
        pid = int(next(found).about.worker.rpartition(":")[2])
        assert alive(pid)
    assert not alive(pid)


@pytest.mark.slow
@linux
def test_a_killed_parent_leaves_no_process_and_no_gap(write, facts, undisturbed, sweep, tmp_path):
    one = sweep(write(TINY), tmp_path / "results.db", "--workers", "2")
    one.until_rows(2)
    started = one.descendants()
    assert workers(one.out) <= started
    assert len(started) >= 2
    os.kill(one.process.pid, signal.SIGKILL)
    deadline = time.monotonic() + 20
    while any(map(alive, started)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not [pid for pid in started if alive(pid)]
    kept = {row["key"]: row for row in rows(one.out)}
    assert 2 <= len(kept) < 12
    again = run_sweep(write(TINY), one.out, workers=2)
    assert (again.before, again.done) == (len(kept), 12 - len(kept))
    assert facts(one.out) == facts(undisturbed)
    assert {row["key"]: row for row in rows(one.out) if row["key"] in kept} == kept  # not done again


@pytest.mark.slow
@linux
def test_ctrl_c_ends_a_sweep_cleanly(write, facts, undisturbed, sweep, tmp_path):
    one = sweep(write(TINY), tmp_path / "results.db", "--workers", "2")
    one.until_rows(2)
    started = one.descendants()
    os.killpg(one.process.pid, signal.SIGINT)  # a terminal tells the whole group
    code, said = one.end()
    assert code == 130
    assert len(said.splitlines()) == 1, said
    kept = len(one.rows())
    assert f"{kept} of 12 jobs done" in said
    assert "run the same command again" in said
    time.sleep(0.5)
    assert not [pid for pid in started if alive(pid)]
    run_sweep(write(TINY), one.out, workers=2)
    assert facts(one.out) == facts(undisturbed)


@pytest.mark.slow
@linux
def test_a_full_disk_is_a_sentence_and_the_rows_so_far_are_kept(write, facts, undisturbed, sweep, tmp_path):
    limit = 40_000  # bytes a file may have
    one = sweep(
        write(TINY), tmp_path / "results.db", preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit,) * 2)
    )
    code, said = one.end()
    assert code == 2
    assert len(said.splitlines()) == 1, said
    assert "results.db" in said
    assert "run the same command again" in said
    kept = len(one.rows())
    assert 0 < kept < 12
    again = run_sweep(write(TINY), one.out, workers=2)
    assert (again.before, again.done) == (kept, 12 - kept)
    assert facts(one.out) == facts(undisturbed)


@pytest.mark.slow
@linux
def test_ctrl_c_while_the_workers_are_readied_is_as_clean(write, sweep, tmp_path):
    one = sweep(write(TINY), tmp_path / "results.db")
    while not one.descendants():
        assert one.process.poll() is None
        time.sleep(0.01)
    time.sleep(0.3)
    os.killpg(one.process.pid, signal.SIGINT)
    code, said = one.end()
    assert code == 130
    assert len(said.splitlines()) == 1, said
    assert "0 of 12 jobs done" in said
