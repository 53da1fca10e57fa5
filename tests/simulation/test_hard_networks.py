"""Systems whose voltages need Newton's method at many stages: every recorded row solves the network."""

import numpy as np
import pytest
from hard import hard

from stabctl.dynamics import operating_point
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run

FAULTS = {"wscc9": "8", "two_area, constant power": "8", "wnaps, constant power": "100"}
SYSTEMS = dict(hard())


@pytest.fixture(scope="module", params=SYSTEMS)
def traced(request):
    """A fault of five cycles that opens nothing."""
    point = operating_point.solve(SYSTEMS[request.param])
    return run(point, Contingency(FAULTS.get(request.param, "16"), 5 / 60, at=0.1), 2.0)


def test_voltages_solve_the_network_at_every_instant(traced):
    """With the currents of all devices, evaluated apart from the stepper."""
    point, starts = traced.point, np.array([c.at for c in traced.happened.changes])
    assert traced.newton_stages > 5
    for k in range(0, len(traced.time) - 1, 7):
        switching = traced.happened.changes[np.searchsorted(starts, traced.time[k] + 1e-9, "right") - 1].switching
        Y, row = point.admittance(switching), traced.rows[k, : point.layout.size].copy()
        found = np.linalg.solve(Y.toarray(), point.equations.at(row).currents)
        assert np.abs(found - traced.arrays.V[k]).max() < 2e-7, traced.time[k]  # 1e-7 by fixed-point iteration
