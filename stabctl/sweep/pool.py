"""Worker processes of this machine: each does a job at a time, and none outlives the process that started it.

Where the system has a fork server, it readies the machine code once and the workers are forked from it; elsewhere the
first worker readies the code on disk before the others start. A worker that dies takes down nothing but its try.
"""

import importlib
import multiprocessing
import os
import signal
import threading
import warnings
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import connection

from stabctl.errors import StudyError

from .result import Result, Row, signed
from .task import Task

TRIES = 3  # of a job whose worker dies, and of a worker that does not start
WARM = "stabctl.sweep.warm"  # its import readies the machine code
METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
ENVIRONMENT = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "PYTHONSAFEPATH"), "1"
)  # a worker a core: libraries start no threads of their own, and nothing is imported from the folder the user is in


def rows(tasks: Iterable[Task], workers: int) -> Iterator[Row]:
    """The rows of the tasks, as they are found. Closing the iterator ends the workers and drops what they are at."""
    waiting, stillborn = deque(tasks), 0
    crew: list[Worker] = []
    lost: Counter[str] = Counter()
    try:
        crew.append(Worker())
        while waiting or any(w.task for w in crew):
            ready = connection.wait([w.pipe for w in crew])
            for worker in [w for w in crew if w.pipe in ready]:
                try:
                    row = worker.pipe.recv()
                except (EOFError, OSError):
                    crew.remove(worker)
                    row, how, task = None, worker.end(), worker.task
                    if task is None:
                        stillborn += 1
                        if stillborn == TRIES:
                            raise StudyError(f"The workers do not start: the process {how}.") from None
                    else:
                        lost[task.key] += 1
                        if lost[task.key] == TRIES:
                            row = _given_up(task, how)
                        else:
                            waiting.appendleft(task)
                    crew.append(Worker())
                else:
                    stillborn = 0
                    worker.take(waiting.popleft() if waiting else None)
                    crew.extend(Worker() for _ in range(min(workers - len(crew), len(waiting))))
                if row is not None:
                    yield row
    finally:
        for worker in crew:
            worker.end()


class Worker:
    """A process and the pipe to it; it says once that it is ready, then a row for every task."""

    def __init__(self) -> None:
        context = multiprocessing.get_context(METHOD)
        self.task: Task | None = None
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs,), daemon=True)
        try:
            _start(self.process)
        except (EOFError, OSError) as error:
            raise StudyError(f"The workers do not start: {type(error).__name__} {error}.") from None
        finally:
            theirs.close()

    def take(self, task: Task | None) -> None:
        """Begin a task; nothing where there is none."""
        self.task = task
        if task is not None:
            with suppress(OSError):  # it has died; reading from the pipe tells
                self.pipe.send(task)

    def end(self) -> str:
        """End the process, if it has not ended; how it did, in words."""
        self.process.kill()
        self.process.join()
        self.pipe.close()
        code = self.process.exitcode or 0
        return f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"


def _start(process: multiprocessing.Process) -> None:
    """Start a process that Ctrl-C does not reach: that is the business of the one that started it."""
    if METHOD != "forkserver":
        with _surroundings():
            process.start()
        return
    from multiprocessing import forkserver, resource_tracker

    multiprocessing.set_forkserver_preload([WARM])
    resource_tracker.ensure_running()  # before, as it unblocks Ctrl-C when it starts
    with _surroundings():
        forkserver.ensure_running()
    process.start()  # waits for a server that compiles, and may be interrupted


@contextmanager
def _surroundings() -> Iterator[None]:
    """What a process started meanwhile finds: `ENVIRONMENT`, and Ctrl-C blocked where the system can."""
    before = {name: os.environ.get(name) for name in ENVIRONMENT}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if hasattr(signal, "pthread_sigmask") else None
    os.environ.update(ENVIRONMENT)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _serve(pipe: connection.Connection) -> None:
    """The life of a worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_follow, daemon=True).start()
    warnings.simplefilter("ignore", RuntimeWarning)
    importlib.import_module(WARM)
    from .perform import perform

    pipe.send(None)
    with suppress(EOFError):
        while True:
            pipe.send(perform(pipe.recv()))


def _follow() -> None:
    """End this process, whatever it is at, with the one that started it."""
    multiprocessing.parent_process().join()
    os._exit(1)


def _given_up(task: Task, how: str) -> Row:
    text = f"The worker died {TRIES} times at this job; the last one {how}. Give it more memory, or look at its input."
    return Row(task.key, task.job, signed(Result("error", message=text)))
