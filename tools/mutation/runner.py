"""Runs tests of a copy of the tree in a process of their own, forked from one that has imported the libraries."""

import multiprocessing
import os
import resource
import signal
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

LIBRARIES = (
    "numpy scipy.linalg scipy.sparse.linalg scipy.optimize scipy.integrate numba pandas xarray matplotlib.pyplot "
    "control cvxpy rich.console typer pydantic jinja2 hypothesis pytest filterpy.kalman coverage"
)
ENDLESS = None, -signal.SIGXCPU, -signal.SIGKILL


class Outcome(NamedTuple):
    """How a run of tests ended."""

    passed: bool
    failed: str  # the first test that failed, or why the run ended


class Runner:
    """Starts the runs, one at a time."""

    def __init__(self, tree: Path, cache: Path, log: Path) -> None:
        os.environ |= {
            "XDG_CACHE_HOME": str(cache),
            "MPLBACKEND": "agg",
            **dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
        }
        self.tree, self.log = tree, log
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(LIBRARIES.split())

    def run(self, files: Sequence[str], order: Sequence[str] | None, seconds: float, measured: Path | None) -> Outcome:
        """Run the tests of these files, or some of them in this order until one fails.

        Parameters
        ----------
        files
            Test files in the tree.
        order
            The tests to run; None for all of them, also after a failure.
        seconds
            Processor time after which the run is ended; it counts as failed.
        measured
            Where to write which functions every test executes; None if that is not wanted.
        """
        last = self.log.with_name("last")
        last.write_text("no test")
        arguments = self.tree, files, order, int(seconds), measured, self.log, last
        process = self._context.Process(target=_run, args=arguments)
        process.start()
        process.join(20 * seconds)
        code = process.exitcode
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # with the programs that the tests have started
        process.join()
        why = "" if code in (0, 1, 2) else " (no end in sight)" if code in ENDLESS else " (crashed)"
        return Outcome(code == 0, last.read_text() + why)


def _run(
    tree: Path,
    files: Sequence[str],
    order: Sequence[str] | None,
    seconds: int,
    measured: Path | None,
    log: Path,
    last: Path,
) -> None:
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    os.chdir(tree)
    out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(out, 1)
    os.dup2(out, 2)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    import pytest

    from .observer import Observer, Watched

    plugin = Observer(last, order)
    words = [*files, "-q", "-n", "0", "-p", "no:cacheprovider", *(["-x"] if order is not None else [])]
    with Watched(tree, measured, plugin):
        code = int(pytest.main(words, plugins=[plugin]))
    os._exit(0 if code == pytest.ExitCode.NO_TESTS_COLLECTED else code)
