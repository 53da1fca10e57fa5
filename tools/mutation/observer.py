"""What is seen of a run of tests: order, first failure, times, and the functions that every test executes."""

import ast
import json
import time
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from types import TracebackType

import pytest


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
