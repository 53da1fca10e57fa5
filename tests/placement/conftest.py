"""A system, and a fleet found for two contingencies of it."""

import pytest
from sitings import NEAR_6, NEAR_9, study


@pytest.fixture(scope="session")
def case(cases):
    return cases("ieee39").classical()


@pytest.fixture(scope="session")
def both(case):
    return study(case, NEAR_9, NEAR_6)
