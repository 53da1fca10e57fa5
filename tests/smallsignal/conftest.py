"""Operating points solved once, and the reference figures where they are at hand."""

import csv
import os
from functools import cache
from pathlib import Path

import pytest

from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.smallsignal import analyze, linearize

ROOT = Path(__file__).parents[2]


@cache
def _point(name):
    return operating_point.solve(io.load(name))


@cache
def _modes(name):
    return analyze(linearize(_point(name)))


@pytest.fixture(scope="session")
def point():
    """Operating point of a packaged case."""
    return _point


@pytest.fixture(scope="session")
def modes():
    """Modes of a packaged case."""
    return _modes


@pytest.fixture(scope="session")
def reference():
    """Rows of a reference table, as dictionaries of text."""
    folder = Path(os.environ.get("STABCTL_REFERENCE", ROOT.parent / "shared" / "reference"))

    def rows(case, table):
        path = folder / case / f"{table}.csv"
        if not path.is_file():
            pytest.skip(f"no reference figures at {path}; set STABCTL_REFERENCE to their folder")
        with path.open(newline="") as file:
            return list(csv.DictReader(file))

    return rows
