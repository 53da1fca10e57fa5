"""Description of the machine, date, timing, and earlier versions of the package."""

import datetime
import os
import platform
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


def timed(call: Callable[[], object]) -> float:
    """Seconds of one call."""
    before = time.perf_counter()
    call()
    return time.perf_counter() - before


def stated() -> str:
    """Processor and date, in words."""
    info = Path("/proc/cpuinfo")
    names = [k for k in info.read_text().splitlines() if k.startswith("model name")] if info.exists() else []
    name = names[0].partition(":")[2].strip() if names else platform.processor() or platform.machine()
    return f"{name}, one core, {datetime.date.today()}"


def cpu(call: Callable[[], object]) -> float:
    """Processor seconds of one call."""
    before = time.process_time()
    call()
    return time.process_time() - before


def cpu_of_children() -> float:
    """Processor seconds of all child processes that have ended."""
    used = os.times()
    return used.children_user + used.children_system


@contextmanager
def archived(commit: str) -> Iterator[Path]:
    """A folder with the files of a commit of this repository."""
    with tempfile.TemporaryDirectory() as name:
        files = subprocess.run(["git", "archive", commit], cwd=Path(__file__).parent.parent, capture_output=True)
        if files.returncode:
            raise SystemExit(f"Commit {commit} is not in this repository.")
        subprocess.run(["tar", "x", "-C", name], input=files.stdout, check=True)
        yield Path(name)
