"""The tasks on a Dask cluster, through its executor."""

import logging
import pickle
import re
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import suppress
from itertools import islice
from typing import Any

from stabctl import devices
from stabctl.errors import StudyError

from .result import Result, Row, signed
from .run_job import run_received
from .task import Task

PATIENCE = 5.0  # s   to wait for the scheduler
AHEAD = 4  # tasks per thread of the cluster submitted to the scheduler at a time


def rows(tasks: Iterable[Task], address: str) -> Iterator[Row]:
    """The rows of the tasks, as they are finished, from the cluster whose scheduler is at `address`.

    Closing the iterator cancels the tasks that have not started. Raises StudyError if no scheduler answers or it has no
    workers.
    """
    if not re.fullmatch(r"((tcp|tls)://)?[^/\s]+:\d+", address):
        raise StudyError(f"{address!r} is not the address of a Dask scheduler; write it as tcp://host:8786.")
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise StudyError("Dask is not installed; install it with pip install 'stabctl[cluster]'.") from None
    logging.getLogger("distributed.client").setLevel(
        logging.CRITICAL
    )  # it prints tracebacks of errors that are reported here
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except OSError as error:
        raise StudyError(
            f"No Dask scheduler answers at {address} ({error}); start one with dask scheduler, and give its address."
        ) from None
    waiting = iter(tasks)
    running: dict[Any, Task] = {}
    try:
        executor = client.get_executor(pure=False)
        while True:
            threads = sum(client.nthreads().values())
            if not threads and not running:
                raise StudyError(f"The Dask scheduler at {address} has no workers; start some: dask worker {address}.")
            for task in islice(waiting, max(0, AHEAD * threads - len(running))):
                running[executor.submit(run_received, devices.registered(), pickle.dumps(task))] = task
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield _row(future, running.pop(future), address, KilledWorker)
    finally:
        for future in running:
            future.cancel()
        with suppress(Exception):
            client.close(timeout=PATIENCE)


def _row(future: Future, task: Task, address: str, killed: type[Exception]) -> Row:
    """The row of a task; jobs do not raise, so an exception comes from the cluster."""
    try:
        return future.result()
    except killed:
        text = (
            "The worker of the cluster died repeatedly while running this job. Give it more memory, or check its input."
        )
        return Row(task.key, task.job, signed(Result("error", message=text)))
    except CancelledError:
        text = f"The Dask scheduler at {address} stopped; run the same command again to continue with the rows so far."
        raise StudyError(text) from None
    except Exception as error:
        raise StudyError(
            f"The workers of {address} cannot run the jobs ({type(error).__name__}: {error}); install this version of "
            "stabctl there."
        ) from None
