"""Fixtures: packaged cases and their operating points, made once, and the reference data."""

import gc
import sys
from functools import cache
from pathlib import Path

import environment  # noqa: F401
import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from terminal import said

from stabctl import cli, io
from stabctl.dynamics import operating_point

settings.register_profile(
    "stabctl",
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("stabctl")


def pytest_collection_finish():
    """What is imported stays; the collector need not look through it again and again."""
    gc.freeze()


@pytest.fixture(scope="session")
def cases():
    """name -> packaged case, loaded once."""
    return cache(io.load)


@pytest.fixture(scope="session")
def points(cases):
    """name -> operating point of a packaged case, solved once."""
    return cache(lambda name: operating_point.solve(cases(name)))


@pytest.fixture(scope="session")
def reference():
    """(case, table) -> columns of reference values; their sources are in reference/data/README.md."""
    folder = Path(__file__).parent / "reference" / "data"
    return cache(lambda case, table: np.genfromtxt(folder / case / f"{table}.csv", delimiter=",", names=True))


@pytest.fixture
def stabctl(monkeypatch, capsys):
    """Calls the command line; (exit code, stdout, stderr)."""

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["stabctl", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        out, err = capsys.readouterr()
        return stop.value.code, out, said(err)

    return call
