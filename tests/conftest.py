"""Fixtures: packaged cases and their operating points, made once, and the folder of reference data."""

import os
from functools import cache
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from stabctl import equilibrium, read

settings.register_profile(
    "stabctl",
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("stabctl")


@pytest.fixture(scope="session")
def cases():
    """name -> packaged case, loaded once."""
    return cache(read.load)


@pytest.fixture(scope="session")
def points(cases):
    """name -> operating point of a packaged case, solved once."""
    return cache(lambda name: equilibrium.solve(cases(name)))


@pytest.fixture(scope="session")
def reference():
    """Folder of the independent simulator's data."""
    root = Path(__file__).resolve().parent.parent
    folder = Path(os.environ.get("STABCTL_REFERENCE", root.parent / "shared" / "reference"))
    if not folder.is_dir():
        pytest.skip(f"no reference data in {folder}; set STABCTL_REFERENCE to their folder")
    return folder
