"""Operating points with a storage device at every machine, made once."""

from functools import cache

import pytest

from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.model import fleet

STUDIES = {  # case, classical, storage, fault, circuit opened, cycles until clearing (0.9 of the critical)
    "ieee39 classical": ("ieee39", True, "5%mva", "16", "16-17", 8),
    "two_area classical": ("two_area", True, "50MW", "7", "7-8", 8),
    "two_area": ("two_area", False, "50MW", "7", "7-8", 11),
    "wnaps": ("wnaps", False, "5%mva", "83", "83-33", 5),
}


@cache
def _study(name):
    from stabctl.simulation.contingency import Contingency

    case, classical, storage, fault, trip, cycles = STUDIES[name]
    loaded = io.load(case)
    loaded = loaded.classical() if classical else loaded
    point = operating_point.solve(loaded.with_storage(fleet.everywhere(loaded, storage)))
    return point, Contingency(fault, cycles / 60, [trip]), 1 + cycles / 60, (fault, [trip])


@pytest.fixture(scope="session")
def study():
    """Point, events, instant of clearing, (fault, trip) of a study by name."""
    return _study
