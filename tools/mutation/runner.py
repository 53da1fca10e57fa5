"""Runs tests of a copy of the tree in a process of their own, forked from one that has imported the libraries.

Seen of a run are its first failure, the times of the tests, and the functions that every test executes.
"""

import ast
import json
import multiprocessing
import os
import resource
import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import pytest

LIBRARIES = (
    "numpy scipy.linalg scipy.sparse.linalg scipy.optimize scipy.integrate numba pandas xarray matplotlib.pyplot "
    "control cvxpy rich.console click pydantic jinja2 hypothesis pytest filterpy.kalman coverage"
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
    plugin = Observer(last, order)
    words = [*files, "-q", "-n", "0", "-p", "no:cacheprovider", *(["-x"] if order is not None else [])]
    with Watched(tree, measured, plugin):
        code = int(pytest.main(words, plugins=[plugin]))
    os._exit(0 if code == pytest.ExitCode.NO_TESTS_COLLECTED else code)


class Observer:
    """A plugin of pytest that orders the tests, reports the one that is running, and measures each."""

    def __init__(self, last: Path, order: Sequence[str] | None) -> None:
        self.last, self.coverage = last, None
        self.order = None if order is None else {name: i for i, name in enumerate(order)}
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep the tests wanted, in their order."""
        if self.order is not None:
            items[:] = sorted((i for i in items if i.nodeid in self.order), key=lambda i: self.order[i.nodeid])

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Measure one test with its fixtures."""
        self.last.write_text(item.nodeid)
        if self.coverage:
            self.coverage.switch_context(item.nodeid)
        began = time.perf_counter()
        try:
            return (yield)
        finally:
            self.seconds[item.nodeid] = round(time.perf_counter() - began, 3)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note what fails or is skipped."""
        if not report.passed:
            self.failed.add(report.nodeid)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note a file that cannot be read."""
        if report.failed:
            self.last.write_text(f"{report.nodeid} cannot be imported")


class Watched:
    """Records the functions of stabctl that every test executes; does nothing without a file to write to."""

    def __init__(self, tree: Path, target: Path | None, observer: Observer) -> None:
        self.tree, self.target, self.observer = tree, target, observer

    def __enter__(self) -> None:
        if self.target:
            import coverage

            self.observer.coverage = coverage.Coverage(data_file=None, include=[f"{self.tree}/stabctl/*"])
            self.observer.coverage.start()

    def __exit__(self, kind: type | None, error: BaseException | None, traceback: TracebackType | None) -> None:
        if not self.target:
            return
        seen = self.observer
        seen.coverage.stop()
        data, runs = seen.coverage.get_data(), {}
        for file in (f for f in data.measured_files() if f.endswith(".py")):  # pages are made of templates
            path = Path(file).relative_to(self.tree)
            for line, tests in data.contexts_by_lineno(file).items():
                runs.setdefault(f"{path}:{function_at(self.tree, str(path), line)}", set()).update(tests)
        passed = {name: s for name, s in seen.seconds.items() if name not in seen.failed}
        executed = {name: sorted(tests & set(passed)) for name, tests in runs.items()}
        self.target.write_text(json.dumps({"seconds": passed, "failed": sorted(seen.failed), "executed": executed}))


def function_at(root: Path, path: str, line: int) -> str:
    """Qualified name of the innermost function around a line; empty outside of functions."""
    return next((name for first, last, name in _functions(root, path) if first <= line <= last), "")


@cache
def _functions(root: Path, path: str) -> list[tuple[int, int, str]]:
    """First line, last line and name of the bodies of all functions, inner ones first."""

    def inside(node: ast.AST, name: str) -> Iterator[tuple[int, int, str]]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef | ast.ClassDef):
                yield from inside(child, f"{name}.{child.name}")
            else:
                yield from inside(child, name)
        if isinstance(node, ast.FunctionDef):
            yield node.body[0].lineno, node.end_lineno or node.lineno, name

    return [*inside(ast.parse((root / path).read_text(encoding="utf-8")), "")]
