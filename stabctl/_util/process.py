"""The process: cores that a study uses, and garbage collection paused while many objects are created to be kept."""

import gc
import os
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from .errors import StudyError


def available() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def one_thread() -> AbstractContextManager[Any]:
    """Context in which linear algebra uses one thread: with small matrices, several would wait for each other."""
    from threadpoolctl import threadpool_limits

    return threadpool_limits(1)


def used(workers: int | None) -> int:
    """Number of threads or processes: as requested, or one per core. Raises `StudyError` for fewer than one."""
    if workers is None:
        return available()
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise StudyError(f"{workers!r} workers are not allowed; give a whole number of at least 1.")
    return workers


@contextmanager
def paused() -> Iterator[None]:
    """Pause the cyclic garbage collection, whose time grows faster than the number of objects; also a decorator."""
    running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if running:
            gc.enable()
