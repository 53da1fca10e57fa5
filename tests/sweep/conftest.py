"""Tiny studies, their rows, and processes to kill."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from terminal import said

from stabctl.jobs.task import COMPUTED
from stabctl.sweep.results import rows
from stabctl.sweep.sweep import run_sweep

TINY = """
kind = "clearing-time"
case = "two_area"
machines = "classical"
trip = "7-8"
fault = ["7", "7-8@0.1", "7-8@0.2"]
storage = ["none", "20MW", "50MW", "100MW"]
observe_s = 3
"""  # 12 jobs of some tenths of a second


@pytest.fixture
def write(tmp_path):
    """Writes a study file."""

    def to(text, name="study.toml"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return to


@pytest.fixture
def facts():
    """What a results file says, without what differs from one sweep to the next: by key."""

    def of(path):
        return {row["key"]: {c: v for c, v in row.items() if c not in COMPUTED} for row in rows(path)}

    return of


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory):
    """Results file of the tiny study, two workers, nobody killed."""
    folder = tmp_path_factory.mktemp("undisturbed")
    (folder / "study.toml").write_text(TINY)
    summary = run_sweep(folder / "study.toml", folder / "results.db", workers=2)
    assert (summary.jobs, summary.done, summary.errors, summary.interrupted) == (12, 12, 0, False)
    return folder / "results.db"


class Sweep:
    """A sweep in a process of its own, leader of its own group as in a terminal."""

    def __init__(self, study, out, *words, **options):
        self.out = out
        self.process = subprocess.Popen(
            [sys.executable, "-m", "stabctl", "sweep", "run", study, "--out", out, *words],
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            **options,
        )

    def rows(self):
        return rows(self.out) if self.out.exists() else []

    def until_rows(self, count):
        """Wait for so many rows; the sweep must still be at work."""
        while len(self.rows()) < count:
            assert self.process.poll() is None, self.process.stderr.read()
            time.sleep(0.02)

    def descendants(self):
        """Processes that it has started, and those that these have started."""
        parent = {}
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                parent[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            except OSError:
                continue
        found = {self.process.pid}
        while more := {pid for pid, above in parent.items() if above in found} - found:
            found |= more
        return found - {self.process.pid}

    def end(self):
        """Its exit code and what it said."""
        error = self.process.communicate(timeout=120)[1]
        return self.process.returncode, said(error)


@pytest.fixture
def sweep():
    """Starts sweeps in processes of their own; none is left at the end."""
    started = []

    def start(*words, **options):
        started.append(Sweep(*words, **options))
        return started[-1]

    yield start
    for one in started:
        if one.process.poll() is None:
            os.killpg(one.process.pid, signal.SIGKILL)
        one.process.communicate()


def alive(pid):
    """Does the process run? (A zombie does not.)"""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
