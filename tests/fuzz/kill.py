"""A sweep that is killed at any instant: its file stays readable, and running it again gives every row."""

import os
import signal
import subprocess
import sys
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import stabctl
from stabctl.jobs.store import Store
from stabctl.jobs.task import COMPUTED, run_task
from stabctl.sweep import study_file, sweep
from stabctl.sweep.job import SWEEP
from stabctl.sweep.results import rows

from .attempt import Attempt

STUDY = """kind = "clearing-time"
case = "two_area"
machines = "classical"
trip = "7-8"
fault = ["7", "7-8@0.1", "7-8@0.2"]
storage = ["none", "20MW"]
observe_s = 1
scan = "0cyc"
"""
SIGNALS = "SIGKILL", "SIGKILL", "SIGINT", "SIGTERM", "SIGHUP"


def kill(rng: Random) -> Attempt:
    """A sweep that gets a signal after some time (s), alone or with its whole group."""
    words = [rng.choice(SIGNALS), f"{rng.uniform(0, 6):.3f}", rng.choice(("alone", "group"))]
    return Attempt("kill", words, {}, {"s.toml": STUDY})


def run(attempt: Attempt) -> str | None:
    """Kill it and run it again; what is wrong, or None."""
    name, delay, whom = attempt.words
    start = [sys.executable, "-m", "stabctl", "sweep", "run", "s.toml", "--out", "r.db", "--workers", "1"]
    env = os.environ | {"PYTHONPATH": str(Path(stabctl.__file__).parents[1])}
    process = subprocess.Popen(start, stderr=subprocess.PIPE, text=True, start_new_session=True, env=env)
    try:
        process.wait(float(delay))
    except subprocess.TimeoutExpired:
        (os.kill if whom == "alone" else os.killpg)(process.pid, getattr(signal, name))
    err = process.communicate(timeout=60)[1]
    if "Traceback" in err and "stabctl" in err and process.returncode != -signal.SIGINT:
        return err  # Python itself writes one if it is interrupted before the program begins
    kept = _facts() if Path("r.db").exists() else {}
    again = subprocess.run(start, capture_output=True, text=True, timeout=300, env=env)
    if again.returncode != 0:
        return f"the second run ends with {again.returncode}: {again.stderr}"
    found = _facts()
    if not kept.items() <= found.items() or found != _undisturbed():
        return f"{len(kept)} rows before, {len(found)} after, which are not those of an undisturbed sweep"
    return None


def _facts() -> dict[str, Any]:
    found = rows("r.db")
    return {row["key"]: tuple((c, str(v)) for c, v in row.items() if c not in COMPUTED) for row in found}


@cache
def _undisturbed() -> dict[str, Any]:
    Path("r.db").rename("found.db")
    try:
        with Store("r.db", SWEEP) as store:
            for one in sweep.tasks(study_file.read("s.toml"), "s.toml"):
                store.add(run_task(one))
        return _facts()
    finally:
        Path("found.db").rename("r.db")
