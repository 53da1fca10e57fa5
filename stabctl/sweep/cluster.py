"""The same tasks on a Dask cluster, through its executor."""

import logging
import re
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import suppress
from itertools import islice

from stabctl.errors import StudyError

from .perform import perform
from .result import Result, Row, signed
from .task import Task

PATIENCE = 5.0  # s   waited for the scheduler
AHEAD = 4  # tasks a thread of the cluster that are with the scheduler at a time


def rows(tasks: Iterable[Task], address: str) -> Iterator[Row]:
    """The rows of the tasks, as they are found, from the cluster whose scheduler is at `address`.

    Closing the iterator cancels what has not begun. `StudyError` where no scheduler answers or it has no workers.
    """
    if not re.fullmatch(r"((tcp|tls)://)?[^/\s]+:\d+", address):
        raise StudyError(f"{address!r} is not the address of a Dask scheduler; write it as tcp://host:8786.")
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise StudyError("Dask is not installed; install it with pip install 'stabctl[cluster]'.") from None
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # it prints tracebacks of what is told here
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except OSError as error:
        raise StudyError(
            f"No Dask scheduler answers at {address} ({error}); start one with dask scheduler, and give its address."
        ) from None
    waiting, running = iter(tasks), {}
    try:
        executor = client.get_executor(pure=False)
        while True:
            threads = sum(client.nthreads().values())
            if not threads and not running:
                raise StudyError(f"The Dask scheduler at {address} has no workers; start some: dask worker {address}.")
            for task in islice(waiting, max(0, AHEAD * threads - len(running))):
                running[executor.submit(perform, task)] = task
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
    """What became of a task; a job cannot raise, so that an exception tells of the cluster."""
    try:
        return future.result()
    except killed:
        text = "The worker of the cluster died at this job, again and again. Give it more memory, or look at its input."
        return Row(task.key, task.job, signed(Result("error", message=text)))
    except CancelledError:
        text = (
            f"The Dask scheduler at {address} went away; run the same command again, which goes on with what is there."
        )
        raise StudyError(text) from None
    except Exception as error:
        raise StudyError(
            f"The workers of {address} cannot do the jobs ({type(error).__name__}: {error}); install this version of "
            "stabctl there."
        ) from None
