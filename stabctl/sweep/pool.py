"""Worker processes on this machine: each runs one job at a time, and none outlives the process that started it.

If the operating system has a fork server, it loads the machine code once and the workers are forked from it; otherwise
the first worker compiles the code before the others start. If a worker dies, its job is run again; one dead worker
breaks the executors of `concurrent.futures` and loky as a whole.
"""

import importlib
import multiprocessing
import os
import signal
import sys
import threading
import time
import warnings
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from multiprocessing import connection
from typing import Any

from stabctl import devices
from stabctl._util.errors import StudyError
from stabctl.jobs.task import Row, Task, row, run_task

TRIES = 3  # of a job whose worker dies, and to start a worker
PAUSE = 0.2  # s   before another try
WARM = "stabctl.sweep._warm"  # its import loads the machine code
METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
ENVIRONMENT = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "PYTHONSAFEPATH"), "1"
)  # one worker per core: libraries use one thread, and nothing is imported from the current folder


def rows(tasks: Iterable[Task], workers: int) -> Iterator[Row]:
    """The rows of the tasks, as they are finished. Closing the iterator ends the workers and their current jobs."""
    waiting, failed = deque(tasks), 0
    active: list[Worker] = []
    lost: Counter[str] = Counter()
    try:
        active.append(Worker())
        while waiting or any(w.task for w in active):
            ready = connection.wait([w.pipe for w in active])
            for worker in [w for w in active if w.pipe in ready]:
                try:
                    done = worker.pipe.recv()
                except (EOFError, OSError):
                    active.remove(worker)
                    done, how, task = None, worker.end(), worker.task
                    if task is None:
                        failed += 1
                        if failed == TRIES:
                            raise StudyError(f"The worker processes failed to start: the process {how}.") from None
                    else:
                        lost[task.key] += 1
                        if lost[task.key] == TRIES:
                            done = _given_up(task, how)
                        else:
                            waiting.appendleft(task)
                    active.append(Worker())
                else:
                    if isinstance(done, StudyError):
                        raise done
                    failed = 0
                    worker.take(waiting.popleft() if waiting else None)
                    active.extend(Worker() for _ in range(min(workers - len(active), len(waiting))))
                if done is not None:
                    yield done
    finally:
        for worker in active:
            worker.end()


class Worker:
    """A process and the pipe to it; it reports once that it is ready, then a row for every task."""

    def __init__(self) -> None:
        context: Any = multiprocessing.get_context(METHOD)
        self.task: Task | None = None
        self.pipe, theirs = context.Pipe()
        try:
            for left in reversed(range(TRIES)):
                self.process = context.Process(target=_serve, args=(theirs, devices.registered()), daemon=True)
                try:
                    _start(self.process)
                    break
                except (EOFError, OSError) as error:
                    if not left:
                        said = f"{type(error).__name__} {error}"
                        raise StudyError(f"The worker processes failed to start: {said}.") from None
                    time.sleep(PAUSE)  # a fork server that was killed just now is not yet seen to be gone
        finally:
            theirs.close()

    def take(self, task: Task | None) -> None:
        """Start a task, if there is one."""
        self.task = task
        if task is not None:
            with suppress(OSError):  # it has died, which shows when the pipe is read
                self.pipe.send(task)

    def end(self) -> str:
        """End the process, if it has not ended; how it ended, in words."""
        self.process.kill()
        self.process.join()
        self.pipe.close()
        code = self.process.exitcode or 0
        return f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"


def _start(process: multiprocessing.Process) -> None:
    """Start a process that ignores Ctrl-C, which the starting process handles."""
    if METHOD != "forkserver":
        with _environment(), _without_script():
            process.start()
        return
    from multiprocessing import forkserver, resource_tracker

    multiprocessing.set_forkserver_preload([WARM])
    resource_tracker.ensure_running()  # first, because it unblocks Ctrl-C when it starts
    with _environment():
        forkserver.ensure_running()
    with _without_script():
        process.start()  # waits while the server compiles, and may be interrupted


@contextmanager
def _environment() -> Iterator[None]:
    """The environment of a process started in this context: `ENVIRONMENT`, and Ctrl-C blocked if possible."""
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


@contextmanager
def _without_script() -> Iterator[None]:
    """A process started in this context does not run the script again, which it does not need."""
    script: dict[str, Any] = vars(sys.modules["__main__"])
    hidden: dict[str, Any] = {name: script[name] for name in ("__file__", "__spec__") if name in script}
    script.update(dict.fromkeys(hidden))
    try:
        yield
    finally:
        script.update(hidden)


def _serve(pipe: connection.Connection, files: Mapping[str, str]) -> None:
    """The main function of a worker; `files` are the user's devices, which a case received may need."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_follow, daemon=True).start()
    warnings.simplefilter("ignore", RuntimeWarning)
    importlib.import_module(WARM)
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):  # the starting process is gone
        try:
            devices.register_as(files)
            pipe.send(None)
        except StudyError as error:
            pipe.send(error)
        while True:
            pipe.send(run_task(pipe.recv()))


def _follow() -> None:
    """End this process with the one that started it."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


def _given_up(task: Task, how: str) -> Row:
    text = f"The worker died {TRIES} times while running this job; most recently it {how}. Add memory or check the job."
    return row(task, {}, "error", text)
