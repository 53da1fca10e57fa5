"""A task is run; any error is recorded in its row."""

import os
import pickle
import platform
import time
from functools import lru_cache
from typing import Any

from stabctl import devices
from stabctl.errors import StabctlError, bug

from .task import Row, Task, row

KEPT = 8  # shared data that a worker of a cluster keeps


def run_task(task: Task) -> Row:
    """Run the job of a task; an error becomes its row."""
    began = time.perf_counter()
    try:
        return completed(task)
    except StabctlError as error:
        return row(task, {}, "error", " ".join(str(error).split()), **_here(began))
    except Exception as error:
        return row(task, {}, "bug", bug(error), **_here(began))


def completed(task: Task) -> Row:
    """Run the job of a task; raises what the job raises."""
    began = time.perf_counter()
    found = task.kind.run(task)
    return row(task, found.values, "ok", found.message, **_here(began))


def _here(began: float) -> dict[str, Any]:
    return {"wall": time.perf_counter() - began, "worker": f"{platform.node()}:{os.getpid()}"}


def run_received(files: tuple[str, ...], task: bytes, shared: bytes) -> Row:
    """Register the user's devices in `files`, which unpickling the case may need, and run a pickled task."""
    devices.register_missing(files)
    return run_task(pickle.loads(task)._replace(shared=_unpacked(shared)))  # from the process that made the study


@lru_cache(KEPT)
def _unpacked(shared: bytes) -> Any:
    return pickle.loads(shared)
