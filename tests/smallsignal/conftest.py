"""Operating points and modes of the packaged cases, each solved once."""

from functools import cache

import pytest

from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.smallsignal import analyze, linearize


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
