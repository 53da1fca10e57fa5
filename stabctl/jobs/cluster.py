"""Jobs of a study on a Dask cluster, through its executor.

What tasks share (a case, an operating point) goes to the workers once. A few tasks per thread are submitted at a time.
If the scheduler stops, those under way are submitted again to the next one at its address.
"""

import hashlib
import logging
import pickle
import re
import time
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import suppress
from threading import Lock
from typing import Any

from stabctl import devices
from stabctl._util.errors import StudyError

from .task import Row, Task, row, run_received

PATIENCE = 5.0  # s   to wait for the scheduler
RETURN = 120.0  # s   to wait for a scheduler that has stopped, and for workers, until it is given up
COUNTED = 2.0  # s   after which the threads are counted again
AHEAD = 4  # tasks per thread of the cluster submitted to the scheduler at a time


class Cluster:
    """The cluster whose scheduler is at `address`; any thread may use it.

    Raises `StudyError` if no scheduler answers or it has no workers.
    """

    def __init__(self, address: str) -> None:
        if not isinstance(address, str) or not re.fullmatch(r"((tcp|tls)://)?[^/\s]+:\d+", address):
            raise StudyError(f"{address!r} is not the address of a Dask scheduler; write it as tcp://host:8786.")
        try:
            from distributed import KilledWorker
        except ImportError:
            raise StudyError("Dask is not installed; install it with pip install 'stabctl[cluster]'.") from None
        for name in ("distributed.client", "distributed.core", "distributed.comm"):
            logging.getLogger(name).setLevel(logging.CRITICAL)  # they print tracebacks of errors that are reported here
        self.address, self._killed, self._lock = address, KilledWorker, Lock()
        self._sent: dict[tuple[int, str], Any] = {}  # what tasks share, kept on the cluster
        try:
            self._client = self._connected()
        except OSError as error:
            raise StudyError(
                f"No Dask scheduler answers at {address} ({error}); start one with dask scheduler, and give its "
                "address."
            ) from None
        if not self.threads:
            self.close()
            raise StudyError(f"The Dask scheduler at {address} has no workers; start some: dask worker {address}.")

    def _connected(self) -> Any:
        from distributed import Client

        return Client(self.address, timeout=PATIENCE, set_as_default=False)

    @property
    def threads(self) -> int:
        """Threads of the workers."""
        try:
            return sum(self._client.nthreads().values())
        except Exception:  # the scheduler has stopped, which shows in the results
            return 0

    def rows(self, tasks: Iterable[Task]) -> Iterator[Row]:
        """The rows of the tasks, as they are finished. Closing the iterator cancels the tasks that have not started."""
        waiting, running = deque(tasks), {}  # type: deque[Task], dict[Future, Task]
        most, asked = 0, -COUNTED
        try:
            while waiting or running:
                client = self._client
                if time.monotonic() - asked > COUNTED:
                    most, asked = AHEAD * max(1, self.threads), time.monotonic()
                for _ in range(min(len(waiting), max(0, most - len(running)))):
                    task = waiting.popleft()
                    running[self._submit(client, task)] = task
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    task = running.pop(future)
                    done = self._row(future, task)
                    if done is not None:
                        yield done
                        continue
                    self._restore(client)
                    waiting.extendleft([task, *running.values()])
                    running.clear()
                    break
        finally:
            for future in running:
                future.cancel()

    def ask(self, task: Task) -> Row:
        """The row of a task."""
        return next(self.rows([task]))

    def close(self) -> None:
        """Leave the cluster."""
        with suppress(Exception):
            self._client.close(timeout=PATIENCE)

    def _submit(self, client: Any, task: Task) -> Future:
        """Submit a task; what it shares with others goes to the workers once, as the result of a task of its own."""
        shared = pickle.dumps(task.shared)
        try:
            name = f"shared-{hashlib.sha256(shared).hexdigest()}"
            sent = self._sent.setdefault((id(client), name), client.submit(bytes, shared, key=name))
            own = pickle.dumps(task._replace(shared=None))
            return client.get_executor(pure=False).submit(run_received, devices.registered(), own, sent)
        except Exception:  # the scheduler has stopped
            lost: Future = Future()
            lost.set_exception(CancelledError())
            return lost

    def _restore(self, lost: Any) -> None:
        """Connect again after the scheduler has stopped, unless another thread has done so."""
        with self._lock:
            if self._client is not lost:
                return
            self.close()
            until = time.monotonic() + RETURN
            while time.monotonic() < until:
                with suppress(OSError):
                    self._client = self._connected()
                    while time.monotonic() < until:
                        if self.threads:
                            return
                        time.sleep(1.0)
                time.sleep(1.0)
            raise StudyError(
                f"The Dask scheduler at {self.address} stopped; run the same command again to continue with the rows "
                "so far."
            )

    def _row(self, future: Future, task: Task) -> Row | None:
        """The row of a task, None if the scheduler has stopped; jobs do not raise: an exception is the cluster's."""
        try:
            return future.result()
        except self._killed:
            text = (
                "The worker of the cluster died repeatedly while running this job. Give it more memory, or check its "
                "input."
            )
            return row(task, {}, "error", text)
        except CancelledError:
            return None
        except StudyError:
            raise
        except Exception as error:
            raise StudyError(
                f"The workers of {self.address} cannot run the jobs ({type(error).__name__}: {error}); install this "
                "version of stabctl there."
            ) from None
