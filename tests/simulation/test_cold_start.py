"""The first run on a machine: a second process compiles the stepper, for every system."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

COMMAND = sys.executable, "-m", "stabctl", "simulate", "two_area", "--fault", "7-8@0.4", "--clear", "6cyc", "--json"


@pytest.fixture
def cold(tmp_path):
    """Surroundings without machine code."""
    return os.environ | {"XDG_CACHE_HOME": str(tmp_path)}


def codes(folder: Path) -> set[Path]:
    """Machine code of the stepper."""
    return set(folder.rglob("*.advance-*.obj"))


def test_the_stepper_compiled_apart_serves_a_system_with_devices(cold, tmp_path):
    subprocess.run([sys.executable, "-m", "stabctl.simulation.prepare"], env=cold, check=True)
    before = codes(tmp_path)
    assert len(before) == 1
    subprocess.run([*COMMAND, "--classical"], env=cold, check=True, capture_output=True)  # few devices to compile
    assert codes(tmp_path) == before


def test_an_interrupted_first_run_leaves_no_process_behind(cold, tmp_path):
    run = subprocess.Popen(
        COMMAND, env=cold, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    while not (tmp_path / "stabctl").is_dir() and run.poll() is None:
        time.sleep(0.05)
    time.sleep(0.5)
    run.send_signal(signal.SIGINT)
    out, said = run.communicate(timeout=60)
    assert (run.returncode, out) == (130, "")
    assert said.splitlines()[-1] == "stabctl: interrupted."
    with pytest.raises(ProcessLookupError):
        os.killpg(run.pid, 0)  # nobody of its group is left
